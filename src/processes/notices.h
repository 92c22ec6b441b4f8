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

/// What the processes of an application say to each other of the whole: each writes records into a
/// ring of its own memory, which all others read.
///
/// @threads  `say` and `put_snapshot` are Safe; all else is confined to the one who reads.
class Notices {
 public:
  /// Of one record, in bytes.
  static constexpr std::size_t kMaxRecord = std::size_t{64} << 10U;

  Notices(const segment::Wire& wire, segment::ProcessIndex process, std::uint32_t incarnation);

  /// Says `record` to all others, and wakes those that sleep on `word_of` this process. False if it
  /// is larger than `kMaxRecord`.
  bool say(std::string_view record);
  /// How many words it has said, in all.
  [[nodiscard]] std::uint64_t said() const noexcept;

  /// Reads `process` in its `incarnation` from `position` on.
  void follow(segment::ProcessIndex process, std::uint32_t incarnation, std::uint64_t position);
  [[nodiscard]] std::uint32_t incarnation_of(segment::ProcessIndex process) const {
    return readers_[process].incarnation;
  }
  /// Up to where `process` was read.
  [[nodiscard]] std::uint64_t position_of(segment::ProcessIndex process) const {
    return readers_[process].position;
  }
  /// The next record of `process`, if there is one before `end`.
  [[nodiscard]] std::optional<std::string> next(segment::ProcessIndex process,
                                                std::uint64_t end = ~std::uint64_t{0});
  /// Whether, since this was asked last, records were overwritten before they were read, or were
  /// none.
  [[nodiscard]] bool take_loss() noexcept { return std::exchange(has_lost_, false); }
  /// The word that `process` counts up with each record, as it is now.
  [[nodiscard]] base::WatchedWord word_of(segment::ProcessIndex process) const noexcept;

  /// Replaces what a process that is restarted reads first. False if it is too large.
  bool put_snapshot(std::string_view text);
  /// That of `process`, in its present incarnation; none if it has put none.
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
