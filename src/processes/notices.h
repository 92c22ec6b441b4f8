#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/priority_mutex.h"
#include "base/sleepers.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// Broadcasts application-wide notices between processes: each writes records into a ring in its
/// own memory, which all others read.
///
/// @threads  `send` and `put_snapshot` are Safe; all else is confined to the reading thread.
class Notices {
 public:
  /// Maximum size of a record, in bytes.
  static constexpr std::size_t kMaxRecord = std::size_t{64} << 10U;

  Notices(const segment::Wire& wire, segment::ProcessIndex process, std::uint32_t incarnation);

  /// Sends `record` to all others, and wakes threads that sleep on `word_of` this process. False if
  /// it is larger than `kMaxRecord`.
  bool send(std::string_view record);
  /// Number of words sent in all.
  [[nodiscard]] std::uint64_t sent() const noexcept;

  /// Reads `process` in its `incarnation` from `position` on.
  void follow(segment::ProcessIndex process, std::uint32_t incarnation, std::uint64_t position);
  [[nodiscard]] std::uint32_t incarnation_of(segment::ProcessIndex process) const {
    return readers_[process].incarnation;
  }
  /// The position up to which `process` was read.
  [[nodiscard]] std::uint64_t position_of(segment::ProcessIndex process) const {
    return readers_[process].position;
  }
  /// The next record of `process`, if there is one before `end`.
  [[nodiscard]] std::optional<std::string> next(segment::ProcessIndex process,
                                                std::uint64_t end = ~std::uint64_t{0});
  /// Whether, since the last call, records were overwritten before they were read, or were invalid.
  [[nodiscard]] bool take_loss() noexcept { return std::exchange(has_lost_, false); }
  /// The word that `process` increments with each record, and its current value.
  [[nodiscard]] base::WatchedWord word_of(segment::ProcessIndex process) const noexcept;

  /// Replaces the snapshot that a restarted process reads first. False if it is too large.
  bool put_snapshot(std::string_view text);
  /// The snapshot of `process`, in its present incarnation; none if it has put none.
  [[nodiscard]] std::optional<std::string> snapshot_of(segment::ProcessIndex process) const;

 private:
  struct Reader {
    std::uint32_t incarnation = 0;
    std::uint64_t position = 0;
  };

  const segment::Wire& wire_;
  segment::NoticeWords& own_;
  segment::SnapshotWords& own_snapshot_;
  base::PriorityMutex mutex_;
  std::vector<Reader> readers_;  ///< By process.
  bool has_lost_ = false;
};

}  // namespace fastcycle::processes
