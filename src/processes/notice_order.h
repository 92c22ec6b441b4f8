#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "base/priority_mutex.h"
#include "base/sleepers.h"
#include "component/peers.h"
#include "processes/notices.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// Brings what the processes of an application say of the whole to all of them, in one order.
///
/// Live, the main process makes the order: it says in its own ring what others say in theirs, and
/// all take it from there. In simulated time each takes what was said in a round when the round is
/// over, in the order of the components for which it was said.
///
/// @threads  `tell` is Safe. Live, notices are taken by a thread of its own; in simulated time by
///           the one that runs the simulation.
class NoticeOrder {
 public:
  /// `peers` has what is called; all have to live as long as this.
  NoticeOrder(const segment::Wire& wire, segment::ProcessIndex process, std::uint32_t incarnation,
              bool is_simulated, host::Peers& peers);
  NoticeOrder(const NoticeOrder&) = delete;
  NoticeOrder& operator=(const NoticeOrder&) = delete;
  ~NoticeOrder();

  /// @errors  As `Peers::tell`.
  void tell(host::Notice::Kind kind, std::uint32_t component, const std::string& text);
  [[nodiscard]] const std::set<std::uint32_t>& told() const { return told_; }
  /// Live: has the thread look soon. Safe.
  void wake();

  /// Once all processes can be read, before the start: takes over what was told before, and takes
  /// what is told from now on.
  void begin();
  /// Takes nothing any more.
  void stop();

  // In simulated time, at a point where all processes wait for each other.

  /// What a process said up to this point, and in which incarnation.
  struct Said {
    std::uint64_t words = 0;
    std::uint32_t incarnation = 0;  ///< 0: the process is not there.
  };
  /// Says what this process has to say; others may read it from the point on.
  [[nodiscard]] Said say();
  /// Takes what all have said, by process. False if nobody had said anything.
  bool take(const std::vector<Said>& said);

 private:
  void serve(const std::stop_token& stop);
  bool look();
  bool look_as_main();
  bool look_for_changes();
  [[nodiscard]] std::vector<base::WatchedWord> watched_words() const;
  [[nodiscard]] host::Notice gone(segment::ProcessIndex process, bool is_back) const;
  [[nodiscard]] bool is_lost(segment::ProcessIndex process) const;
  void put_in_order(const host::Notice& notice);
  void take(const host::Notice& notice);
  void put_snapshot();
  void take_snapshot();

  const segment::Wire& wire_;
  const segment::ProcessIndex process_;
  const std::uint32_t incarnation_;
  const bool is_simulated_;
  host::Peers& peers_;
  Notices notices_;
  std::set<std::uint32_t> told_;
  std::set<std::uint32_t> coming_;  ///< Of the main process, live: those that ended last.

  base::PriorityMutex mutex_;
  std::vector<host::Notice> own_;  ///< Of the main process, or in simulated time: not said yet.

  base::Sleepers sleepers_;
  std::jthread thread_;
};

}  // namespace fastcycle::processes
