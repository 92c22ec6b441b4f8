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

/// A latency chain, as the data plane needs it.
struct ChainRule {
  std::size_t chain = 0;  ///< Its index in the application file.
  std::size_t root = 0;   ///< The root whose trail is judged.
  Duration deadline{0};
  bool drops = false;  ///< Messages that are too old are not delivered.
};

/// The end of latency chains at one subscription: judges each message before it is delivered, and
/// counts the results.
///
/// All information is available here: the trail has when each component on the way began and
/// published. So the statistics of a chain have one writer, and the hop that made a message late is
/// identified at the time of the breach.
///
/// @threads  `judge` by the receiving component's worker; all counters and histograms by any
///           thread.
/// @realtime No lock, no allocation.
class ChainEnd {
 public:
  /// Different publishers on the paths that lead here; further ones count as the last.
  static constexpr std::size_t kMaxHops = 24;

  /// Times of one component on the path. @threads As `ChainEnd`; `usual_*` by the writer only.
  struct HopStatistics {
    std::atomic<PublisherId> publisher{0};  ///< Its publisher; 0: the receiver itself.
    std::atomic<std::size_t> place{0};      ///< Its first observed position on the path.
    base::Histogram waiting;  ///< From the previous publish to the activation that published, ns.
    base::Histogram running;  ///< From there to its own publish, ns.
    Counter breaches_by_waiting;  ///< Breaches in which it had the largest excess over its usual
                                  ///< time, by waiting,
    Counter breaches_by_running;  ///< and by running.
    double usual_waiting_ns = 0;  ///< Moving average over passes in time.
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

  /// Judges a message with these trails (null if it has none) that would be delivered at `now`.
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
