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

/// A process of an application, by its place: 0 is the one that makes the others.
using ProcessIndex = unsigned;

/// The memory of all processes of an application: for each process, and each of its generations,
/// one segment at the same address everywhere, which its owner writes and all others read.
///
/// The process that makes the others reserves the segments, and forks; each of these then calls
/// `become`. From there on the kernel refuses it to write into the segments of others, whatever it
/// does: they are mapped from files that are sealed against new writers.
///
/// The first part of a segment, the control area, is laid out by who uses it; behind it is a heap.
/// A process that is made anew gets its next generation, so that messages of the old one stay whole
/// for who still holds them.
///
/// @threads  `reserve` and `become` while the process has one thread; the rest is Safe.
class Segments final : public base::SharedAllocator {
 public:
  static constexpr unsigned kGenerations = 4;

  struct Options {
    unsigned processes = 0;           ///< With the one that makes them.
    std::size_t control_bytes = 0;    ///< Of each segment, for its control area.
    std::size_t bytes = kUsualBytes;  ///< Of each segment. What is not touched takes no memory.
  };
  static constexpr std::size_t kUsualBytes = std::size_t{4} << 30;

  Segments() = default;
  ~Segments() override;

  /// Reserves all segments. Returns what the kernel refused; none if it did not.
  [[nodiscard]] std::optional<std::string> reserve(const Options& options);

  /// First thing after the fork: this is process `process` in its `generation` from now on. Its
  /// control area is zero; all other segments are read-only, for good.
  [[nodiscard]] std::optional<std::string> become(ProcessIndex process, unsigned generation);

  [[nodiscard]] char* control(ProcessIndex process, unsigned generation) const noexcept {
    return begin_ + (std::size_t{process} * kGenerations + generation) * options_.bytes;
  }
  /// Whether `[address, address + size)` lies in that segment.
  [[nodiscard]] bool is_in(ProcessIndex process, unsigned generation, const void* address,
                           std::size_t size) const noexcept;
  [[nodiscard]] SegmentHeap::Statistics heap_statistics() const { return heap_.statistics(); }
  /// How often memory of another process was deleted here: it stays as it is.
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
