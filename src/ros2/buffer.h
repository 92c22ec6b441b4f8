#pragma once

#include <cstddef>
#include <span>

namespace fastcycle::ros2 {

/// Bytes that grow at their end; those that are added are not set to zero first.
///
/// @threads  Confined.
/// @realtime Allocates where it grows; `clear` keeps what was allocated.
class Buffer {
 public:
  Buffer() = default;
  Buffer(Buffer&& other) noexcept;
  Buffer& operator=(Buffer&& other) noexcept;
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  ~Buffer();

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::byte* data() noexcept { return data_; }
  [[nodiscard]] const std::byte* data() const noexcept { return data_; }
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return {data_, size_}; }

  void clear() noexcept { size_ = 0; }
  /// Makes room for `size` bytes in all.
  void reserve(std::size_t size);
  /// Adds `count` bytes, whose values are for the caller to set, and gives the first of them.
  std::byte* grow(std::size_t count);

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace fastcycle::ros2
