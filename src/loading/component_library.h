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

/// Search path for component libraries, in this order: the command line's folders, the application
/// file's, that file's own, its `build`, the installed ones.
[[nodiscard]] std::vector<std::filesystem::path> library_folders(
    const config::ApplicationDescription& description,
    const std::vector<std::filesystem::path>& from_command_line);

/// The folder of libfastcycle.so, from which installed files are located: its subfolder `fastcycle`
/// holds the component libraries.
[[nodiscard]] std::filesystem::path core_library_folder();
/// Path of the helper program `name`, if it is installed: FASTCYCLE_HELPERS
/// (src/loading/CMakeLists.txt), relative to the folder of libfastcycle.so.
[[nodiscard]] std::filesystem::path helper_program(const std::string& name);

/// Path of the library `name` relative to a library folder: `libworld.so` for `world`,
/// `ads/libworld.so` for `ads/world`.
[[nodiscard]] std::filesystem::path library_file(const std::string& name);

/// The text of a library's build note, read from the file without loading it.
struct BuildNote {
  std::optional<std::string> text;  ///< None: the file has no such note.
  std::string error;                ///< Why the file cannot be read as an ELF library; else empty.
};
[[nodiscard]] BuildNote read_build_note(const std::filesystem::path& file);

/// The build note that a library must have for this host to load it.
[[nodiscard]] std::string host_build_note();

/// Identity of a library file: another file of that name, or one written since, is not equal.
struct LibraryFile {
  std::uint64_t device = 0;
  std::uint64_t inode = 0;
  std::uint64_t size = 0;        ///< In bytes.
  std::int64_t modified_ns = 0;  ///< Since 1970.

  bool operator==(const LibraryFile&) const = default;
};
/// By library name.
using LibraryFiles = std::map<std::string, LibraryFile>;

/// Whether a library's file may be opened: else the reason is added to `problems`. `name` is its
/// name in messages.
[[nodiscard]] bool has_right_note(const std::string& name, const std::filesystem::path& file,
                                  const config::Place& place, config::Problems& problems);
/// The component library that was opened as `handle`; null after adding to `problems`.
[[nodiscard]] const ComponentLibrary* library_in(void* handle, const std::string& name,
                                                 const std::filesystem::path& file,
                                                 const config::Place& place,
                                                 config::Problems& problems);
/// The class of `library` that `component` names; null after adding to `problems`.
[[nodiscard]] const ComponentClass* class_of(const ComponentLibrary& library,
                                             const config::ComponentDescription& component,
                                             config::Problems& problems);

/// Finds, checks and opens component libraries, and owns the list of open ones. An opened library
/// stays mapped until the process ends: messages and callbacks of its types may outlive every
/// component.
///
/// @threads  Confined to the control thread.
class LibraryLoader final : public ComponentClasses {
 public:
  /// With `pins`, opens only these.
  explicit LibraryLoader(std::vector<std::filesystem::path> folders,
                         const std::optional<config::LibrariesDescription>& pins = {});

  /// Also warns of a class whose `serve` is never called, because the component has no period.
  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override;

  /// Opens the library `name` if it is not open yet; null after adding to `problems`.
  const ComponentLibrary* open(const std::string& name, const config::Place& place,
                               config::Problems& problems);

  /// From now on a library in `tried` is opened only if its file is unchanged: the code that runs
  /// is the code that was tried.
  void expect(LibraryFiles tried) { expected_ = std::move(tried); }
  /// The libraries opened so far, failed attempts included.
  [[nodiscard]] const LibraryFiles& files() const { return files_; }

  /// The file of library `name`; empty if no folder contains it.
  [[nodiscard]] std::filesystem::path file_of(const std::string& name) const;

 private:
  const ComponentClass* choose(const config::ComponentDescription& component,
                               config::Problems& problems);
  const ComponentLibrary* load(const std::string& name, const config::Place& place,
                               config::Problems& problems);
  /// Names of all libraries in the folders, read once.
  [[nodiscard]] const std::vector<std::string>& known_names();
  /// A suggestion for the unknown `name`; empty if there is none.
  [[nodiscard]] std::string nearest_to(const std::string& name);

  const std::vector<std::filesystem::path> folders_;
  std::map<std::string, const ComponentLibrary*> open_;
  LibraryFiles expected_;
  std::optional<PinnedLibraries> pinned_;
  LibraryFiles files_;
  std::optional<std::vector<std::string>> known_names_;
};

}  // namespace fastcycle::host
