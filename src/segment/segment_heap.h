#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/priority_mutex.h"

namespace fastcycle::segment {

/// A heap in a range of memory that somebody else owns: free lists by size, four sizes for each
/// doubling. What was freed is used again; nothing is ever given back to the kernel.
///
/// @threads  Safe.
/// @realtime A lock that inherits priorities, no system call; a first touch is a page fault.
class SegmentHeap {
 public:
  struct Statistics {
    std::uint64_t allocations = 0;
    std::uint64_t frees = 0;
    std::uint64_t exhausted = 0;  ///< Requests for which there was no room.
    std::size_t bytes_used = 0;  ///< Of the range, from its begin on, in blocks that are ever made.
  };

  SegmentHeap() = default;
  SegmentHeap(const SegmentHeap&) = delete;
  SegmentHeap& operator=(const SegmentHeap&) = delete;

  /// From now on it serves `[begin, begin + size)`. Before any other call.
  void begin(char* begin, std::size_t size) noexcept;

  /// Memory of `size` bytes at a multiple of `alignment`; null if there is no room.
  /// @pre  `alignment` is a power of two.
  [[nodiscard]] void* allocate(std::size_t size, std::size_t alignment) noexcept;
  /// @pre  `memory` is of this heap. What is no block of it ends the process.
  void free(void* memory) noexcept;

  [[nodiscard]] Statistics statistics() const noexcept;

 private:
  static constexpr std::size_t kClasses = 256;

  mutable base::PriorityMutex mutex_;
  char* begin_ = nullptr;
  char* next_ = nullptr;
  char* end_ = nullptr;
  std::array<void*, kClasses> free_lists_{};
  Statistics statistics_;
};

}  // namespace fastcycle::segment
