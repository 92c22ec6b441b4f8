#include "shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/plane.h"
#include "common/scalar.h"
#include "perception_tuning.h"

namespace ads {
namespace {

constexpr float kTurn_rad = 2.0F * std::numbers::pi_v<float>;
constexpr int kHighSide = 401;
// How far points reach in one direction.
class Extent {
 public:
  explicit Extent(const Eigen::Vector2d& along) : along_(along) {}
  void add(const Eigen::Vector2d& apart_m) {
    const double place = along_.dot(apart_m);
    low_ = std::min(low_, place);
    high_ = std::max(high_, place);
  }
  [[nodiscard]] double middle() const { return 0.5 * (low_ + high_); }
  [[nodiscard]] double length() const { return std::max(0.0, high_ - low_); }

 private:
  Eigen::Vector2d along_;
  double low_ = kInfinity;
  double high_ = -kInfinity;
};

bool is_left_of(const ObjectPoint& a, const ObjectPoint& b) {
  return std::remainder(a.azimuth_rad - b.azimuth_rad, kTurn_rad) > 0.0F;
}

// Whether something continues a flat object beyond its ends: it does for a wall, not for a car.
bool is_of_wall(const HighPlaces& high_places, const Eigen::Vector2d& middle_m,
                const Eigen::Vector2d& along, double length_m) {
  int high = 0;
  for (const double side : {1.0, -1.0}) {
    for (int step = 1; step <= kShape.wall_steps; ++step) {
      const double ahead =
          side * (0.5 * length_m + static_cast<double>(kShape.high_cell_m) * (step + 1));
      const Eigen::Vector2d place_m = middle_m + ahead * along;
      high += high_places.at(place_m) ||
                      high_places.at(place_m + 0.5 * kShape.high_cell_m * left_of(along)) ||
                      high_places.at(place_m - 0.5 * kShape.high_cell_m * left_of(along))
                  ? 1
                  : 0;
    }
  }
  return high >= kShape.wall_high_min;
}

}  // namespace

HighPlaces::HighPlaces() : is_high_(static_cast<std::size_t>(kHighSide) * kHighSide) {}

void HighPlaces::fill(std::span<const LidarReturn> returns, const Eigen::Vector2d& origin_m) {
  origin_m_ = origin_m;
  for (const int cell : filled_) {
    is_high_[static_cast<std::size_t>(cell)] = false;
  }
  filled_.clear();
  for (const LidarReturn& beam_return : returns) {
    const int cell = beam_return.height_m > kShape.wall_m ? cell_of(beam_return.place_m) : -1;
    if (cell >= 0 && !is_high_[static_cast<std::size_t>(cell)]) {
      is_high_[static_cast<std::size_t>(cell)] = true;
      filled_.push_back(cell);
    }
  }
}

bool HighPlaces::at(const Eigen::Vector2d& place_m) const {
  const int cell = cell_of((place_m - origin_m_).cast<float>());
  return cell >= 0 && is_high_[static_cast<std::size_t>(cell)];
}

// -1 if it is too far away.
int HighPlaces::cell_of(const Eigen::Vector2f& apart_m) const {
  const int column = kHighSide / 2 + static_cast<int>(std::floor(apart_m.x() / kShape.high_cell_m));
  const int row = kHighSide / 2 + static_cast<int>(std::floor(apart_m.y() / kShape.high_cell_m));
  const bool is_inside = column >= 0 && column < kHighSide && row >= 0 && row < kHighSide;
  return is_inside ? row * kHighSide + column : -1;
}

Shape shape_of(const ObjectView& view, const Skyline& skyline, const HighPlaces& high_places,
               double heading_rad) {
  if (view.points.empty()) {
    return {};
  }
  const Eigen::Vector2d ahead = direction(heading_rad);
  const Eigen::Vector2d sight = (view.points.front().place_m - view.sensor_m).normalized();
  Extent along(ahead);
  Extent across(left_of(ahead));
  Extent width(left_of(sight));
  float top = 0.0F;
  float gap = std::numeric_limits<float>::infinity();
  float range = std::numeric_limits<float>::infinity();
  int high = 0;
  int of_top = 0;
  const ObjectPoint* right = &view.points.front();
  const ObjectPoint* left = right;
  for (const ObjectPoint& point : view.points) {
    const Eigen::Vector2d apart = point.place_m - view.sensor_m;
    along.add(apart);
    across.add(apart);
    width.add(apart);
    top = std::max(top, point.height_m);
    range = std::min(range, point.range_m);
    gap = std::min(gap, point.height_m - skyline.hidden_height_m(point.azimuth_rad, point.range_m));
    right = is_left_of(*right, point) ? &point : right;
    left = is_left_of(point, *left) ? &point : left;
    high += point.height_m > kShape.high_m ? 1 : 0;
    of_top += point.is_of_top ? 1 : 0;
  }
  const bool is_long = along.length() > across.length();
  const Eigen::Vector2d middle_m =
      view.sensor_m + along.middle() * ahead + across.middle() * left_of(ahead);
  const double longer = std::max(along.length(), across.length());
  return {.along_m = along.length(),
          .across_m = across.length(),
          .width_m = width.length(),
          .gap_m = std::max(0.0F, gap),
          .is_cut = skyline.is_hidden_beside(right->azimuth_rad, right->range_m, -1) ||
                    skyline.is_hidden_beside(left->azimuth_rad, left->range_m, 1),
          .top_m = top,
          .range_m = range,
          .is_of_wall = std::min(along.length(), across.length()) < kShape.flat_m &&
                        is_of_wall(high_places, middle_m, is_long ? ahead : left_of(ahead), longer),
          .is_top_open = of_top >= kShape.top_min && top > kShape.high_m,
          .high_share = high / static_cast<double>(view.points.size())};
}

Likeness likeness_of(const Shape& shape) {
  const double longer = std::max(shape.along_m, shape.across_m);
  const double shorter = std::min(shape.along_m, shape.across_m);
  const bool stands = shape.gap_m < 0.6;
  if (stands && !shape.is_of_wall && shape.top_m > 1.1 && shape.top_m < 2.5 &&
      shape.high_share < 0.35 && shape.width_m > 1.2 && longer < 6.5 && shorter < 2.8) {
    // It may be higher than seen, and wider than a truck.
    return shape.is_top_open ? Likeness::kVehiclePart : Likeness::kVehicle;
  }
  if (stands && shape.top_m > 1.3 && shape.top_m < 2.1 && shape.width_m > 0.3 &&
      shape.width_m < 1.2 && longer > 0.5 && longer < 2.4) {
    return shape.is_cut ? Likeness::kUnclear : Likeness::kTwoWheeler;
  }
  const bool is_larger = longer > 8.0 || shorter > 3.5;
  const bool is_higher = shape.top_m > 2.5 && shape.high_share > 0.35;
  // Far away returns are far apart, and windows give none.
  const double top_min = std::clamp(1.1 - 0.03 * (shape.range_m - 20.0), 0.8, 1.1);
  const bool is_small = shape.top_m < top_min || (shape.width_m < 0.3 && !shape.is_cut);
  if (shape.is_of_wall || is_larger || is_higher || is_small || !stands) {
    return Likeness::kNeither;
  }
  const bool is_part =
      !shape.is_top_open && shape.top_m < 2.0 && shape.high_share < 0.5 && longer > 1.0;
  return is_part ? Likeness::kVehiclePart : Likeness::kUnclear;
}

}  // namespace ads
