#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/histogram.h"
#include "broker/lane.h"
#include "broker/trail.h"

namespace fastcycle::detail {

/// A latency chain, as far as the data plane must know it.
struct ChainRule {
  std::size_t chain = 0;  ///< Its place in the application file.
  std::size_t root = 0;   ///< Whose trail is judged.
  Duration deadline{0};
  bool drops = false;  ///< What is too old is not delivered.
};

/// The end of latency chains at one subscription: judges each message before it is delivered, and
/// counts what became of it.
///
/// Everything is known here: the trail says when each component on the way began and published. So
/// the statistics of a chain have one writer, and the hop that made a message late is named in the
/// moment of the breach.
///
/// @threads  `judge` by the receiving component's worker; all counters and histograms by anyone.
/// @realtime No lock, no allocation.
class ChainEnd {
 public:
  /// Different publishers on the ways that lead here; what comes by more counts for the last.
  static constexpr std::size_t kMaxHops = 24;

  /// What one component on the way took. @threads  As `ChainEnd`; `usual_*` by the writer only.
  struct HopStatistics {
    std::atomic<PublisherId> publisher{0};  ///< What it published by; 0: the receiver itself.
    std::atomic<std::size_t> place{0};      ///< Where on the way it was seen first.
    base::Histogram waiting;  ///< From the publish before until the activation that published, ns.
    base::Histogram running;  ///< From there until its own publish, ns.
    Counter guilty_waiting;   ///< Breaches in which it exceeded what is usual most, by waiting,
    Counter guilty_running;   ///< and by running.
    double usual_waiting_ns = 0;  ///< Of passes in time, the last ones most.
    double usual_running_ns = 0;
    bool has_usual = false;
  };

  /// One chain that ends here.
  struct Chain {
    ChainRule rule;
    base::Histogram age;  ///< At delivery, ns. Counts all messages that were judged.
    Counter breaches;
    Counter dropped;
    std::atomic<std::size_t> hop_count{0};
    std::array<HopStatistics, kMaxHops> hops{};
  };

  struct Verdict {
    bool is_dropped = false;
    std::uint32_t breached = 0;  ///< A bit for each of `chains()`.
  };

  /// @pre At most 32 rules.
  explicit ChainEnd(std::span<const ChainRule> rules);

  /// Judges a message with these trails, null if it has none, that would be delivered at `now`.
  [[nodiscard]] Verdict judge(const Trail* trails, Time now) noexcept;

  [[nodiscard]] const std::vector<std::unique_ptr<Chain>>& chains() const noexcept {
    return chains_;
  }

  /// Messages that were not delivered.
  Counter stale;

 private:
  static void count_hops(Chain& chain, const Trail& trail, Time now, bool is_breach) noexcept;
  static HopStatistics& hop_of(Chain& chain, PublisherId publisher, std::size_t place) noexcept;

  std::vector<std::unique_ptr<Chain>> chains_;
};

}  // namespace fastcycle::detail
