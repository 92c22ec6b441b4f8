#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace fastcycle::record {

/// A memory-mapped file for writing, which the process survives whatever others do to the file.
///
/// If another program truncates it, or its disk has no room for a page, a store raises SIGBUS. The
/// signal's handler then replaces the whole mapping with anonymous memory: the store succeeds, the
/// file's contents are lost, and `is_cut` returns true. A SIGBUS with another cause goes to the
/// previous handler, or ends the process.
///
/// A forked child inherits neither the descriptor, and with it a lock on the file, nor the mapping,
/// which becomes memory of the child.
///
/// Global state: a table of all such files of the process, with `kFilesMax` entries, since a signal
/// handler can access nothing else.
///
/// @threads  Confined; `is_cut` is Safe.
class GuardedFile {
 public:
  static constexpr std::size_t kFilesMax = 64;  ///< At the same time, in one process.

  /// Maps `size` bytes of an open file, and takes it over, also on failure.
  ///
  /// @errors  `std::system_error`
  GuardedFile(int descriptor, std::uint64_t size);
  GuardedFile(const GuardedFile&) = delete;
  GuardedFile& operator=(const GuardedFile&) = delete;
  ~GuardedFile();

  [[nodiscard]] std::byte* memory() const noexcept { return memory_; }
  [[nodiscard]] int descriptor() const noexcept;
  /// Whether the mapping no longer refers to the file.
  [[nodiscard]] bool is_cut() const noexcept;

 private:
  struct Slot;

  friend struct SlotTable;

  const std::uint64_t size_;
  Slot* slot_ = nullptr;
  std::byte* memory_ = nullptr;
};

}  // namespace fastcycle::record
