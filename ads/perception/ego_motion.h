#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace ads {

/// Where the vehicle was at one time, and how it moved.
struct EgoPose {
  std::int64_t time_ns = 0;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  double speed_mps = 0.0;
  double yaw_rate_radps = 0.0;
};

/// The vehicle's poses over the last moments.
///
/// @threads  Confined.
class EgoMotion {
 public:
  /// Beyond its first and last pose the motion goes on evenly for so long.
  static constexpr std::int64_t kReach_ns = 150'000'000;

  void clear() { poses_.clear(); }
  /// A pose that is not later than the last one is passed over.
  void add(const EgoPose& pose);

  /// The pose at that time; none if the time is out of reach.
  [[nodiscard]] std::optional<EgoPose> at(std::int64_t time_ns) const;

 private:
  std::vector<EgoPose> poses_;
};

}  // namespace ads
