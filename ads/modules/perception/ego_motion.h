#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "perception_tuning.h"

namespace ads {

/// The vehicle's pose and motion at one time.
struct EgoPose {
  std::int64_t time_ns = 0;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  double speed_mps = 0.0;
  double yaw_rate_radps = 0.0;
};

/// The vehicle's recent poses.
///
/// @threads  Confined.
class EgoMotion {
 public:
  /// The motion is extrapolated beyond its first and last pose for this long.
  static constexpr std::int64_t kReach_ns = kEgoMotion.reach_ns;

  void clear() { poses_.clear(); }
  /// Adds a pose; one that is not later than the last one is ignored.
  void add(const EgoPose& pose);

  /// The pose at that time; none if the time is out of reach.
  [[nodiscard]] std::optional<EgoPose> at(std::int64_t time_ns) const;

 private:
  std::vector<EgoPose> poses_;
};

}  // namespace ads
