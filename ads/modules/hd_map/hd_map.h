#pragma once

#include <optional>

#include <Eigen/Core>
#include <fastcycle/fastcycle.h>

#include "hd_map/map.pb.h"
#include "lane_graph.h"
#include "localization/ego.pb.h"
#include "mission/goal.pb.h"
#include "reference_line.h"
#include "router.h"

namespace ads {

/// Serves the map: the lanes around the vehicle, and the route to the mission's goal.
///
/// In:   `localization/ego`, `mission/initial_pose`, `mission/goal`
/// Out:  `map/tile`, when the vehicle has moved; `map/route`, for each goal
/// Serves: `map/tiles`
class HdMap final : public fastcycle::Component {
 public:
  explicit HdMap(fastcycle::Context& context);
  void start() override;

 private:
  struct Pose {
    Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
    double heading_rad = 0.0;
  };

  void move_to(const Pose& pose);
  void publish_tile(const Eigen::Vector2d& place_m);
  void serve_tile(const hd_map::TileRequest& request, fastcycle::Responder<hd_map::Tile> responder);
  void publish_route();
  void fill_tile(const Eigen::Vector2d& place_m, double radius_m, hd_map::Tile& tile) const;

  fastcycle::Param<fastcycle::Path> file_;
  fastcycle::Param<double> radius_m_;
  fastcycle::Param<double> lane_change_m_;
  fastcycle::Param<double> change_length_m_;
  fastcycle::Param<double> extension_m_;
  fastcycle::Param<double> smoothing_m_;
  fastcycle::Param<double> smoothing_error_m_;
  fastcycle::Publisher<hd_map::Tile> tiles_;
  fastcycle::Publisher<hd_map::Route> routes_;

  std::optional<LaneGraph> graph_;
  std::optional<Pose> pose_;
  std::optional<Eigen::Vector2d> tile_at_m_;
  std::optional<mission::Goal> goal_;
};

}  // namespace ads
