#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include "fastcycle/time.h"

namespace fastcycle::dds_gateway {

/// One request to another clock and its answer, with the times of both clocks.
struct RoundTrip {
  Time asked{};     ///< By the requesting clock.
  Time came{};      ///< By the other one, as `answered`.
  Time answered{};  ///< When the answer was sent.
  Time back{};      ///< By the requesting clock.
};

/// The offset of another clock from ours, estimated from round trips as in NTP: an answer that took
/// `d` both ways together gives the offset to within `d / 2`, whatever the share of each way. The
/// round trip with the smallest bound is used; its bound grows with its age, since the clocks
/// drift.
///
/// @threads  Confined.
class ClockDifference {
 public:
  static constexpr std::size_t kKept = 64;  ///< Round trips considered.
  /// Maximum assumed relative drift of two clocks; computer clocks stay below it.
  static constexpr double kDriftMax = 100e-6;

  struct Estimate {
    Duration ahead{};       ///< The other clock less ours.
    Duration bound{};       ///< Maximum error.
    Duration round_trip{};  ///< Duration of both ways together.
  };

  /// Adds a round trip that ended now. Ignores one that is impossible; after one that contradicts
  /// all before, because a clock was set, only the newest counts.
  void add(const RoundTrip& trip);

  /// The estimate when our clock shows `now`; none before the first answer.
  [[nodiscard]] std::optional<Estimate> at(Time now) const;

 private:
  struct Sample {
    Duration ahead{};
    Duration round_trip{};
    Time back{};
  };

  static Duration bound_of(const Sample& sample, Time now);

  std::deque<Sample> samples_;  // The oldest first.
};

}  // namespace fastcycle::dds_gateway
