#include "common/files.h"

#include <cerrno>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

namespace ads {
namespace {

constexpr std::uintmax_t kLargestFile = std::uintmax_t{1} << 30;

}  // namespace

std::string read_file(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw std::runtime_error(fmt::format("{}: expected a file, found none", file.string()));
  }
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error || size > kLargestFile) {
    throw std::runtime_error(fmt::format("{}: expected a file of at most 1 GiB", file.string()));
  }
  std::string content(static_cast<std::size_t>(size), '\0');
  std::ifstream stream(file, std::ios::binary);
  if (!stream.read(content.data(), static_cast<std::streamsize>(size)) && size != 0) {
    throw std::runtime_error(fmt::format("{}: cannot be read", file.string()));
  }
  return content;
}

void write_file(const std::filesystem::path& file, std::string_view content) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary);
  stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  stream.close();
  if (!stream) {
    throw std::runtime_error(fmt::format("{}: cannot be written: {}", file.string(),
                                         std::generic_category().message(errno)));
  }
}

}  // namespace ads
