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

/// Delivers application-wide notices of all processes to all processes, in one order.
///
/// Live, the main process defines the order: it repeats all notices in its own ring, and all take
/// them from there. In simulated time each process takes the notices of a round at its end, in the
/// order of the components they concern.
///
/// @threads  `send_notice` is Safe. Live, a thread of its own takes notices; in simulated time, the
/// thread
///           that runs the simulation.
class NoticeOrder {
 public:
  /// `peers` provides the callbacks; all arguments must outlive this.
  NoticeOrder(const segment::Wire& wire, segment::ProcessIndex process, std::uint32_t incarnation,
              bool is_simulated, host::Peers& peers);
  NoticeOrder(const NoticeOrder&) = delete;
  NoticeOrder& operator=(const NoticeOrder&) = delete;
  ~NoticeOrder();

  /// @errors  As `Peers::send_notice`.
  void send_notice(host::Notice::Kind kind, std::uint32_t component, const std::string& text);
  [[nodiscard]] const std::set<std::uint32_t>& recipients() const { return recipients_; }
  /// Live: wakes the thread. Safe.
  void wake();

  /// Call once all processes can be read, before the start: catches up on earlier notices, and
  /// takes new ones from now on.
  void begin();
  /// Stops taking notices.
  void stop();

  // In simulated time, at a point where all processes wait for each other.

  /// A process's notices up to this point, and its incarnation.
  struct Sent {
    std::uint64_t words = 0;
    std::uint32_t incarnation = 0;  ///< 0: the process is absent.
  };
  /// Publishes this process's pending notices; others may read them from the point on.
  [[nodiscard]] Sent send();
  /// Takes the notices of all, by process. False if there were none.
  bool take(const std::vector<Sent>& sent);

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
  std::set<std::uint32_t> recipients_;
  std::set<std::uint32_t> coming_;  ///< Of the main process, live: ended last, restart expected.

  base::PriorityMutex mutex_;
  std::vector<host::Notice> own_;  ///< Of the main process, or in simulated time: not sent yet.

  base::Sleepers sleepers_;
  std::jthread thread_;
};

}  // namespace fastcycle::processes
