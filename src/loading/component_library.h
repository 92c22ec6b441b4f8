#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/description.h"
#include "config/problem.h"
#include "fastcycle/library.h"
#include "loading/component_classes.h"
#include "loading/pinned_libraries.h"

namespace fastcycle::host {

/// Where component libraries are looked for, in this order: what the command line says, what the
/// application says, beside the application, in `build` beside it, the installed ones.
[[nodiscard]] std::vector<std::filesystem::path> library_folders(
    const config::ApplicationDescription& description,
    const std::vector<std::filesystem::path>& from_command_line);

/// The folder of libfastcycle.so, from which installed things are found: `fastcycle` in it holds
/// the component libraries.
[[nodiscard]] std::filesystem::path core_library_folder();
/// Where the helper program `name` lies, if it is installed; FASTCYCLE_HELPERS
/// (src/loading/CMakeLists.txt) leads there from the folder of libfastcycle.so.
[[nodiscard]] std::filesystem::path helper_program(const std::string& name);

/// Where the library `name` lies below a folder of libraries: `libworld.so` for `world`,
/// `ads/libworld.so` for `ads/world`.
[[nodiscard]] std::filesystem::path library_file(const std::string& name);

/// The text of a library's build note, read from the file without loading it.
struct BuildNote {
  std::optional<std::string> text;  ///< None: the file has no such note.
  std::string error;                ///< Why the file cannot be read as an ELF library; else empty.
};
[[nodiscard]] BuildNote read_build_note(const std::filesystem::path& file);

/// What the note of a library must say so that this host may load it.
[[nodiscard]] std::string host_build_note();

/// Which file a library is: another one of its name, or one that was written since, is not equal.
struct LibraryFile {
  std::uint64_t device = 0;
  std::uint64_t inode = 0;
  std::uint64_t size = 0;        ///< In bytes.
  std::int64_t modified_ns = 0;  ///< Since 1970.

  bool operator==(const LibraryFile&) const = default;
};
/// By the libraries' names.
using LibraryFiles = std::map<std::string, LibraryFile>;

/// Whether a library's file may be opened: else the reason is added to `problems`. `name` is what
/// people call it.
[[nodiscard]] bool has_right_note(const std::string& name, const std::filesystem::path& file,
                                  const config::Place& place, config::Problems& problems);
/// What the library offers that was opened as `handle`; null after adding to `problems`.
[[nodiscard]] const ComponentLibrary* library_in(void* handle, const std::string& name,
                                                 const std::filesystem::path& file,
                                                 const config::Place& place,
                                                 config::Problems& problems);
/// The class of `library` that `component` names; null after adding to `problems`.
[[nodiscard]] const ComponentClass* class_of(const ComponentLibrary& library,
                                             const config::ComponentDescription& component,
                                             config::Problems& problems);

/// Finds, checks and opens component libraries: owns the list of those that are open. An opened
/// library stays mapped until the process ends: messages and callbacks of its types may outlive
/// every component.
///
/// @threads  Confined to the control thread.
class LibraryLoader final : public ComponentClasses {
 public:
  /// With `pins`, only these are opened.
  explicit LibraryLoader(std::vector<std::filesystem::path> folders,
                         const std::optional<config::LibrariesDescription>& pins = {});

  /// Also warns of a class whose `serve` is never called, because the component has no period.
  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override;

  /// Opens the library `name` if it is not open yet; null after adding to `problems`.
  const ComponentLibrary* open(const std::string& name, const config::Place& place,
                               config::Problems& problems);

  /// From now on a library that is among `tried` is opened only if it is still that file: what was
  /// tried is what runs.
  void expect(LibraryFiles tried) { expected_ = std::move(tried); }
  /// What was opened so far; also what was tried in vain.
  [[nodiscard]] const LibraryFiles& files() const { return files_; }

  /// The file of library `name`; empty if there is none in any folder.
  [[nodiscard]] std::filesystem::path file_of(const std::string& name) const;

 private:
  const ComponentClass* choose(const config::ComponentDescription& component,
                               config::Problems& problems);
  const ComponentLibrary* load(const std::string& name, const config::Place& place,
                               config::Problems& problems);
  /// Of all libraries in the folders, read once.
  [[nodiscard]] const std::vector<std::string>& known_names();
  /// What may be meant by `name`, which there is not; or nothing.
  [[nodiscard]] std::string nearest_to(const std::string& name);

  const std::vector<std::filesystem::path> folders_;
  std::map<std::string, const ComponentLibrary*> open_;
  LibraryFiles expected_;
  std::optional<PinnedLibraries> pinned_;
  LibraryFiles files_;
  std::optional<std::vector<std::string>> known_names_;
};

}  // namespace fastcycle::host
