#pragma once

#include <optional>

#include <Eigen/Core>

#include "common/commonroad.h"
#include "common/plane.h"

namespace ads {

/// The way on which a vehicle came to the initial state of a scenario, which says nothing of it:
/// back along its lane, at the offset from the lane's centre that it has, and the way that its rear
/// axle points at the end. Where it is on no lane in about its direction, and beyond the map, the
/// way is straight.
///
/// @threads  Immutable.
class LeadIn {
 public:
  struct Pose {
    Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
    double heading_rad = 0.0;
    double curvature_per_m = 0.0;  ///< Of the rear axle's way.
  };

  /// `to_rear_m` lies between the vehicle's centre and its rear axle; the way is known for
  /// `length_m`, and straight before.
  LeadIn(const Scenario& scenario, const ScenarioState& initial, double to_rear_m, double length_m);

  /// Where the vehicle was `before_m` ago; exactly the initial state, with straight wheels, at 0.
  [[nodiscard]] Pose at(double before_m) const;

 private:
  Pose initial_;
  double to_rear_m_;
  std::optional<Polyline> way_;  // Of the rear axle, to the initial state.
};

}  // namespace ads
