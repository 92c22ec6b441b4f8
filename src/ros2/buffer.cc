#include "ros2/buffer.h"

#include <algorithm>
#include <cstdlib>
#include <new>
#include <utility>

namespace fastcycle::ros2 {

Buffer::Buffer(Buffer&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)),
      size_(std::exchange(other.size_, 0)),
      capacity_(std::exchange(other.capacity_, 0)) {}

Buffer& Buffer::operator=(Buffer&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  std::swap(capacity_, other.capacity_);
  return *this;
}

Buffer::~Buffer() {
  std::free(data_);
}

void Buffer::reserve(std::size_t size) {
  if (size <= capacity_) {
    return;
  }
  auto* const data = static_cast<std::byte*>(std::realloc(data_, size));
  if (data == nullptr) {
    throw std::bad_alloc();
  }
  data_ = data;
  capacity_ = size;
}

std::byte* Buffer::grow(std::size_t count) {
  constexpr std::size_t kSmallest = 256;
  if (count > capacity_ - size_) {
    reserve(std::max({size_ + count, capacity_ + capacity_ / 2, kSmallest}));
  }
  size_ += count;
  return data_ + size_ - count;
}

}  // namespace fastcycle::ros2
