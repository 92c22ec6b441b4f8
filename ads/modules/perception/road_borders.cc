#include "road_borders.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/plane.h"

namespace ads {
namespace {

constexpr float kBehind_m = -10.0F;
constexpr float kSlice_m = 1.0F;
constexpr std::size_t kSlices = 40;
constexpr float kCell_m = 0.2F;
constexpr int kCellsPerSide = 75;
constexpr std::size_t kCells = 2 * kCellsPerSide;
// Of the road: how far it rises across, and what steps are still its own.
constexpr float kSlope = 0.06F;
constexpr float kStep_m = 0.07F;
constexpr float kHigh_m = 1.0F;    // Higher returns hang over the road.
constexpr float kMiddle_m = 1.0F;  // So far to each side the vehicle itself drives.
constexpr float kGap_m = 2.5F;     // Farther than that the road is not followed without a return.
constexpr double kAround_m = 0.4;  // Boxes are known so well.
// Neighbours along the road, to each side, and how many of them have to agree.
constexpr std::size_t kNeighbours = 4;
constexpr std::size_t kAgreeing = 4;
constexpr double kAway_m = 0.5;
constexpr double kResolution_m = 0.06;  // Of a cell, 1 sigma.
constexpr std::size_t kPlacesMin = 5;
constexpr float kNothing = std::numeric_limits<float>::infinity();

bool is_in(const Standing& box, const Eigen::Vector2d& place_m) {
  const Eigen::Vector2d apart = place_m - box.center_m;
  const Eigen::Vector2d ahead = direction(box.heading_rad);
  return std::abs(apart.dot(ahead)) < 0.5 * box.length_m + kAround_m &&
         std::abs(apart.dot(left_of(ahead))) < 0.5 * box.width_m + kAround_m;
}

double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

BorderFinder::BorderFinder() : cells_(kSlices * kCells), level_m_(kSlices) {}

const RoadBorders& BorderFinder::find(std::span<const RawReturn> returns, double mount_height_m,
                                      std::span<const Standing> standing) {
  fill(returns, mount_height_m, standing);
  std::vector<BorderPlace> left;
  std::vector<BorderPlace> right;
  for (std::size_t slice = 0; slice < kSlices; ++slice) {
    walk(slice, 1, left);
    walk(slice, -1, right);
  }
  borders_.left = smooth(left);
  borders_.right = smooth(right);
  return borders_;
}

void BorderFinder::fill(std::span<const RawReturn> returns, double mount_height_m,
                        std::span<const Standing> standing) {
  std::fill(cells_.begin(), cells_.end(), Cell{.lowest_m = kNothing, .highest_m = -kNothing});
  std::fill(level_m_.begin(), level_m_.end(), kNothing);
  for (const RawReturn& beam_return : returns) {
    const float along = (beam_return.x_m - kBehind_m) / kSlice_m;
    const float across = beam_return.y_m / kCell_m + static_cast<float>(kCellsPerSide);
    const float height = beam_return.z_m + static_cast<float>(mount_height_m);
    if (!(along >= 0.0F && along < static_cast<float>(kSlices)) ||
        !(across >= 0.0F && across < static_cast<float>(kCells)) || height > kHigh_m) {
      continue;
    }
    const Eigen::Vector2d place_m(beam_return.x_m, beam_return.y_m);
    if (height > kStep_m &&
        std::ranges::any_of(standing, [&](const Standing& box) { return is_in(box, place_m); })) {
      continue;
    }
    const auto slice = static_cast<std::size_t>(along);
    Cell& cell = cells_[slice * kCells + static_cast<std::size_t>(across)];
    cell.lowest_m = std::min(cell.lowest_m, height);
    cell.highest_m = std::max(cell.highest_m, height);
    if (std::abs(beam_return.y_m) < kMiddle_m) {
      level_m_[slice] = std::min(level_m_[slice], height);
    }
  }
  // Under the vehicle nothing is seen: the road goes on from the slice before.
  float last = 0.0F;
  for (std::size_t slice = 0; slice < kSlices; ++slice) {
    const bool is_plausible = std::abs(level_m_[slice] - last) < kStep_m + 2.0F * kSlope * kSlice_m;
    last = is_plausible ? level_m_[slice] : last;
    level_m_[slice] = last;
  }
}

// Outwards from the middle, until the road ends.
void BorderFinder::walk(std::size_t slice, int side, std::vector<BorderPlace>& found) const {
  const float middle = kBehind_m + (static_cast<float>(slice) + 0.5F) * kSlice_m;
  float level = level_m_[slice];
  float last = 0.0F;
  for (int step = 0; step < kCellsPerSide; ++step) {
    const int column = kCellsPerSide + (side > 0 ? step : -1 - step);
    const Cell& cell = cells_[slice * kCells + static_cast<std::size_t>(column)];
    const float away = (static_cast<float>(step) + 0.5F) * kCell_m;
    if (cell.lowest_m == kNothing) {
      continue;
    }
    const float apart = away - last;
    if (apart > kGap_m && last > 0.0F) {
      return;  // Occluded: the area between is unknown.
    }
    const float rise = std::abs(cell.lowest_m - level);
    const bool is_road =
        rise < kStep_m + kSlope * apart && cell.highest_m - cell.lowest_m < kStep_m;
    if (!is_road && away > kMiddle_m) {
      found.push_back({.place_m = {middle, static_cast<float>(side) * away}});
      return;
    }
    if (is_road) {
      level = cell.lowest_m;
      last = away;
    }
  }
}

std::vector<BorderPlace> BorderFinder::smooth(const std::vector<BorderPlace>& found) {
  std::vector<BorderPlace> border;
  std::vector<double> around;
  for (std::size_t index = 0; index < found.size(); ++index) {
    const double x_m = found[index].place_m.x();
    around.clear();
    for (const BorderPlace& other : found) {
      if (std::abs(other.place_m.x() - x_m) < (kNeighbours + 0.5) * kSlice_m) {
        around.push_back(other.place_m.y());
      }
    }
    const double median = median_of(around);
    for (double& value : around) {
      value = std::abs(value - median);
    }
    const auto agreeing = static_cast<std::size_t>(
        std::ranges::count_if(around, [](double off) { return off < kAway_m; }));
    if (agreeing < kAgreeing || 2 * agreeing <= around.size() ||
        std::abs(found[index].place_m.y() - median) > kAway_m) {
      continue;
    }
    const double scatter = 1.48 * median_of(around);
    border.push_back(
        {.place_m = found[index].place_m, .stddev_m = std::hypot(kResolution_m, scatter)});
  }
  return border.size() < kPlacesMin ? std::vector<BorderPlace>() : border;
}

}  // namespace ads
