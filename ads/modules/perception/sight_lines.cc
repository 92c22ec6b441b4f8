#include "sight_lines.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "common/plane.h"
#include "perception_tuning.h"

namespace ads {
namespace {

constexpr double kSightBin_rad = 2.0 * std::numbers::pi / kSightLines.bins;

std::size_t bin_of(double azimuth_rad) {
  const auto bin = static_cast<int>(std::floor(azimuth_rad / kSightBin_rad));
  return static_cast<std::size_t>(((bin % kSightLines.bins) + kSightLines.bins) % kSightLines.bins);
}

}  // namespace

SightLines::SightLines() : begin_(kSightLines.bins + 1) {}

void SightLines::fill(std::span<const SightLine> lines) {
  std::fill(begin_.begin(), begin_.end(), 0U);
  for (const SightLine& line : lines) {
    ++begin_[bin_of(line.azimuth_rad) + 1];
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  lines_.resize(lines.size());
  for (const SightLine& line : lines) {
    lines_[begin_[bin_of(line.azimuth_rad)]++] = {.range_m = line.range_m,
                                                  .slope = line.z_m / std::max(line.range_m, 0.1F)};
  }
  // Each begin has moved to its end.
  std::shift_right(begin_.begin(), begin_.end(), 1);
  begin_[0] = 0;
}

double SightLines::share_through(const ObjectView& view, const GroundBox& box) const {
  const int beyond = through(view, box);
  if (beyond < kSightLines.through_min) {
    return 0.0;
  }
  const Eigen::Vector2d ahead = direction(box.heading_rad);
  const auto within = std::ranges::count_if(view.points, [&](const ObjectPoint& point) {
    const Eigen::Vector2d apart = point.place_m - box.center_m;
    return point.height_m > kSightLines.low_m && point.height_m < kSightLines.high_m &&
           std::abs(apart.dot(ahead)) < 0.5 * box.length_m + kSightLines.around_m &&
           std::abs(apart.dot(left_of(ahead))) < 0.5 * box.width_m + kSightLines.around_m;
  });
  return beyond / static_cast<double>(beyond + within);
}

bool SightLines::is_seen_through(const ObjectView& view, const GroundBox& box,
                                 const Eigen::Vector2d& likely_size_m) const {
  if (share_through(view, box) < kSightLines.share_max) {
    return false;
  }
  for (const double turn : {0.0, 0.5 * std::numbers::pi}) {
    const Eigen::Vector2d ahead = direction(box.heading_rad + turn);
    Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
    Eigen::Array2d high = -low;
    for (const ObjectPoint& point : view.points) {
      const Eigen::Vector2d apart = point.place_m - box.center_m;
      const Eigen::Array2d place(apart.dot(ahead), apart.dot(left_of(ahead)));
      low = low.min(place);
      high = high.max(place);
    }
    const Eigen::Array2d size = (high - low).max(likely_size_m.array());
    if (size.y() > kSightLines.widest_m) {
      continue;
    }
    for (const double along : {0.0, 1.0, -1.0}) {
      for (const double across : {0.0, 1.0, -1.0}) {
        const Eigen::Array2d middle =
            0.5 * (low + high) + 0.5 * (size - (high - low)) * Eigen::Array2d(along, across);
        if (share_through(
                view, {.center_m = box.center_m + middle.x() * ahead + middle.y() * left_of(ahead),
                       .heading_rad = box.heading_rad + turn,
                       .length_m = size.x(),
                       .width_m = size.y()}) < kSightLines.share_max) {
          return false;
        }
      }
    }
  }
  return true;
}

// How many lines enter the box at the height of a car's body, and end beyond it.
int SightLines::through(const ObjectView& view, const GroundBox& box) const {
  const Eigen::Vector2d ahead = direction(box.heading_rad);
  const Eigen::Vector2d left = left_of(ahead);
  const Eigen::Vector2d away = box.center_m - view.sensor_m;
  const Eigen::Array2d half(std::max(0.1, 0.5 * box.length_m - kSightLines.edge_m),
                            std::max(0.1, 0.5 * box.width_m - kSightLines.edge_m));
  const Eigen::Array2d sensor(-away.dot(ahead), -away.dot(left));
  if ((sensor.abs() < half).all()) {
    return 0;
  }
  const double middle = std::atan2(away.y(), away.x()) - view.sensor_heading_rad;
  const double reach = std::atan2(half.matrix().norm(), away.norm());
  const int bins = std::min(kSightLines.bins / 2, static_cast<int>(reach / kSightBin_rad) + 1);
  float ground = 0.0F;
  for (const ObjectPoint& point : view.points) {
    ground += point.ground_m / static_cast<float>(view.points.size());
  }
  int count = 0;
  for (int step = -bins; step <= bins; ++step) {
    const std::size_t bin = bin_of(middle + step * kSightBin_rad);
    const Eigen::Vector2d sight =
        direction(view.sensor_heading_rad + (static_cast<double>(bin) + 0.5) * kSightBin_rad);
    const Eigen::Array2d along(sight.dot(ahead), sight.dot(left));
    // Where the line enters the box and leaves it.
    const Eigen::Array2d one = (-half - sensor) / along;
    const Eigen::Array2d other = (half - sensor) / along;
    const auto enters = static_cast<float>(one.min(other).maxCoeff());
    const auto leaves = static_cast<float>(one.max(other).minCoeff());
    if (!(enters < leaves) || enters < 0.0F) {
      continue;
    }
    for (std::size_t index = begin_[bin]; index < begin_[bin + 1]; ++index) {
      const Line& line = lines_[index];
      const float height = line.slope * enters - ground;
      if (line.range_m > leaves && height > kSightLines.low_m && height < kSightLines.high_m &&
          line.slope * leaves - ground > kSightLines.ground_m) {
        ++count;
      }
    }
  }
  return count;
}

}  // namespace ads
