#include "road.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/plane.h"
#include "common/scalar.h"
#include "motion_planning_tuning.h"

namespace motion_planning {
namespace {

using ads::mix;

double length(double x, double y) {
  return std::sqrt(x * x + y * y);
}

// A point between two, with the speed limit of the nearer one.
RoadPoint between(const RoadPoint& from, const RoadPoint& to, double share) {
  RoadPoint point = share < 0.5 ? from : to;
  point.x_m = mix(from.x_m, to.x_m, share);
  point.y_m = mix(from.y_m, to.y_m, share);
  point.left_edge_m = mix(from.left_edge_m, to.left_edge_m, share);
  point.right_edge_m = mix(from.right_edge_m, to.right_edge_m, share);
  return point;
}

}  // namespace

double wrapped(double angle_rad) {
  return std::remainder(angle_rad, 2.0 * std::numbers::pi);
}

Road::Road(const std::vector<RoadPoint>& points) {
  double next_m = 0.0;  // Until the next sample, from the begin of the piece.
  for (std::size_t index = 0; index + 1 < points.size(); ++index) {
    const RoadPoint& from = points[index];
    const RoadPoint& to = points[index + 1];
    const double length_m = length(to.x_m - from.x_m, to.y_m - from.y_m);
    for (; next_m < length_m && points_.size() < kPointsMax; next_m += kStep_m) {
      points_.push_back({.at = between(from, to, next_m / length_m)});
    }
    next_m -= length_m;
  }
  if (points_.size() < 2) {
    points_.clear();
    return;
  }
  for (std::size_t index = 0; index + 1 < points_.size(); ++index) {
    const RoadPoint& from = points_[index].at;
    const RoadPoint& to = points_[index + 1].at;
    const double heading = std::atan2(to.y_m - from.y_m, to.x_m - from.x_m);
    const double before = index == 0 ? heading : points_[index - 1].heading_rad;
    points_[index].heading_rad = before + wrapped(heading - before);
    points_[index].curvature_per_m = (points_[index].heading_rad - before) / kStep_m;
  }
  points_.back().heading_rad = points_[points_.size() - 2].heading_rad;
  for (Point& point : points_) {
    point.cosine = std::cos(point.heading_rad);
    point.sine = std::sin(point.heading_rad);
  }
  make_blocks();
}

void Road::make_blocks() {
  // As many blocks as points in each: this minimizes the total searched.
  const auto size = static_cast<std::size_t>(std::ceil(std::sqrt(points_.size())));
  for (std::size_t first = 0; first < points_.size(); first += size) {
    const std::size_t last = std::min(first + size, points_.size());
    const RoadPoint& middle = points_[(first + last) / 2].at;
    Block block{.first = first, .last = last, .x_m = middle.x_m, .y_m = middle.y_m};
    for (std::size_t index = first; index < last; ++index) {
      const RoadPoint& at = points_[index].at;
      block.radius_m = std::max(block.radius_m, length(at.x_m - block.x_m, at.y_m - block.y_m));
    }
    blocks_.push_back(block);
  }
}

void Road::add_lane(const std::vector<Eigen::Vector2d>& centre_m) {
  const ads::Polyline line = ads::Polyline(centre_m).resampled(kStep_m / 2.0);
  std::size_t last = points_.size();
  for (std::size_t index = 0; index < line.points_m().size(); ++index) {
    const Eigen::Vector2d& point = line.points_m()[index];
    const RoadPlace place = locate(point.x(), point.y());
    const double angle = line.heading_at(line.arclengths_m()[index]) - place.heading_rad;
    const bool is_beside = place.along_m >= 0.0 && place.along_m <= length_m() &&
                           place.offset_m < left_edge_m(place.along_m) &&
                           -place.offset_m < right_edge_m(place.along_m);
    if (place.index != last && is_beside && std::cos(angle) > kRoad.same_direction) {
      points_[place.index].lanes_m.push_back(place.offset_m);
      last = place.index;
    }
  }
}

RoadPlace Road::place_on(std::size_t index, double x_m, double y_m) const {
  const Point& from = points_[index];
  const double cosine = from.cosine;
  const double sine = from.sine;
  const double x = x_m - from.at.x_m;
  const double y = y_m - from.at.y_m;
  double along = x * cosine + y * sine;
  if (index > 0) {
    along = std::max(along, 0.0);
  }
  if (index + 2 < points_.size()) {
    along = std::min(along, kStep_m);
  }
  // The heading turns from the middle of the piece before to the middle of the one after.
  const double share = along / kStep_m - 0.5;
  const Point& other = points_[share < 0.0 ? index - std::min<std::size_t>(index, 1) : index + 1];
  const double heading = mix(from.heading_rad, other.heading_rad, std::min(std::abs(share), 0.5));
  const double side = -(x - along * cosine) * sine + (y - along * sine) * cosine;
  const double distance = length(x - along * cosine, y - along * sine);
  return {.along_m = along + kStep_m * static_cast<double>(index),
          .offset_m = std::copysign(distance, side),
          .heading_rad = heading,
          .index = index};
}

std::size_t Road::nearest_point(double x_m, double y_m) const {
  // The middle of a block is a point of the road: none that is farther is the nearest.
  double bound_m = std::numeric_limits<double>::infinity();
  for (const Block& block : blocks_) {
    bound_m = std::min(bound_m, length(block.x_m - x_m, block.y_m - y_m));
  }
  constexpr double kRounding = 1.0 + 1e-9;
  std::size_t nearest = 0;
  double smallest = std::numeric_limits<double>::infinity();
  for (const Block& block : blocks_) {
    if (length(block.x_m - x_m, block.y_m - y_m) > (bound_m + block.radius_m) * kRounding) {
      continue;
    }
    for (std::size_t index = block.first; index < block.last; ++index) {
      const double x = points_[index].at.x_m - x_m;
      const double y = points_[index].at.y_m - y_m;
      if (x * x + y * y < smallest) {
        smallest = x * x + y * y;
        nearest = index;
        bound_m = std::min(bound_m, std::sqrt(smallest));
      }
    }
  }
  return nearest;
}

RoadPlace Road::locate(double x_m, double y_m) const {
  const std::size_t nearest = nearest_point(x_m, y_m);
  const RoadPlace before = place_on(nearest == 0 ? 0 : nearest - 1, x_m, y_m);
  const RoadPlace after = place_on(std::min(nearest, points_.size() - 2), x_m, y_m);
  return std::abs(after.offset_m) < std::abs(before.offset_m) ? after : before;
}

RoadPlace Road::locate_near(double x_m, double y_m, std::size_t hint) const {
  std::size_t index = std::min(hint, points_.size() - 2);
  RoadPlace best = place_on(index, x_m, y_m);
  const auto try_direction = [&](int step) {
    bool is_better = false;
    for (std::size_t next = index; (step > 0 ? next + 2 < points_.size() : next > 0);) {
      next += static_cast<std::size_t>(step);
      const RoadPlace place = place_on(next, x_m, y_m);
      if (std::abs(place.offset_m) >= std::abs(best.offset_m)) {
        break;
      }
      best = place;
      is_better = true;
    }
    return is_better;
  };
  if (!try_direction(1)) {
    try_direction(-1);
  }
  return best;
}

std::size_t Road::index_at(double along_m) const {
  return static_cast<std::size_t>(
      std::clamp(along_m / kStep_m, 0.0, static_cast<double>(points_.size() - 2)));
}

Pose Road::pose(double along_m, double offset_m) const {
  const std::size_t index = index_at(along_m);
  const Point& from = points_[index];
  const double along = along_m - kStep_m * static_cast<double>(index);
  const double share = std::clamp(along / kStep_m, 0.0, 1.0) - 0.5;
  const Point& other = points_[share < 0.0 ? index - std::min<std::size_t>(index, 1) : index + 1];
  const double heading = mix(from.heading_rad, other.heading_rad, std::abs(share));
  return {.x_m = from.at.x_m + along * from.cosine - offset_m * std::sin(heading),
          .y_m = from.at.y_m + along * from.sine + offset_m * std::cos(heading),
          .heading_rad = heading};
}

double Road::left_edge_m(double along_m) const {
  return points_[index_at(along_m + kStep_m / 2.0)].at.left_edge_m;
}

double Road::right_edge_m(double along_m) const {
  return points_[index_at(along_m + kStep_m / 2.0)].at.right_edge_m;
}

double Road::speed_limit_mps(double along_m) const {
  return points_[index_at(along_m)].at.speed_limit_mps;
}

double Road::curvature_per_m(double along_m) const {
  return points_[index_at(along_m)].curvature_per_m;
}

double Road::lane_m(double along_m, double offset_m) const {
  double best = offset_m;
  double smallest = std::numeric_limits<double>::infinity();
  for (const double lane : points_[index_at(along_m)].lanes_m) {
    if (std::abs(lane - offset_m) < smallest) {
      smallest = std::abs(lane - offset_m);
      best = lane;
    }
  }
  return best;
}

}  // namespace motion_planning
