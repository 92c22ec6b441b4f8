#pragma once

#include <cstddef>
#include <span>

namespace fastcycle::ros2 {

/// Bytes that grow at their end; appended bytes are not zero-initialized.
///
/// @threads  Confined.
/// @realtime Allocates when it grows; `clear` keeps the memory.
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
  /// Reserves memory for `size` bytes in all.
  void reserve(std::size_t size);
  /// Appends `count` uninitialized bytes, and returns a pointer to the first of them.
  std::byte* grow(std::size_t count);

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace fastcycle::ros2
