#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "common/plane.h"
#include "connectivity/hazard.pb.h"
#include "hd_map/map.pb.h"
#include "lane_map.h"
#include "perception/objects.pb.h"
#include "scene/scene.pb.h"

namespace ads {

struct EgoState {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  double speed_mps = 0.0;
};

struct SituationOptions {
  double ego_length_m = 4.508;
  double reach_s = 8.0;       ///< What the ego reaches in this time is relevant,
  double reach_min_m = 50.0;  ///< and at least this distance.
};

/// The route to the goal as a coordinate frame.
class RouteFrame {
 public:
  /// The route's reference line; none if no route was found.
  static std::optional<RouteFrame> of(const hd_map::Route& route);
  /// Straight along the vehicle's heading.
  explicit RouteFrame(const EgoState& ego);

  [[nodiscard]] Polyline::Projection project(const Eigen::Vector2d& point_m) const {
    return reference_.project(point_m);
  }
  [[nodiscard]] double heading_at(double along_m) const { return reference_.heading_at(along_m); }
  /// Whether the position is on the road, or at most `margin_m` beside it.
  [[nodiscard]] bool is_on_road(const Polyline::Projection& place, double margin_m) const;
  [[nodiscard]] bool has_lane(std::int64_t lane) const { return lanes_.contains(lane); }
  [[nodiscard]] const std::set<std::int64_t>& lanes() const { return lanes_; }

 private:
  explicit RouteFrame(Polyline reference) : reference_(std::move(reference)) {}

  Polyline reference_;
  std::vector<double> left_edge_m_;
  std::vector<double> right_edge_m_;
  std::set<std::int64_t> lanes_;
};

/// The lanes relative to the ego's lane, and the relation of objects on them to the ego.
///
/// Lanes that follow the ego's lane, or lead to it, have side 0, the lanes to their left 1, 2, …,
/// to their right -1, -2, …. Where lanes diverge, those on the route are used. Lanes that conflict
/// with those ahead, and lanes that lead to them within 60 m, are crossing ones.
///
/// @threads  Confined.
class Situation {
 public:
  Situation(const LaneMap& lanes, const RouteFrame& frame, const EgoState& ego,
            std::int64_t ego_lane, const SituationOptions& options);

  /// Sets all fields except the object itself.
  void judge(const perception::Object& object, const std::optional<LanePlace>& place,
             scene::SceneObject& result) const;
  [[nodiscard]] bool is_ahead(const connectivity::Hazard& hazard) const;

 private:
  void spread_from(std::int64_t ego_lane, bool is_forward);
  void spread_sideways(std::int64_t lane, int side, std::map<std::int64_t, int>& row) const;
  void find_crossing();
  void mark_crossing(std::int64_t lane, scene::RightOfWay right_of_way);
  [[nodiscard]] std::vector<std::int64_t> next_of(const LaneMap::Lane& lane, bool is_forward) const;
  [[nodiscard]] scene::Relation relation(const perception::Object& object, std::int64_t lane,
                                         const Polyline::Projection& place, double gap_m) const;
  [[nodiscard]] bool is_relevant(const perception::Object& object, const scene::SceneObject& judged,
                                 const Polyline::Projection& place) const;

  const LaneMap& lanes_;
  const RouteFrame& frame_;
  EgoState ego_;
  SituationOptions options_;
  Polyline::Projection ego_place_;
  double ego_half_m_;
  std::map<std::int64_t, int> sides_;
  std::vector<std::int64_t> ahead_;  // Of side 0, including the ego's own lane.
  std::map<std::int64_t, scene::RightOfWay> crossing_;
};

}  // namespace ads
