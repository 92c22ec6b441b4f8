#include "segment/segment_heap.h"

#include <bit>
#include <cstring>
#include <mutex>
#include <new>

#include "fastcycle/assert.h"

namespace fastcycle::segment {
namespace {

/// Header before the memory that a caller gets.
struct BlockHead {
  std::uint32_t size_class;
  std::uint32_t mark;
  char* start;  ///< Of the whole block.
};
constexpr std::uint32_t kMark = 0x5e6b10c5;
constexpr std::size_t kUnit = 16;

/// The smallest class for `size` bytes.
unsigned class_of(std::size_t size) noexcept {
  const std::size_t units = (size + kUnit - 1) / kUnit;
  if (units <= 4) {
    return static_cast<unsigned>(units);
  }
  // units - 1 is in [2^power, 2^(power + 1)), which is divided into four.
  const auto power = static_cast<unsigned>(std::bit_width(units - 1)) - 1;
  return 4 * (power - 1) + static_cast<unsigned>(((units - 1) >> (power - 2)) & 3) + 1;
}

std::size_t size_of_class(unsigned size_class) noexcept {
  if (size_class <= 4) {
    return size_class * kUnit;
  }
  const unsigned power = (size_class - 1) / 4 + 1;
  return ((std::size_t{4} + (size_class - 1) % 4 + 1) << (power - 2)) * kUnit;
}

}  // namespace

void SegmentHeap::begin(char* begin, std::size_t size) noexcept {
  const std::lock_guard lock(mutex_);
  begin_ = begin;
  next_ = begin;
  end_ = begin + size;
  free_lists_ = {};
  statistics_ = {};
}

void* SegmentHeap::allocate(std::size_t size, std::size_t alignment) noexcept {
  if (size > static_cast<std::size_t>(end_ - begin_)) {
    const std::lock_guard lock(mutex_);
    ++statistics_.exhausted;
    return nullptr;
  }
  const std::size_t slack = alignment > kUnit ? alignment : 0;
  const unsigned size_class = class_of(size + sizeof(BlockHead) + slack);
  char* start = nullptr;
  {
    const std::lock_guard lock(mutex_);
    start = static_cast<char*>(free_lists_[size_class]);
    if (start != nullptr) {
      std::memcpy(&free_lists_[size_class], start, sizeof(void*));
    } else {
      const std::size_t bytes = size_of_class(size_class);
      if (bytes > static_cast<std::size_t>(end_ - next_)) {
        ++statistics_.exhausted;
        return nullptr;
      }
      start = next_;
      next_ += bytes;
    }
    ++statistics_.allocations;
  }
  auto address = reinterpret_cast<std::uintptr_t>(start) + sizeof(BlockHead);
  if (slack != 0) {
    address = (address + alignment - 1) & ~(alignment - 1);
  }
  new (reinterpret_cast<void*>(address - sizeof(BlockHead))) BlockHead{size_class, kMark, start};
  return reinterpret_cast<void*>(address);
}

void SegmentHeap::free(void* memory) noexcept {
  auto* const head = reinterpret_cast<BlockHead*>(static_cast<char*>(memory) - sizeof(BlockHead));
  FASTCYCLE_ASSERT(head->mark == kMark, "memory of a segment is freed once, where it begins");
  const BlockHead found = *head;
  head->mark = 0;
  const std::lock_guard lock(mutex_);
  std::memcpy(found.start, &free_lists_[found.size_class], sizeof(void*));
  free_lists_[found.size_class] = found.start;
  ++statistics_.frees;
}

SegmentHeap::Statistics SegmentHeap::statistics() const noexcept {
  const std::lock_guard lock(mutex_);
  Statistics result = statistics_;
  result.bytes_used = static_cast<std::size_t>(next_ - begin_);
  return result;
}

}  // namespace fastcycle::segment
