#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/description.h"
#include "config/problem.h"
#include "fastcycle/library.h"
#include "host/application.h"

namespace fastcycle::host {

/// Where component libraries are looked for, in this order: what the command line says, what the
/// application says, beside the application, the installed ones.
[[nodiscard]] std::vector<std::filesystem::path> library_folders(
    const config::ApplicationDescription& description,
    const std::vector<std::filesystem::path>& from_command_line);

/// The folder of libfastcycle.so, from which installed things are found: `fastcycle` in it holds
/// the component libraries, and FASTCYCLE_HELPERS (src/host/CMakeLists.txt) leads from it to the
/// helper programs.
[[nodiscard]] std::filesystem::path core_library_folder();

/// The text of a library's build note, read from the file without loading it.
struct BuildNote {
  std::optional<std::string> text;  ///< None: the file has no such note.
  std::string error;                ///< Why the file cannot be read as an ELF library; else empty.
};
[[nodiscard]] BuildNote read_build_note(const std::filesystem::path& file);

/// What the note of a library must say so that this host may load it.
[[nodiscard]] std::string host_build_note();

/// Finds, checks and opens component libraries. An opened library stays mapped until the process
/// ends: messages and callbacks of its types may outlive every component.
///
/// @threads  Confined to the control thread.
class LibraryLoader final : public ComponentClasses {
 public:
  explicit LibraryLoader(std::vector<std::filesystem::path> folders);

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override;

  /// Opens the library `name` if it is not open yet; null after adding to `problems`.
  const ComponentLibrary* open(const std::string& name, const config::Place& place,
                               config::Problems& problems);

  /// The file of library `name`; empty if there is none in any folder.
  [[nodiscard]] std::filesystem::path file_of(const std::string& name) const;

 private:
  const ComponentLibrary* load(const std::string& name, const config::Place& place,
                               config::Problems& problems);
  [[nodiscard]] std::vector<std::string> known_names() const;

  const std::vector<std::filesystem::path> folders_;
  std::map<std::string, const ComponentLibrary*> open_;
};

}  // namespace fastcycle::host
