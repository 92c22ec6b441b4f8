#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace ads {

/// The content of a whole file.
///
/// @errors  Throws `std::runtime_error` if there is no such regular file, if it cannot be read, or
///          if it is larger than 1 GiB.
std::string read_file(const std::filesystem::path& file);

/// Creates the file, or replaces its content.
///
/// @errors  Throws `std::runtime_error` with the file and the reason.
void write_file(const std::filesystem::path& file, std::string_view content);

}  // namespace ads
