#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/priority_mutex.h"

namespace fastcycle::segment {

/// A heap in a borrowed range of memory: free lists by size, four sizes per power of two. Freed
/// memory is reused, and never returned to the kernel.
///
/// @threads  Safe.
/// @realtime A lock that inherits priorities, no system call; a first touch is a page fault.
class SegmentHeap {
 public:
  struct Statistics {
    std::uint64_t allocations = 0;
    std::uint64_t frees = 0;
    std::uint64_t exhausted = 0;  ///< Requests that failed for lack of memory.
    std::size_t bytes_used = 0;   ///< Size of the used part of the range, including freed blocks.
  };

  SegmentHeap() = default;
  SegmentHeap(const SegmentHeap&) = delete;
  SegmentHeap& operator=(const SegmentHeap&) = delete;

  /// Manages `[begin, begin + size)` from now on. Before any other call.
  void begin(char* begin, std::size_t size) noexcept;

  /// Memory of `size` bytes at a multiple of `alignment`; null if it is exhausted.
  /// @pre  `alignment` is a power of two.
  [[nodiscard]] void* allocate(std::size_t size, std::size_t alignment) noexcept;
  /// @pre  `memory` is of this heap. Anything else ends the process.
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
