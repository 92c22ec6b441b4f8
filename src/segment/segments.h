#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/shared_memory.h"
#include "segment/segment_heap.h"

namespace fastcycle::segment {

/// Index of a process of an application; 0 is the supervisor.
using ProcessIndex = unsigned;

/// The memory of all processes of an application: one segment for each process and each of its
/// generations, at the same address everywhere; its owner writes it, and all others read it.
///
/// The supervisor reserves the segments, and forks; each child then calls `become`. From then on
/// the kernel prevents it from writing into the segments of others: these are mapped from files
/// sealed against new writers.
///
/// A segment starts with the control area, whose layout its users define; the rest is a heap. A
/// restarted process gets its next generation, so that messages of the old one stay intact while
/// others hold them.
///
/// @threads  `reserve` and `become` while the process has one thread; the rest is Safe.
class Segments final : public base::SharedAllocator {
 public:
  static constexpr unsigned kGenerations = 4;

  struct Options {
    unsigned processes = 0;           ///< Including the supervisor.
    std::size_t control_bytes = 0;    ///< Size of each segment's control area.
    std::size_t bytes = kUsualBytes;  ///< Size of each segment. Untouched pages use no memory.
  };
  static constexpr std::size_t kUsualBytes = std::size_t{4} << 30;

  Segments() = default;
  ~Segments() override;

  /// Reserves all segments. Returns an error of the kernel.
  [[nodiscard]] std::optional<std::string> reserve(const Options& options);

  /// Call first after the fork: this is process `process` in its `generation` from now on. Its
  /// control area is zero; all other segments become permanently read-only.
  [[nodiscard]] std::optional<std::string> become(ProcessIndex process, unsigned generation);

  [[nodiscard]] char* control(ProcessIndex process, unsigned generation) const noexcept {
    return begin_ + (std::size_t{process} * kGenerations + generation) * options_.bytes;
  }
  /// Whether `[address, address + size)` is in that segment.
  [[nodiscard]] bool is_in(ProcessIndex process, unsigned generation, const void* address,
                           std::size_t size) const noexcept;
  [[nodiscard]] SegmentHeap::Statistics heap_statistics() const { return heap_.statistics(); }
  /// Number of attempts to delete memory of another process here, which have no effect.
  [[nodiscard]] std::uint64_t foreign_deletes() const noexcept { return foreign_deletes_.load(); }

  void* allocate(std::size_t size, std::size_t alignment) noexcept override {
    return heap_.allocate(size, alignment);
  }
  void free(void* memory) noexcept override;

 private:
  Options options_;
  char* begin_ = nullptr;
  std::vector<int> files_;
  SegmentHeap heap_;
  std::atomic<std::uint64_t> foreign_deletes_{0};
};

}  // namespace fastcycle::segment
