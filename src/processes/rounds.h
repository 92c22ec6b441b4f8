#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "component/peers.h"
#include "executor/round_peers.h"
#include "host/application.h"
#include "processes/notice_order.h"
#include "processes/process_plan.h"
#include "segment/link_set.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// One process's part in rounds of simulated time that all processes of an application serve
/// together. Each publishes, in memory that the others read, the number of synchronization points
/// it has reached, and its state there; from that all derive the same result.
///
/// A process that has ended is awaited if it is restarted, else not. Its last published state
/// counts, so that the remaining ones derive the same result.
///
/// @threads  As `RoundPeers`; `end_sources` is Safe.
class Rounds final : public detail::RoundPeers {
 public:
  /// `links` are all that lead here, `notices` the application-wide notices. All arguments must
  /// outlive this.
  Rounds(const segment::Wire& wire, segment::ProcessIndex process, std::uint32_t incarnation,
         segment::LinkSet& links, NoticeOrder& notices, host::Application& application);

  /// In a restarted process, before it reads from others: waits until these wait for it, with all
  /// they published handed over. Then the application starts at their time, alone; it joins their
  /// rounds from the first one in which time may advance.
  void join();

  [[nodiscard]] detail::RoundState agree(const detail::RoundState& own) override;
  void exchange() override;
  [[nodiscard]] bool is_waiting() const noexcept override { return is_waiting_.load(); }

  /// All sources of this process have finished.
  void end_sources() { are_sources_over_.store(true); }
  [[nodiscard]] host::Peers::AgreedEnd agreed_end() const { return agreed_end_.load(); }

 private:
  using Facts = std::array<std::uint64_t, segment::RoundWords::kFacts>;

  void publish(const Facts& facts);
  /// Waits for `process`; null if it ended before it reached this point and is not restarted.
  const std::atomic<std::uint64_t>* await(segment::ProcessIndex process);
  [[nodiscard]] const std::atomic<std::uint64_t>* facts_of(segment::ProcessIndex process) const;
  void exchange_notices();
  void agree_on_end(bool have_sources, bool are_sources_over, host::EndReason reason);

  const segment::Wire& wire_;
  const segment::ProcessIndex process_;
  const std::uint32_t incarnation_;
  segment::LinkSet& links_;
  NoticeOrder& notices_;
  host::Application& application_;
  segment::RoundWords& own_;
  bool has_sources_ = false;
  std::atomic<bool> are_sources_over_{false};
  std::atomic<bool> is_waiting_{false};
  std::atomic<host::Peers::AgreedEnd> agreed_end_{host::Peers::AgreedEnd::kNone};
  std::uint32_t count_ = 0;
  std::vector<std::uint32_t> known_;  ///< By process: the awaited incarnation.
  bool is_joining_ = false;
  bool joins_at_exchange_ = false;
};

}  // namespace fastcycle::processes
