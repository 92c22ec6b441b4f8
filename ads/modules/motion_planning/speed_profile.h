#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "motion_planning_tuning.h"
#include "road.h"
#include "vehicle.h"

namespace motion_planning {

/// Why the vehicle may not drive faster, or farther.
enum class RuleKind : std::uint8_t {
  kSpeedLimit,  ///< Of the map.
  kHazard,      ///< A hazard.
  kStopLine,    ///< A sign requires a stop at this line.
  kGiveWay,     ///< Another road user has right of way.
  kRedLight,
};

/// A stretch of the road with a reduced speed.
struct SlowStretch {
  double begin_m = 0.0;
  double end_m = 0.0;
  double speed_mps = 0.0;
};

/// A point that the vehicle's centre must not pass.
struct Halt {
  double along_m = 0.0;
  double line_m = 0.0;  ///< The position of the line before which it stops.
  /// The maximum braking for it.
  double braking_mps2 = 2.0;
  RuleKind kind = RuleKind::kStopLine;
  std::uint64_t object = 0;  ///< The object that has right of way.
  bool is_here = false;      ///< Where the vehicle is, without a line.
};

/// A rule, and where along the road it begins to apply.
struct Rule {
  RuleKind kind = RuleKind::kSpeedLimit;
  double along_m = 0.0;
  double speed_mps = 0.0;    ///< The maximum speed there; 0: stop.
  std::uint64_t object = 0;  ///< The object that has right of way.

  friend bool operator==(const Rule&, const Rule&) = default;
};

/// The highest permitted speed at each point along a road: the minimum of all limits there and
/// ahead, each with the distance for comfortable braking. Limits apply to the vehicle's centre.
///
/// A vehicle that is faster at the start may exceed them for as long as comfortable braking takes.
///
/// @threads  Compatible.
class SpeedProfile {
 public:
  /// To a lower limit, as most drivers brake: harder braking is uncomfortable (ISO 15622 limits
  /// cruise control to 3.5 m/s^2).
  static constexpr double kBraking_mps2 = kSpeedProfile.braking_mps2;
  /// The jerk at which such braking builds up.
  static constexpr double kJerk_mps3 = kSpeedProfile.jerk_mps3;
  /// A limit counts as kept if it is exceeded by no more: control does not follow a plan exactly. A
  /// rule applies to the plan within this tolerance.
  static constexpr double kTolerance_mps = kSpeedProfile.tolerance_mps;

  struct Bound {
    double speed_mps = 0.0;  ///< Infinite if there is none.
    double by_along = 0.0;   ///< Its derivative along the road, 1/s.
  };

  /// `start` is the vehicle's initial state.
  SpeedProfile(const Road& road, const std::vector<SlowStretch>& slow_stretches,
               const std::optional<Halt>& halt, const State& start);

  /// The highest speed there, `time_s` after the start.
  [[nodiscard]] Bound at(double along_m, double time_s) const;
  /// The speed of the rules alone, regardless of the start's speed.
  [[nodiscard]] double wanted_mps(double along_m) const;
  /// The rule that applies at this speed, within the tolerance.
  [[nodiscard]] std::optional<Rule> binding(double along_m, double speed_mps) const;

 private:
  struct Point {
    double square = 0.0;   // Square of the highest speed.
    std::size_t rule = 0;  // The rule that it results from, in `rules_`.
  };

  [[nodiscard]] Bound limit_at(double along_m) const;
  [[nodiscard]] Bound halt_at(double along_m) const;
  [[nodiscard]] double begun_mps(double time_s) const;

  std::vector<Point> points_;  // At each `Road::kStep_m`; empty without a limit.
  std::vector<Rule> rules_;
  std::optional<Halt> halt_;
  State start_;
  bool begins_above_ = false;  // Above the limits.
};

}  // namespace motion_planning
