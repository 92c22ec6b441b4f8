#include "box_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/plane.h"
#include "perception_tuning.h"

namespace ads {
namespace {

// A point in the directions of the box, from the reference.
using Along = Eigen::Vector2d;

struct Extreme {
  double place_m = -std::numeric_limits<double>::infinity();
  std::size_t point = 0;
};

// One end of the silhouette.
struct Silhouette {
  double azimuth = 0.0;  // From that of the first point.
  bool is_free = false;
};

class Measuring {
 public:
  Measuring(const ObjectView& view, const Skyline& skyline, const Eigen::Vector2d& reference_m,
            double heading_rad, double width_m)
      : view_(view),
        reference_m_(reference_m),
        axis_(direction(heading_rad)),
        face_width_m_(std::clamp(kBoxView.face_share * width_m, kBoxView.face_width_min_m,
                                 kBoxView.face_width_m)) {
    sensor_ = along(view.sensor_m);
    for (std::size_t index = 0; index < view.points.size(); ++index) {
      const Along place = along(view.points[index].place_m);
      for (int axis = 0; axis < 2; ++axis) {
        take(highest_[static_cast<std::size_t>(axis)], place[axis], index);
        take(lowest_[static_cast<std::size_t>(axis)], -place[axis], index);
      }
    }
    find_silhouette(skyline);
  }

  // The edge at the end of `axis` (0: heading, 1: left) in the direction `sign`.
  [[nodiscard]] Edge edge(int axis, double sign) const {
    const Extreme& extreme = extreme_of(axis, sign);
    Edge edge{
        .place_m = sign * extreme.place_m, .stddev_m = kBoxView.end_stddev_m, .is_end = false};
    if (is_turned_to_sensor(axis, sign)) {
      if (const auto place = face(axis, sign)) {
        return {.place_m = sign * *place, .stddev_m = kBoxView.face_stddev_m, .is_end = true};
      }
    }
    const int other = 1 - axis;
    const double side = sensor_[other] > 0.0 ? 1.0 : -1.0;
    if (!is_turned_to_sensor(other, side) || !is_at_free_end(extreme.point)) {
      return edge;
    }
    // It lies on the face beside, at the end of the silhouette: the next beam passed by.
    const Along end = along(view_.points[extreme.point].place_m);
    const bool is_on_face =
        extreme_of(other, side).place_m - side * end[other] < kBoxView.face_m + 0.05;
    const Along ray = (end - sensor_).normalized();
    const double spacing =
        view_.spread_rad * (end - sensor_).norm() / std::max(1e-3, std::abs(ray[other]));
    // Little of a face may be the face beside it, if the heading is not that exact.
    const bool is_long =
        length_of_face(axis, other, side) > (axis == 0 ? kBoxView.side_length_m : face_width_m_);
    if (is_on_face && is_long && spacing < kBoxView.spacing_max_m && is_upright(axis, sign)) {
      edge.place_m += sign * 0.5 * spacing;
      edge.stddev_m = std::hypot(kBoxView.end_stddev_m, spacing / std::sqrt(12.0));
      edge.is_end = true;
    }
    return edge;
  }

 private:
  static void take(Extreme& extreme, double place, std::size_t point) {
    if (place > extreme.place_m) {
      extreme = {.place_m = place, .point = point};
    }
  }

  [[nodiscard]] Along along(const Eigen::Vector2d& place_m) const {
    const Eigen::Vector2d apart = place_m - reference_m_;
    return {apart.dot(axis_), apart.dot(left_of(axis_))};
  }

  // The largest place times `sign`.
  [[nodiscard]] const Extreme& extreme_of(int axis, double sign) const {
    return (sign > 0.0 ? highest_ : lowest_)[static_cast<std::size_t>(axis)];
  }

  [[nodiscard]] bool is_turned_to_sensor(int axis, double sign) const {
    return sign * sensor_[axis] > extreme_of(axis, sign).place_m;
  }

