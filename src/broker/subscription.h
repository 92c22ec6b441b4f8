#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/histogram.h"
#include "base/priority_mutex.h"
#include "broker/lane.h"

namespace fastcycle::detail {

class ChainEnd;
class Quality;
class Topic;

/// The loss ledger of one subscription:
/// published = delivered + sum of dropped + queued.
struct Ledger {
  std::uint64_t published = 0;  ///< Since the subscription was created.
  std::uint64_t delivered = 0;  ///< Counted when the callback is entered.
  std::array<std::uint64_t, static_cast<std::size_t>(DropReason::kCount)> dropped{};
  std::uint64_t queued = 0;

  [[nodiscard]] std::uint64_t dropped_total() const noexcept;
  [[nodiscard]] bool adds_up() const noexcept {
    return published == delivered + dropped_total() + queued;
  }
};

/// The word for `reason` in tables and reports.
[[nodiscard]] const char* to_word(DropReason reason) noexcept;

/// One component's interest in one topic: its lanes (one per publisher) and their ledger.
///
/// The executor derives its callback subscriptions from this.
///
/// @threads  The vector of lanes belongs to the control thread before the start, later to the
///           receiving component; `ledger` is Safe.
class Subscription {
 public:
  enum class Kind : std::uint8_t {
    kCallback,
    kLatest,
    kHistory,
    kSynchronized,  ///< Passed to a callback together with messages of other topics.
    kTap,           ///< Polled by its owner: causes no wake-up.
  };

  static constexpr std::size_t kDefaultDepth = 16;

  Subscription(Topic& topic, Inbox& inbox, std::string component, Kind kind,
               const SubscriberOptions& options);
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;
  virtual ~Subscription();

  /// Creates the lane for one more publisher, of the component `from`. `is_imported`: it publishes
  /// in another process.
  std::shared_ptr<Lane> add_lane(PublisherId publisher, std::string_view from, bool is_external,
                                 bool ages, bool is_imported = false,
                                 std::shared_ptr<LaneCredit> credit = nullptr);

  /// Sets how many of a topic's latched messages it requests.
  void set_history(const SubscriberOptions& options) noexcept;

  /// The present lanes.
  [[nodiscard]] std::vector<std::shared_ptr<Lane>> lanes() const;

  /// Closes all lanes: waiting and later messages are counted as dropped for `reason`. A second
  /// call does nothing.
  void close(DropReason reason) noexcept;

  /// The credits of its lanes whose publishers use them.
  [[nodiscard]] std::vector<std::shared_ptr<LaneCredit>> credits() const;

  /// The sum over all lanes, past ones included; exact when nothing moves.
  [[nodiscard]] Ledger ledger() const;

  // Constant after construction.
  Topic& topic;
  Inbox& inbox;
  const std::string component;
  const Kind kind;
  /// Identifies the samples that its component keeps; `kNobody` for taps.
  const Holder holder;
  const std::size_t depth;
  const Overflow overflow;
  /// Number of latched messages for new lanes. As the vector of lanes.
  std::uint16_t history = Lane::kWholeHistory;
  const std::size_t keep;
  /// Its further quality of service; null, as for most, if none. Constant after construction.
  const std::unique_ptr<Quality> quality;
  /// The latency chains that end here; null, as for most, if none. Constant after construction.
  const std::unique_ptr<ChainEnd> chain_end;

  /// Whether its messages cause activations.
  [[nodiscard]] bool is_called() const noexcept {
    return kind == Kind::kCallback || kind == Kind::kSynchronized;
  }

  /// Messages received while the component was not active. Written by its worker.
  Counter inactive;

  /// Messages that a standby took and did not serve: the followed process dropped them, or ended in
  /// them. Written by its worker.
  Counter left_out;

  /// Messages of another application that never arrived here. Written by external publishers.
  std::atomic<std::uint64_t> lost_on_link{0};
  /// Messages lost by injected faults. Written by gates.
  std::atomic<std::uint64_t> lost_by_injection{0};

  /// From publish to callback, in nanoseconds. Written by the receiving component's worker.
  base::CoarseHistogram latency;

 protected:
  /// For a receiver that holds messages before it decides about them: how many of those taken from
  /// the lanes were delivered or dropped since; the rest still waits. False if it delivers directly
  /// from the lanes.
  virtual bool add_decided(Ledger&) const noexcept { return false; }

 private:
  void add_to(Ledger& ledger, const Lane& lane) const noexcept;
  [[nodiscard]] bool is_judged_by_quality() const noexcept;

  // Control plane: locked to add and remove lanes, and by readers of the ledger.
  mutable base::PriorityMutex mutex_;
  std::vector<std::shared_ptr<Lane>> lanes_;
  Ledger retired_;
};

}  // namespace fastcycle::detail
