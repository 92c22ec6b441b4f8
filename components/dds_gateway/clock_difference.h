#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include "fastcycle/time.h"

namespace fastcycle::dds_gateway {

/// One question to another clock and its answer, as each of the two clocks saw it.
struct RoundTrip {
  Time asked{};     ///< By the clock that asks.
  Time came{};      ///< By the other one, as the next.
  Time answered{};  ///< When the answer was sent.
  Time back{};      ///< By the clock that asks.
};

/// How far another clock is ahead of ours, found by round trips as NTP finds it: an answer that
/// took `d` on both ways together tells the difference to within `d / 2`, whatever part of `d` each
/// way had. The round trip whose bound is the smallest counts; its bound grows with its age, since
/// the clocks drift.
///
/// @threads  Confined.
class ClockDifference {
 public:
  static constexpr std::size_t kKept = 64;  ///< Round trips that are looked at.
  /// The most by which two clocks are taken to drift apart; those of computers stay below it.
  static constexpr double kDriftMax = 100e-6;

  struct Estimate {
    Duration ahead{};       ///< The other clock less ours.
    Duration bound{};       ///< It is off by this at most.
    Duration round_trip{};  ///< What the messages took, both ways together.
  };

  /// Takes a round trip that ended now. One that no two clocks can have seen is left out; after one
  /// that contradicts all before, for a clock was set, only the newest count.
  void add(const RoundTrip& trip);

  /// What is known when our clock shows `now`; none as long as nothing came back.
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
