#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace fastcycle::host {

/// A file mapped for reading; owns the mapping. Empty, with a reason, if mapping failed.
///
/// @threads  Compatible.
class MappedFile {
 public:
  explicit MappedFile(const std::filesystem::path& file);
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  ~MappedFile();

  /// The `size` bytes from `offset` on, if the file has that many.
  [[nodiscard]] std::optional<std::string_view> at(std::uint64_t offset, std::uint64_t size) const;

  /// A `T` read from `offset` on.
  template <typename T>
  [[nodiscard]] std::optional<T> read(std::uint64_t offset) const {
    const auto bytes = at(offset, sizeof(T));
    if (!bytes) {
      return std::nullopt;
    }
    T value;
    std::memcpy(&value, bytes->data(), sizeof(T));
    return value;
  }

  std::string error;  ///< Why the file cannot be read; else empty.

 private:
  void* address_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace fastcycle::host
