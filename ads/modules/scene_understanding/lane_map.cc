#include "lane_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "common/map_lines.h"
#include "scene_understanding_tuning.h"

namespace ads {
namespace {

bool is_successor(const LaneMap::Lane& lane, std::int64_t id) {
  return std::ranges::find(lane.info.successors(), id) != lane.info.successors().end();
}

}  // namespace

LaneMap::LaneMap(const hd_map::Tile& tile) {
  for (const hd_map::Lane& info : tile.lanes()) {
    const auto left = points_of(info.left());
    const auto right = points_of(info.right());
    std::vector<Eigen::Vector2d> center;
    Eigen::AlignedBox2d bounds;
    for (std::size_t index = 0; index < std::min(left.size(), right.size()); ++index) {
      center.emplace_back((left[index] + right[index]) / 2.0);
      bounds.extend(left[index]);
      bounds.extend(right[index]);
    }
    try {
      lanes_.emplace(info.id(), Lane{.info = info,
                                     .center = Polyline(center),
                                     .left = Polyline(left),
                                     .right = Polyline(right),
                                     .bounds = bounds});
    } catch (const std::invalid_argument&) {
      // Without a length it is no lane.
    }
  }
}

const LaneMap::Lane* LaneMap::find(std::int64_t id) const {
  const auto found = lanes_.find(id);
  return found == lanes_.end() ? nullptr : &found->second;
}

std::optional<LanePlace> LaneMap::match(const Eigen::Vector2d& position_m, double heading_rad,
                                        double speed_mps, std::int64_t previous,
                                        const std::set<std::int64_t>& route) const {
  const Lane* const before = find(previous);
  std::optional<LanePlace> best;
  double least_m = std::numeric_limits<double>::infinity();
  for (const auto& [id, lane] : lanes_) {
    if (lane.bounds.exteriorDistance(position_m) > kLaneMap.beyond_map_m) {
      continue;
    }
    const Polyline::Projection place = lane.center.project(position_m);
    const double beside_m = std::max(
        {0.0, lane.left.project(position_m).offset_m, -lane.right.project(position_m).offset_m});
    const bool is_before = place.along_m < 0.0;
    const double beyond_m =
        std::max(0.0, std::max(-place.along_m, place.along_m - lane.center.length_m()));
    const bool is_end =
        is_before ? lane.info.predecessors_size() == 0 : lane.info.successors_size() == 0;
    double slant_rad =
        std::abs(normalize_angle(heading_rad + (speed_mps < 0.0 ? std::numbers::pi : 0.0) -
                                 lane.center.heading_at(place.along_m)));
    if (std::abs(speed_mps) < kLaneMap.moving_mps) {
      slant_rad = std::min(slant_rad, std::numbers::pi - slant_rad);
    } else if (slant_rad > kLaneMap.slant_rad) {
      continue;
    }
    if (beside_m > kLaneMap.beside_m ||
        beyond_m > (is_end ? kLaneMap.beyond_map_m : kLaneMap.beyond_m)) {
      continue;
    }
    double misfit_m = beside_m + (is_end ? 0.0 : beyond_m) + kLaneMap.slant_m_per_rad * slant_rad;
    if (id == previous || (before != nullptr && is_successor(*before, id))) {
      misfit_m -= kLaneMap.hysteresis_m;
    }
    if (route.contains(id)) {
      misfit_m -= kLaneMap.on_route_m;
    }
    if (misfit_m < least_m) {
      least_m = misfit_m;
      best = {.lane = id, .along_m = place.along_m, .offset_m = place.offset_m};
    }
  }
  return best;
}

}  // namespace ads
