#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace fastcycle::record {

/// A file that is mapped into memory and written there, of which the process survives whatever
/// others do to the file.
///
/// Where another program cuts it off, or its disk has no room for a page, the kernel answers a
/// store with SIGBUS. The signal's handler then puts memory of this process in the place of the
/// whole file: the store goes on, what the file had is gone, and `is_cut` says so. A SIGBUS that
/// has another cause goes to the handler that was there before, or ends the process.
///
/// A child that a component forks keeps nothing of it: neither the descriptor, and with it a lock
/// on the file, nor the mapping, which becomes memory of the child.
///
/// Global state: a table of all such files of the process, as large as `kFilesMax`, since a signal
/// handler can know nothing else.
///
/// @threads  Confined; `is_cut` is Safe.
class GuardedFile {
 public:
  static constexpr std::size_t kFilesMax = 64;  ///< At the same time, in one process.

  /// Maps `size` bytes of an open file, and takes it over, also if that fails.
  ///
  /// @errors  `std::system_error`
  GuardedFile(int descriptor, std::uint64_t size);
  GuardedFile(const GuardedFile&) = delete;
  GuardedFile& operator=(const GuardedFile&) = delete;
  ~GuardedFile();

  [[nodiscard]] std::byte* memory() const noexcept { return memory_; }
  [[nodiscard]] int descriptor() const noexcept;
  /// Whether `memory` is no longer that of the file.
  [[nodiscard]] bool is_cut() const noexcept;

 private:
  struct Slot;

  friend struct SlotTable;

  const std::uint64_t size_;
  Slot* slot_ = nullptr;
  std::byte* memory_ = nullptr;
};

}  // namespace fastcycle::record
