#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "road.h"
#include "vehicle.h"

namespace motion_planning {

/// Why the vehicle may not drive faster, or farther.
enum class RuleKind : std::uint8_t {
  kSpeedLimit,  ///< Of the map.
  kHazard,      ///< A place to be careful at.
  kStopLine,    ///< A sign asks for a stop at this line.
  kGiveWay,     ///< Someone else goes first.
  kRedLight,
};

/// A stretch of the road to be slow on.
struct SlowStretch {
  double begin_m = 0.0;
  double end_m = 0.0;
  double speed_mps = 0.0;
};

/// A place that the vehicle's centre is not to pass.
struct Halt {
  double along_m = 0.0;
  double line_m = 0.0;  ///< Where the line is that it is for.
  /// How hard the vehicle brakes for it, at most.
  double braking_mps2 = 2.0;
  RuleKind kind = RuleKind::kStopLine;
  std::uint64_t object = 0;  ///< Who goes first.
};

/// A rule, and where along the road it begins to hold.
struct Rule {
  RuleKind kind = RuleKind::kSpeedLimit;
  double along_m = 0.0;
  double speed_mps = 0.0;    ///< The highest one there; 0: to stop.
  std::uint64_t object = 0;  ///< Who goes first.

  friend bool operator==(const Rule&, const Rule&) = default;
};

/// The highest speed that is allowed at each place along a road: the least of all limits there and
/// ahead, each with the way that comfortable braking needs. Limits hold for the vehicle's centre.
///
/// Who is faster when he begins may be so for as long as comfortable braking takes.
///
/// @threads  Compatible.
class SpeedProfile {
 public:
  /// To a lower limit, as most drivers brake: harder is felt as such (ISO 15622 lets cruise control
  /// brake with 3.5 m/s^2 at most).
  static constexpr double kBraking_mps2 = 2.0;
  /// How fast such braking builds up.
  static constexpr double kJerk_mps3 = 3.0;
  /// A drive keeps a limit if it is above it by no more: control does not follow a plan exactly.
  /// A rule that the plan comes so near to binds it.
  static constexpr double kTolerance_mps = 0.3;

  struct Bound {
    double speed_mps = 0.0;  ///< Infinite where there is none.
    double by_along = 0.0;   ///< How it changes along the road, 1/s.
  };

  /// `start` is the state in which the vehicle begins.
  SpeedProfile(const Road& road, const std::vector<SlowStretch>& slow_stretches,
               const std::optional<Halt>& halt, const State& start);

  /// The highest speed there, `time_s` after the start.
  [[nodiscard]] Bound at(double along_m, double time_s) const;
  /// What is driven at if nothing else is to be done: the rules' own speed, whatever the start's.
  [[nodiscard]] double wanted_mps(double along_m) const;
  /// The rule to which someone with this speed comes within the tolerance.
  [[nodiscard]] std::optional<Rule> binding(double along_m, double speed_mps) const;

 private:
  struct Point {
    double square = 0.0;   // Of the highest speed.
    std::size_t rule = 0;  // That it follows from, in `rules_`.
  };

  [[nodiscard]] Bound limit_at(double along_m) const;
  [[nodiscard]] Bound halt_at(double along_m) const;
  [[nodiscard]] double begun_mps(double time_s) const;

  std::vector<Point> points_;  // At each `Road::kStep_m`; empty without a limit.
  std::vector<Rule> rules_;
  std::optional<Halt> halt_;
  State start_;
  bool begins_above_ = false;  // The limits.
};

}  // namespace motion_planning
