#include "common/plane.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "common/scalar.h"

namespace ads {
namespace {

// The point of the box in its own directions, from its centre.
Eigen::Vector2d in_box(const Box& box, const Eigen::Vector2d& point_m) {
  const Eigen::Vector2d forward = direction(box.heading_rad);
  const Eigen::Vector2d from_center = point_m - box.center_m;
  return {from_center.dot(forward), from_center.dot(left_of(forward))};
}

struct PlacedBox {
  explicit PlacedBox(const Box& box)
      : center_m(box.center_m),
        half_m(box.length_m / 2.0, box.width_m / 2.0),
        forward(direction(box.heading_rad)) {
    const Eigen::Vector2d ahead = forward * half_m.x();
    const Eigen::Vector2d left = left_of(forward) * half_m.y();
    corners_m = {center_m + ahead + left, center_m - ahead + left, center_m - ahead - left,
                 center_m + ahead - left};
  }

  Eigen::Vector2d center_m;
  Eigen::Vector2d half_m;
  Eigen::Vector2d forward;
  std::array<Eigen::Vector2d, 4> corners_m;
};

struct CornersBeside {
  bool are_separated;  // One of the box's edges has all corners strictly on its other side.
  double distance_m;   // Of the nearest one.
};

CornersBeside corners_beside(const PlacedBox& box,
                             const std::array<Eigen::Vector2d, 4>& corners_m) {
  const Eigen::Vector2d left = left_of(box.forward);
  Eigen::Vector2d least(kInfinity, kInfinity);
  Eigen::Vector2d most(-kInfinity, -kInfinity);
  double squared = kInfinity;
  for (const Eigen::Vector2d& corner : corners_m) {
    const Eigen::Vector2d from_center = corner - box.center_m;
    const Eigen::Vector2d place(from_center.dot(box.forward), from_center.dot(left));
    least = least.cwiseMin(place);
    most = most.cwiseMax(place);
    const Eigen::Vector2d beyond = (place.cwiseAbs() - box.half_m).cwiseMax(0.0);
    squared = std::min(squared, beyond.squaredNorm());
  }
  return {(least.array() > box.half_m.array()).any() || (most.array() < -box.half_m.array()).any(),
          std::sqrt(squared)};
}

}  // namespace

double normalize_angle(double angle_rad) {
  const double angle = std::remainder(angle_rad, 2.0 * std::numbers::pi);
  return angle <= -std::numbers::pi ? std::numbers::pi : angle;
}

Eigen::Vector2d direction(double heading_rad) {
  return {std::cos(heading_rad), std::sin(heading_rad)};
}

Eigen::Vector2d left_of(const Eigen::Vector2d& vector) {
  return {-vector.y(), vector.x()};
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

std::array<Eigen::Vector2d, 4> Box::corners() const {
  return PlacedBox(*this).corners_m;
}

bool Box::contains(const Eigen::Vector2d& point_m) const {
  const Eigen::Vector2d place = in_box(*this, point_m);
  return std::abs(place.x()) <= length_m / 2.0 && std::abs(place.y()) <= width_m / 2.0;
}

bool overlap(const Box& a, const Box& b) {
  return distance_m(a, b) <= 0.0;
}

double distance_m(const Box& a, const Box& b) {
  const PlacedBox one(a);
  const PlacedBox other(b);
  const CornersBeside of_other = corners_beside(one, other.corners_m);
  const CornersBeside of_one = corners_beside(other, one.corners_m);
  const bool are_apart = of_other.are_separated || of_one.are_separated;
  return are_apart ? std::min(of_other.distance_m, of_one.distance_m) : 0.0;
}

double distance_m(const Eigen::Vector2d& point_m, const Eigen::Vector2d& begin_m,
                  const Eigen::Vector2d& end_m) {
  const Eigen::Vector2d segment = end_m - begin_m;
  const double squared = segment.squaredNorm();
  const double share =
      squared > 0.0 ? std::clamp((point_m - begin_m).dot(segment) / squared, 0.0, 1.0) : 0.0;
  return (point_m - begin_m - share * segment).norm();
}

bool contains(std::span<const Eigen::Vector2d> polygon_m, const Eigen::Vector2d& point_m) {
  bool is_inside = false;
  for (std::size_t index = 0; index < polygon_m.size(); ++index) {
    const Eigen::Vector2d begin = polygon_m[index] - point_m;
    const Eigen::Vector2d end = polygon_m[(index + 1) % polygon_m.size()] - point_m;
    const double side = cross(begin, end);
    if (side == 0.0 && begin.dot(end) <= 0.0) {
      return true;  // on the edge
    }
    // A ray to +x meets the edge.
    if ((begin.y() > 0.0) != (end.y() > 0.0)) {
      is_inside ^= (side > 0.0) == (end.y() > begin.y());
    }
  }
  return is_inside;
}

Polyline::Polyline(std::span<const Eigen::Vector2d> points_m) {
  for (const Eigen::Vector2d& point : points_m) {
    if (points_m_.empty()) {
      points_m_.push_back(point);
      arclengths_m_.push_back(0.0);
    } else if (const double step_m = (point - points_m_.back()).norm(); step_m > 0.0) {
      points_m_.push_back(point);
      arclengths_m_.push_back(arclengths_m_.back() + step_m);
    }
  }
  if (points_m_.size() < 2) {
    throw std::invalid_argument("a line needs two different points");
  }
  std::vector<double> segments_rad;
  for (std::size_t index = 0; index + 1 < points_m_.size(); ++index) {
    const Eigen::Vector2d step = points_m_[index + 1] - points_m_[index];
    const double heading = std::atan2(step.y(), step.x());
    segments_rad.push_back(index == 0 ? heading
                                      : segments_rad.back() +
                                            normalize_angle(heading - segments_rad.back()));
  }
  // Each end such that the mean along its segment is the direction of the segment.
  headings_rad_.resize(points_m_.size(), segments_rad.front());
  for (std::size_t index = 1; index + 1 < points_m_.size(); ++index) {
    headings_rad_[index] = (segments_rad[index - 1] + segments_rad[index]) / 2.0;
  }
  headings_rad_.back() = segments_rad.back();
  if (points_m_.size() > 2) {
    headings_rad_.front() = 2.0 * segments_rad.front() - headings_rad_[1];
    headings_rad_.back() = 2.0 * segments_rad.back() - headings_rad_[headings_rad_.size() - 2];
  }
}

Polyline::Projection Polyline::project(const Eigen::Vector2d& point_m) const {
  Projection best;
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t segment = 0; segment + 1 < points_m_.size(); ++segment) {
    const double length = segment_length_m(segment);
    const Eigen::Vector2d unit = (points_m_[segment + 1] - points_m_[segment]) / length;
    const Eigen::Vector2d from_begin = point_m - points_m_[segment];
    const double first = segment == 0 ? -std::numeric_limits<double>::infinity() : 0.0;
    const double last =
        segment + 2 == points_m_.size() ? std::numeric_limits<double>::infinity() : length;
    const double along = std::clamp(from_begin.dot(unit), first, last);
    const double away_m = (from_begin - along * unit).norm();
    if (away_m < least_m) {
      least_m = away_m;
      best = {.along_m = arclengths_m_[segment] + along,
              .offset_m = std::copysign(away_m, cross(unit, from_begin))};
    }
  }
  return best;
}

Eigen::Vector2d Polyline::point_at(double along_m) const {
  const std::size_t segment = segment_at(along_m);
  const double share = (along_m - arclengths_m_[segment]) / segment_length_m(segment);
  return points_m_[segment] + share * (points_m_[segment + 1] - points_m_[segment]);
}

Eigen::Vector2d Polyline::point_at(double along_m, double offset_m) const {
  return point_at(along_m) + offset_m * left_of(direction(heading_at(along_m)));
}

double Polyline::heading_at(double along_m) const {
  const double within_m = std::clamp(along_m, 0.0, length_m());
  const std::size_t segment = segment_at(within_m);
  return normalize_angle(headings_rad_[segment] +
                         curvature_at(within_m) * (within_m - arclengths_m_[segment]));
}

double Polyline::curvature_at(double along_m) const {
  if (along_m < 0.0 || along_m > length_m()) {
    return 0.0;
  }
  const std::size_t segment = segment_at(along_m);
  return (headings_rad_[segment + 1] - headings_rad_[segment]) / segment_length_m(segment);
}

Polyline Polyline::resampled(double step_m) const {
  const auto steps = static_cast<std::size_t>(std::max(1.0, std::ceil(length_m() / step_m)));
  std::vector<Eigen::Vector2d> points;
  points.reserve(steps + 1);
  for (std::size_t index = 0; index < steps; ++index) {
    points.push_back(
        point_at(length_m() * static_cast<double>(index) / static_cast<double>(steps)));
  }
  points.push_back(points_m_.back());
  return Polyline(points);
}

std::size_t Polyline::segment_at(double along_m) const {
  const auto after = std::ranges::upper_bound(arclengths_m_, along_m);
  const auto index = static_cast<std::size_t>(after - arclengths_m_.begin());
  return std::clamp<std::size_t>(index, 1, points_m_.size() - 1) - 1;
}

double Polyline::segment_length_m(std::size_t segment) const {
  return arclengths_m_[segment + 1] - arclengths_m_[segment];
}

}  // namespace ads
