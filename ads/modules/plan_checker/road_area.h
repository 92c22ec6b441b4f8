#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "hd_map/map.pb.h"

namespace plan_checker {

/// The area that all lanes cover together, and their speed limits.
///
/// Includes lanes of all types and directions except pedestrian crossings and those without motor
/// vehicles (`OTHER`). A lane without a successor or predecessor in the map is extended straight
/// there, because the end of the map is not the end of the road.
///
/// @threads  Compatible.
/// @realtime A query grows with the number of lanes.
class RoadArea {
 public:
  struct SpeedLimit {
    std::int64_t lane = 0;
    double mps = 0.0;
  };

  RoadArea() = default;
  /// Lines with fewer than two points, or a non-finite number, are ignored.
  explicit RoadArea(const hd_map::Tile& tile);

  [[nodiscard]] bool is_empty() const { return lanes_.empty(); }
  /// Whether the map's tile covers the place; far from its middle it does not.
  [[nodiscard]] bool covers(const Eigen::Vector2d& place_m) const;
  /// The distance of a place from all lanes, in m; 0 on one.
  [[nodiscard]] double beyond_m(const Eigen::Vector2d& place_m) const;
  /// The highest limit of the lanes at a place with about the direction of `heading_rad`. None off
  /// the road, and where one of these lanes has none.
  [[nodiscard]] std::optional<SpeedLimit> speed_limit(const Eigen::Vector2d& place_m,
                                                      double heading_rad) const;

 private:
  struct Lane {
    std::int64_t id = 0;
    double speed_limit_mps = 0.0;
    std::vector<Eigen::Vector2d> edge_m;    // A polygon.
    std::vector<Eigen::Vector2d> centre_m;  // Without the extensions at the map's ends.
    Eigen::Vector2d low_m;                  // Of its bounding box.
    Eigen::Vector2d high_m;

    [[nodiscard]] bool is_near(const Eigen::Vector2d& place_m, double within_m) const;
    [[nodiscard]] double heading_at(const Eigen::Vector2d& place_m) const;
  };

  void add(const hd_map::Lane& message);

  std::vector<Lane> lanes_;
  Eigen::Vector2d middle_m_ = Eigen::Vector2d::Zero();
  double radius_m_ = 0.0;
};

}  // namespace plan_checker
