#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::host {

/// What a library has loaded with it, as its file says.
struct LibraryNeeds {
  std::vector<std::string> names;    ///< Of files: "libpugixml.so.1".
  std::vector<std::string> folders;  ///< Where to look for them first, with "$ORIGIN" as it stands.
};
/// Empty if it is no ELF library that says so.
///
/// @threads  Reentrant.
[[nodiscard]] LibraryNeeds needs_of(const std::filesystem::path& library);

}  // namespace fastcycle::host
