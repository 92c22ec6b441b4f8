#pragma once

#include <filesystem>
#include <string>

namespace ads {

/// The content of a whole file.
///
/// @errors  Throws `std::runtime_error` if there is no such regular file, if it cannot be read, or
/// if
///          it is larger than 1 GiB.
std::string read_file(const std::filesystem::path& file);

}  // namespace ads
