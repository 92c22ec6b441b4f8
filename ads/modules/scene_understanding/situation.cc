#include "situation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "scene_understanding_tuning.h"

namespace ads {
namespace {

// Half of what a box takes along a line, when it stands at a slant to it.
double half_along(double length_m, double width_m, double slant_rad) {
  return (std::abs(length_m * std::cos(slant_rad)) + std::abs(width_m * std::sin(slant_rad))) / 2.0;
}

}  // namespace

std::optional<RouteFrame> RouteFrame::of(const hd_map::Route& route) {
  const hd_map::Line& line = route.reference();
  std::vector<Eigen::Vector2d> points;
  for (int index = 0; index < std::min(line.x_m_size(), line.y_m_size()); ++index) {
    points.emplace_back(line.x_m(index), line.y_m(index));
  }
  if (!route.is_found() || points.size() < 2) {
    return std::nullopt;
  }
  RouteFrame frame{Polyline(points)};
  frame.left_edge_m_.assign(route.left_edge_m().begin(), route.left_edge_m().end());
  frame.right_edge_m_.assign(route.right_edge_m().begin(), route.right_edge_m().end());
  for (const auto& section : route.sections()) {
    frame.lanes_.insert(section.lanes().begin(), section.lanes().end());
  }
  return frame;
}

RouteFrame::RouteFrame(const EgoState& ego)
    : reference_(std::array<Eigen::Vector2d, 2>{ego.position_m,
                                                ego.position_m + direction(ego.heading_rad)}) {}

bool RouteFrame::is_on_road(const Polyline::Projection& place, double margin_m) const {
  const auto& along = reference_.arclengths_m();
  const auto index =
      static_cast<std::size_t>(std::ranges::lower_bound(along, place.along_m) - along.begin());
  const auto edge = [&](const std::vector<double>& edges) {
    return edges.size() == along.size() ? edges[std::min(index, edges.size() - 1)]
                                        : kSituation.unknown_edge_m;
  };
  return place.offset_m <= edge(left_edge_m_) + margin_m &&
         place.offset_m >= -edge(right_edge_m_) - margin_m;
}

Situation::Situation(const LaneMap& lanes, const RouteFrame& frame, const EgoState& ego,
                     std::int64_t ego_lane, const SituationOptions& options)
    : lanes_(lanes),
      frame_(frame),
      ego_(ego),
      options_(options),
      ego_place_(frame.project(ego.position_m)),
      ego_half_m_(options.ego_length_m / 2.0) {
  if (lanes.find(ego_lane) != nullptr) {
    spread_from(ego_lane, true);
    spread_from(ego_lane, false);
    find_crossing();
  }
}

std::vector<std::int64_t> Situation::next_of(const LaneMap::Lane& lane, bool is_forward) const {
  if (!is_forward) {
    return {lane.info.predecessors().begin(), lane.info.predecessors().end()};
  }
  std::vector<std::int64_t> all(lane.info.successors().begin(), lane.info.successors().end());
  std::vector<std::int64_t> on_route;
  std::ranges::copy_if(all, std::back_inserter(on_route),
                       [this](std::int64_t id) { return frame_.has_lane(id); });
  return on_route.empty() ? all : on_route;
}

void Situation::spread_sideways(std::int64_t lane, int side,
                                std::map<std::int64_t, int>& row) const {
  for (const int step : {1, -1}) {
    std::int64_t current = lane;
    for (int at = side;; at += step) {
      const LaneMap::Lane* found = lanes_.find(current);
      if (found == nullptr || (current != lane && !row.emplace(current, at).second)) {
        break;
      }
      const bool goes_on =
          step > 0 ? found->info.is_left_same_direction() : found->info.is_right_same_direction();
      current = step > 0 ? found->info.left_lane() : found->info.right_lane();
      if (!goes_on || current == 0) {
        break;
      }
    }
  }
}

void Situation::spread_from(std::int64_t ego_lane, bool is_forward) {
  std::map<std::int64_t, int> row{{ego_lane, 0}};
  double way_m = 0.0;
  while (!row.empty() && way_m < (is_forward ? kSituation.ahead_m : kSituation.behind_m)) {
    const auto first = row;
    for (const auto& [lane, side] : first) {
      spread_sideways(lane, side, row);
    }
    std::map<std::int64_t, int> next;
    double length_m = std::numeric_limits<double>::infinity();
    for (const auto& [id, side] : row) {
      const LaneMap::Lane* lane = lanes_.find(id);
      if (lane == nullptr) {
        continue;
      }
      const bool is_new = sides_.emplace(id, side).second;
      if (is_forward && side == 0 && is_new) {
        ahead_.push_back(id);
      }
      length_m = std::min(length_m, lane->center.length_m());
      for (const std::int64_t other : next_of(*lane, is_forward)) {
        if (!sides_.contains(other) && !row.contains(other)) {
          next.emplace(other, side);
        }
      }
    }
    way_m += std::max(1.0, length_m);
    row = std::move(next);
  }
}

void Situation::find_crossing() {
  const auto yields = [](const LaneMap::Lane& lane, std::int64_t to) {
    return std::ranges::find(lane.info.yields_to(), to) != lane.info.yields_to().end();
  };
  for (const std::int64_t id : ahead_) {
    const LaneMap::Lane& lane = *lanes_.find(id);
    for (const std::int64_t other : lane.info.conflicts()) {
      const LaneMap::Lane* found = lanes_.find(other);
      if (found == nullptr || sides_.contains(other)) {
        continue;
      }
      // If the map does not define right of way, the ego yields.
      mark_crossing(other, !yields(lane, other) && yields(*found, id) ? scene::EGO_FIRST
                                                                      : scene::OBJECT_FIRST);
    }
  }
}

void Situation::mark_crossing(std::int64_t lane, scene::RightOfWay right_of_way) {
  std::vector<std::pair<std::int64_t, double>> open{{lane, 0.0}};
  std::set<std::int64_t> seen;
  while (!open.empty()) {
    const auto [id, away_m] = open.back();
    open.pop_back();
    const LaneMap::Lane* found = lanes_.find(id);
    if (found == nullptr || sides_.contains(id) || !seen.insert(id).second) {
      continue;
    }
    auto& known = crossing_.emplace(id, right_of_way).first->second;
    known = std::max(known, right_of_way);
    const double length_m = id == lane ? 0.0 : found->center.length_m();
    if (away_m + length_m < kSituation.approach_m) {
      for (const std::int64_t before : found->info.predecessors()) {
        open.emplace_back(before, away_m + length_m);
      }
    }
  }
}

void Situation::judge(const perception::Object& object, const std::optional<LanePlace>& place,
                      scene::SceneObject& result) const {
  const Eigen::Vector2d position(object.x_m(), object.y_m());
  const Polyline::Projection on_route = frame_.project(position);
  const double half_m = half_along(object.length_m(), object.width_m(),
                                   object.heading_rad() - frame_.heading_at(on_route.along_m));
  const double gap_m = std::abs(on_route.along_m - ego_place_.along_m) - half_m - ego_half_m_;
  const std::int64_t lane = place ? place->lane : 0;
  result.set_relation(relation(object, lane, on_route, gap_m));
  result.set_lane(lane);
  if (place) {
    result.set_along_m(place->along_m);
    result.set_offset_m(place->offset_m);
  }
  const bool is_on_route = frame_.is_on_road(on_route, kSituation.road_margin_m) &&
                           result.relation() != scene::ELSEWHERE;
  result.set_gap_m(is_on_route ? gap_m : std::numeric_limits<double>::quiet_NaN());
  if (result.relation() == scene::CROSSING) {
    result.set_right_of_way(crossing_.at(lane));
  }
  result.set_is_relevant(is_relevant(object, result, on_route));
}

scene::Relation Situation::relation(const perception::Object& object, std::int64_t lane,
                                    const Polyline::Projection& place, double gap_m) const {
  const bool is_ahead = place.along_m > ego_place_.along_m;
  if (const auto found = sides_.find(lane); found != sides_.end()) {
    if (found->second == 0) {
      return is_ahead ? scene::LEADING : scene::BEHIND;
    }
    const bool is_left = found->second > 0;
    if (gap_m < 0.0) {
      return is_left ? scene::BESIDE_LEFT : scene::BESIDE_RIGHT;
    }
    return is_ahead ? (is_left ? scene::AHEAD_LEFT : scene::AHEAD_RIGHT)
                    : (is_left ? scene::BEHIND_LEFT : scene::BEHIND_RIGHT);
  }
  if (crossing_.contains(lane)) {
    return scene::CROSSING;
  }
  const double slant_rad =
      std::abs(normalize_angle(object.heading_rad() - frame_.heading_at(place.along_m)));
  if (slant_rad > kSituation.oncoming_rad && object.speed_mps() > kSituation.standing_mps &&
      is_ahead) {
    return scene::ONCOMING;
  }
  if (lane == 0 && std::abs(place.offset_m - ego_place_.offset_m) <
                       kSituation.in_the_way_m + object.width_m() / 2.0) {
    return is_ahead ? scene::LEADING : scene::BEHIND;
  }
  return scene::ELSEWHERE;
}

bool Situation::is_relevant(const perception::Object& object, const scene::SceneObject& judged,
                            const Polyline::Projection& place) const {
  const double distance_m = (Eigen::Vector2d(object.x_m(), object.y_m()) - ego_.position_m).norm();
  const double reach_m =
      std::max(options_.reach_min_m, options_.reach_s * std::abs(ego_.speed_mps));
  switch (judged.relation()) {
    case scene::LEADING:
    case scene::AHEAD_LEFT:
    case scene::AHEAD_RIGHT:
    case scene::CROSSING:
      return distance_m < reach_m;
    case scene::BESIDE_LEFT:
    case scene::BESIDE_RIGHT:
      return true;
    case scene::BEHIND:
    case scene::BEHIND_LEFT:
    case scene::BEHIND_RIGHT:
      return distance_m < std::max(options_.reach_min_m,
                                   options_.reach_s * (object.speed_mps() - ego_.speed_mps));
    case scene::ONCOMING:
      return distance_m < 2.0 * reach_m &&
             std::abs(place.offset_m - ego_place_.offset_m) < kSituation.oncoming_beside_m;
    default:
      return distance_m < kSituation.nearby_m;
  }
}

bool Situation::is_ahead(const connectivity::Hazard& hazard) const {
  const Polyline::Projection place = frame_.project({hazard.x_m(), hazard.y_m()});
  return place.along_m + hazard.radius_m() > ego_place_.along_m - ego_half_m_ &&
         frame_.is_on_road(place, hazard.radius_m());
}

}  // namespace ads
