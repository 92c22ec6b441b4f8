#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::host {

/// The dependencies of a library, as its file lists them.
struct LibraryNeeds {
  std::vector<std::string> names;    ///< File names: "libpugixml.so.1".
  std::vector<std::string> folders;  ///< Folders to search first, with "$ORIGIN" unexpanded.
};
/// Empty if it is no dynamic ELF library.
///
/// @threads  Reentrant.
[[nodiscard]] LibraryNeeds needs_of(const std::filesystem::path& library);

}  // namespace fastcycle::host