  // Where the face is, if it is seen over some width: the mean of its points.
  [[nodiscard]] std::optional<double> face(int axis, double sign) const {
    const double end = extreme_of(axis, sign).place_m;
    const int other = 1 - axis;
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    double sum = 0.0;
    int count = 0;
    for (const ObjectPoint& point : view_.points) {
      const Along place = along(point.place_m);
      if (sign * place[axis] > end - kBoxView.face_m) {
        low = std::min(low, place[other]);
        high = std::max(high, place[other]);
        sum += sign * place[axis];
        ++count;
      }
    }
    if (high - low < face_width_m_ || !is_upright(axis, sign)) {
      return std::nullopt;
    }
    return sum / count;
  }

  void find_silhouette(const Skyline& skyline) {
    if (view_.points.empty()) {
      return;
    }
    std::size_t least = 0;
    std::size_t most = 0;
    for (std::size_t index = 0; index < view_.points.size(); ++index) {
      least = azimuth(index) < azimuth(least) ? index : least;
      most = azimuth(index) > azimuth(most) ? index : most;
    }
    const auto end = [&](std::size_t index, int side) {
      const ObjectPoint& point = view_.points[index];
      return Silhouette{
          .azimuth = azimuth(index),
          .is_free = !skyline.is_hidden_beside(point.azimuth_rad, point.range_m, side)};
    };
    ends_ = {end(least, -1), end(most, 1)};
  }

  // How far the points of the face at the end of `other` reach along `axis`.
  [[nodiscard]] double length_of_face(int axis, int other, double side) const {
    const double end = extreme_of(other, side).place_m;
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const ObjectPoint& point : view_.points) {
      const Along place = along(point.place_m);
      if (side * place[other] > end - kBoxView.face_m - 0.05) {
        low = std::min(low, place[axis]);
        high = std::max(high, place[axis]);
      }
    }
    return high - low;
  }

  // Whether the outermost points stand above each other: a wall ends there, and not a roof.
  [[nodiscard]] bool is_upright(int axis, double sign) const {
    const double end = extreme_of(axis, sign).place_m;
    float low = std::numeric_limits<float>::infinity();
    float high = 0.0F;
    for (const ObjectPoint& point : view_.points) {
      if (sign * along(point.place_m)[axis] > end - kBoxView.face_m) {
        low = std::min(low, point.height_m);
        high = std::max(high, point.height_m);
      }
    }
    return high - low > kBoxView.upright_m;
  }

  [[nodiscard]] bool is_at_free_end(std::size_t index) const {
    return std::ranges::any_of(ends_, [&](const Silhouette& end) {
      return end.is_free && std::abs(azimuth(index) - end.azimuth) < 1.5 * view_.spread_rad;
    });
  }

  [[nodiscard]] double azimuth(std::size_t index) const {
    return std::remainder(static_cast<double>(view_.points[index].azimuth_rad) -
                              static_cast<double>(view_.points[0].azimuth_rad),
                          2.0 * std::numbers::pi);
  }

  const ObjectView& view_;
  const Eigen::Vector2d reference_m_;
  const Eigen::Vector2d axis_;
  const double face_width_m_;
  Along sensor_;
  std::array<Extreme, 2> highest_;
  std::array<Extreme, 2> lowest_;
  std::array<Silhouette, 2> ends_;
};

}  // namespace

BoxView view_box(const ObjectView& view, const Skyline& skyline, const Eigen::Vector2d& reference_m,
                 double heading_rad, double width_m) {
  const Measuring measuring(view, skyline, reference_m, heading_rad, width_m);
  BoxView box{.front = measuring.edge(0, 1.0),
              .rear = measuring.edge(0, -1.0),
              .left = measuring.edge(1, 1.0),
              .right = measuring.edge(1, -1.0)};
  for (const ObjectPoint& point : view.points) {
    box.height_m = std::max(box.height_m, static_cast<double>(point.height_m));
  }
  return box;
}

