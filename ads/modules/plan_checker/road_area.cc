#include "road_area.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/map_lines.h"
#include "common/plane.h"
#include "common/scalar.h"
#include "plan_checker_tuning.h"

namespace plan_checker {
namespace {

using ads::kInfinity;

bool is_line(const std::vector<Eigen::Vector2d>& points) {
  return points.size() > 1 && std::ranges::all_of(points, [](const Eigen::Vector2d& point) {
           return point.allFinite();
         });
}

// The line's end, moved straight on by `by_m`; `before` is the point before the end.
Eigen::Vector2d moved_on(const Eigen::Vector2d& before, const Eigen::Vector2d& end, double by_m) {
  const Eigen::Vector2d way = end - before;
  return way.norm() > 0.0 ? Eigen::Vector2d(end + by_m * way.normalized()) : end;
}

void go_on_straight(std::vector<Eigen::Vector2d>& line, bool at_begin, bool at_end) {
  if (at_end) {
    line.push_back(moved_on(line[line.size() - 2], line.back(), kRoadArea.beyond_map_m));
  }
  if (at_begin) {
    line.insert(line.begin(), moved_on(line[1], line[0], kRoadArea.beyond_map_m));
  }
}

}  // namespace

bool RoadArea::Lane::is_near(const Eigen::Vector2d& place_m, double within_m) const {
  return (place_m.array() >= low_m.array() - within_m).all() &&
         (place_m.array() <= high_m.array() + within_m).all();
}

double RoadArea::Lane::heading_at(const Eigen::Vector2d& place_m) const {
  std::size_t best = 0;
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t index = 0; index + 1 < centre_m.size(); ++index) {
    const double away_m = ads::distance_m(place_m, centre_m[index], centre_m[index + 1]);
    if (away_m < least_m) {
      least_m = away_m;
      best = index;
    }
  }
  const Eigen::Vector2d way = centre_m[best + 1] - centre_m[best];
  return std::atan2(way.y(), way.x());
}

RoadArea::RoadArea(const hd_map::Tile& tile)
    : middle_m_(tile.x_m(), tile.y_m()), radius_m_(tile.radius_m()) {
  for (const hd_map::Lane& lane : tile.lanes()) {
    if (lane.type() != hd_map::CROSSING && lane.type() != hd_map::OTHER) {
      add(lane);
    }
  }
}

void RoadArea::add(const hd_map::Lane& message) {
  std::vector<Eigen::Vector2d> left = ads::points_of(message.left());
  std::vector<Eigen::Vector2d> right = ads::points_of(message.right());
  if (!is_line(left) || !is_line(right)) {
    return;
  }
  Lane lane{.id = message.id(),
            .speed_limit_mps = message.speed_limit_mps(),
            .edge_m = {},
            .centre_m = {},
            .low_m = {},
            .high_m = {}};
  for (std::size_t index = 0; index < std::min(left.size(), right.size()); ++index) {
    lane.centre_m.emplace_back(0.5 * (left[index] + right[index]));
  }
  for (std::vector<Eigen::Vector2d>* line : {&left, &right}) {
    go_on_straight(*line, message.predecessors().empty(), message.successors().empty());
  }
  lane.edge_m = std::move(left);
  lane.edge_m.insert(lane.edge_m.end(), right.rbegin(), right.rend());
  lane.low_m = lane.high_m = lane.edge_m.front();
  for (const Eigen::Vector2d& point : lane.edge_m) {
    lane.low_m = lane.low_m.cwiseMin(point);
    lane.high_m = lane.high_m.cwiseMax(point);
  }
  lanes_.push_back(std::move(lane));
}

bool RoadArea::covers(const Eigen::Vector2d& place_m) const {
  return (place_m - middle_m_).norm() < radius_m_;
}

double RoadArea::beyond_m(const Eigen::Vector2d& place_m) const {
  for (const Lane& lane : lanes_) {
    if (lane.is_near(place_m, 0.0) && ads::contains(lane.edge_m, place_m)) {
      return 0.0;
    }
  }
  // A lane is nearly always close by: then few edges have to be tested.
  double least_m = kInfinity;
  for (const double within_m : {1.0, 10.0, 100.0, kInfinity}) {
    for (const Lane& lane : lanes_) {
      if (!lane.is_near(place_m, std::min(within_m, least_m))) {
        continue;
      }
      for (std::size_t index = 0; index < lane.edge_m.size(); ++index) {
        const Eigen::Vector2d& next = lane.edge_m[(index + 1) % lane.edge_m.size()];
        least_m = std::min(least_m, ads::distance_m(place_m, lane.edge_m[index], next));
      }
    }
    if (least_m <= within_m) {
      break;
    }
  }
  return least_m;
}

std::optional<RoadArea::SpeedLimit> RoadArea::speed_limit(const Eigen::Vector2d& place_m,
                                                          double heading_rad) const {
  std::optional<SpeedLimit> highest;
  for (const Lane& lane : lanes_) {
    if (!lane.is_near(place_m, 0.0) || !ads::contains(lane.edge_m, place_m) ||
        std::cos(lane.heading_at(place_m) - heading_rad) < kRoadArea.aligned) {
      continue;
    }
    if (!(lane.speed_limit_mps > 0.0)) {
      return std::nullopt;
    }
    if (!highest || lane.speed_limit_mps > highest->mps) {
      highest = {.lane = lane.id, .mps = lane.speed_limit_mps};
    }
  }
  return highest;
}

}  // namespace plan_checker
