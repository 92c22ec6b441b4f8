#pragma once

#include <optional>

#include <Eigen/Core>

#include "common/commonroad.h"
#include "common/plane.h"

namespace ads {

/// The path on which a vehicle reached the initial state of a scenario, which does not contain it:
/// back along its lane, at its offset from the lane's centre, as the path of the rear axle. If it
/// is on no lane with about its direction, and beyond the map, the path is straight; so is the last
/// fifth of one that would end in a tight bend.
///
/// @threads  Immutable.
class LeadIn {
 public:
  struct Pose {
    Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
    double heading_rad = 0.0;
    double curvature_per_m = 0.0;  ///< Of the rear axle's path.
  };

  /// `to_rear_m` is the distance from the vehicle's centre to its rear axle; the path is computed
  /// for `length_m`, and straight before.
  LeadIn(const Scenario& scenario, const ScenarioState& initial, double to_rear_m, double length_m);

  /// The pose `before_m` before the initial state; exactly that state, with straight wheels, at 0.
  [[nodiscard]] Pose at(double before_m) const;

 private:
  /// Its last `straight_m` are straight.
  [[nodiscard]] Polyline way_along(const Polyline& centre, double length_m,
                                   double straight_m) const;

  Pose initial_;
  double to_rear_m_;
  std::optional<Polyline> way_;  // Of the rear axle, to the initial state.
};

}  // namespace ads