std::optional<SeenHeading> heading_of_faces(const ObjectView& view,
                                            const Eigen::Vector2d& reference_m,
                                            double heading_rad) {
  double weight = 0.0;
  double turn = 0.0;
  for (int axis = 0; axis < 2; ++axis) {
    // A face along `axis`, on the sensor's side; its slope is how far the heading is off.
    const Eigen::Vector2d ahead =
        direction(heading_rad + (axis == 0 ? 0.0 : 0.5 * std::numbers::pi));
    const double side = cross(ahead, view.sensor_m - reference_m) > 0.0 ? 1.0 : -1.0;
    double slope = 0.0;
    double offset = -std::numeric_limits<double>::infinity();
    for (const ObjectPoint& point : view.points) {
      offset = std::max(offset, side * cross(ahead, point.place_m - reference_m));
    }
    if (side * cross(ahead, view.sensor_m - reference_m) < offset) {
      continue;
    }
    double length = 0.0;
    double scatter = 0.0;
    int count = 0;
    float rise_m = 0.0F;
    for (int round = 0; round < 3; ++round) {
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      double low = std::numeric_limits<double>::infinity();
      double high = -low;
      double square = 0.0;
      double product = 0.0;
      float lowest_m = std::numeric_limits<float>::infinity();
      float highest_m = 0.0F;
      count = 0;
      for (const ObjectPoint& point : view.points) {
        const Eigen::Vector2d apart = point.place_m - reference_m;
        const double x = apart.dot(ahead);
        const double y = side * cross(ahead, apart);
        const double inside = offset + slope * x - y;
        if (inside < kBoxView.heading_band_m && inside > -kBoxView.heading_band_m) {
          sum += Eigen::Vector2d(x, y);
          square += x * x;
          product += x * y;
          low = std::min(low, x);
          high = std::max(high, x);
          lowest_m = std::min(lowest_m, point.height_m);
          highest_m = std::max(highest_m, point.height_m);
          ++count;
        }
      }
      length = high - low;
      rise_m = highest_m - lowest_m;
      if (count < kBoxView.heading_points_min || length < kBoxView.heading_length_m) {
        break;
      }
      const double n = count;
      scatter = square - sum.x() * sum.x() / n;
      slope = (product - sum.x() * sum.y() / n) / scatter;
      offset = (sum.y() - slope * sum.x()) / n;
    }
    // A roof is no face: what hides a part of it cuts it off at any angle.
    if (count < kBoxView.heading_points_min || length < kBoxView.heading_length_m ||
        rise_m < kBoxView.upright_m) {
      continue;
    }
    const double variance =
        kBoxView.heading_stddev_rad * kBoxView.heading_stddev_rad +
        kBoxView.heading_point_stddev_m * kBoxView.heading_point_stddev_m / scatter;
    weight += 1.0 / variance;
    turn += side * std::atan(slope) / variance;
  }
  if (weight == 0.0) {
    return std::nullopt;
  }
  return SeenHeading{.heading_rad = heading_rad + turn / weight,
                     .stddev_rad = std::sqrt(1.0 / weight)};
}

double heading_by_closeness(const ObjectView& view, double middle_rad, double reach_rad) {
  constexpr double kStep_rad = kBoxView.closeness_step_deg * std::numbers::pi / 180.0;
  const std::size_t stride = view.points.size() / kBoxView.closeness_points_max + 1;
  const auto closeness = [&](double heading) {
    const Eigen::Vector2d axis = direction(heading);
    Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
    Eigen::Array2d high = -low;
    const auto along = [&](const ObjectPoint& point) {
      const Eigen::Vector2d apart = point.place_m - view.sensor_m;
      return Eigen::Array2d(apart.dot(axis), apart.dot(left_of(axis)));
    };
    for (std::size_t index = 0; index < view.points.size(); index += stride) {
      const Eigen::Array2d place = along(view.points[index]);
      low = low.min(place);
      high = high.max(place);
    }
    double sum = 0.0;
    for (std::size_t index = 0; index < view.points.size(); index += stride) {
      const Eigen::Array2d place = along(view.points[index]);
      sum += 1.0 / std::max(kBoxView.closeness_min_m, (place - low).min(high - place).minCoeff());
    }
    return sum;
  };
  // From the middle outwards: among equals the closest to it.
  double best = middle_rad;
  double best_closeness = closeness(middle_rad);
  for (double off = kStep_rad; off < reach_rad; off += kStep_rad) {
    for (const double heading : {middle_rad + off, middle_rad - off}) {
      const double its_closeness = closeness(heading);
      if (its_closeness > best_closeness) {
        best = heading;
        best_closeness = its_closeness;
      }
    }
  }
  return best;
}

}  // namespace ads
