#include "shape.h"

#include <algorithm>
#include <limits>

#include "common/plane.h"

namespace ads {
namespace {

constexpr float kHigh_m = 1.7F;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// How far points reach in one direction.
class Extent {
 public:
  explicit Extent(const Eigen::Vector2d& along) : along_(along) {}
  void add(const Eigen::Vector2d& apart_m) {
    const double place = along_.dot(apart_m);
    low_ = std::min(low_, place);
    high_ = std::max(high_, place);
  }
  [[nodiscard]] double length() const { return std::max(0.0, high_ - low_); }

 private:
  Eigen::Vector2d along_;
  double low_ = kInfinity;
  double high_ = -kInfinity;
};

}  // namespace

Shape shape_of(const ObjectView& view, double heading_rad) {
  if (view.points.empty()) {
    return {};
  }
  const Eigen::Vector2d ahead = direction(heading_rad);
  const Eigen::Vector2d sight = (view.points.front().place_m - view.sensor_m).normalized();
  Extent along(ahead);
  Extent across(left_of(ahead));
  Extent width(left_of(sight));
  float top = 0.0F;
  float bottom = std::numeric_limits<float>::infinity();
  int high = 0;
  for (const ObjectPoint& point : view.points) {
    const Eigen::Vector2d apart = point.place_m - view.sensor_m;
    along.add(apart);
    across.add(apart);
    width.add(apart);
    top = std::max(top, point.height_m);
    bottom = std::min(bottom, point.height_m);
    high += point.height_m > kHigh_m ? 1 : 0;
  }
  return {.along_m = along.length(),
          .across_m = across.length(),
          .width_m = width.length(),
          .bottom_m = bottom,
          .top_m = top,
          .high_share = high / static_cast<double>(view.points.size())};
}

Likeness likeness_of(const Shape& shape) {
  const double longer = std::max(shape.along_m, shape.across_m);
  const double shorter = std::min(shape.along_m, shape.across_m);
  const bool stands = shape.bottom_m < 0.6;
  if (stands && shape.top_m > 1.1 && shape.top_m < 2.5 && shape.high_share < 0.35 &&
      shape.width_m > 1.2 && longer < 6.5 && shorter < 2.8) {
    return Likeness::kVehicle;
  }
  if (stands && shape.top_m > 1.3 && shape.top_m < 2.1 && shape.width_m > 0.3 &&
      shape.width_m < 1.2 && longer > 0.5 && longer < 2.4) {
    return Likeness::kTwoWheeler;
  }
  const bool is_larger = longer > 8.0 || shorter > 3.5;
  const bool is_higher = shape.top_m > 2.5 && shape.high_share > 0.35;
  const bool is_small = shape.top_m < 1.1 || shape.width_m < 0.3;
  return is_larger || is_higher || is_small || !stands ? Likeness::kNeither : Likeness::kUnclear;
}

}  // namespace ads
