#include "road_borders.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/plane.h"
#include "perception_tuning.h"

namespace ads {
namespace {

constexpr std::size_t kCells = 2 * kRoadBorders.cells_per_side;
constexpr float kNoLevel_m = std::numeric_limits<float>::infinity();

bool is_in(const Standing& box, const Eigen::Vector2d& place_m) {
  const Eigen::Vector2d apart = place_m - box.center_m;
  const Eigen::Vector2d ahead = direction(box.heading_rad);
  return std::abs(apart.dot(ahead)) < 0.5 * box.length_m + kRoadBorders.around_m &&
         std::abs(apart.dot(left_of(ahead))) < 0.5 * box.width_m + kRoadBorders.around_m;
}

double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

BorderFinder::BorderFinder()
    : cells_(kRoadBorders.slices * kCells), level_m_(kRoadBorders.slices) {}

const RoadBorders& BorderFinder::find(std::span<const RawReturn> returns, double mount_height_m,
                                      std::span<const Standing> standing) {
  fill(returns, mount_height_m, standing);
  std::vector<BorderPlace> left;
  std::vector<BorderPlace> right;
  for (std::size_t slice = 0; slice < kRoadBorders.slices; ++slice) {
    walk(slice, 1, left);
    walk(slice, -1, right);
  }
  borders_.left = smooth(left);
  borders_.right = smooth(right);
  return borders_;
}

void BorderFinder::fill(std::span<const RawReturn> returns, double mount_height_m,
                        std::span<const Standing> standing) {
  std::fill(cells_.begin(), cells_.end(), Cell{.lowest_m = kNoLevel_m, .highest_m = -kNoLevel_m});
  std::fill(level_m_.begin(), level_m_.end(), kNoLevel_m);
  for (const RawReturn& beam_return : returns) {
    const float along = (beam_return.x_m - kRoadBorders.behind_m) / kRoadBorders.slice_m;
    const float across =
        beam_return.y_m / kRoadBorders.cell_m + static_cast<float>(kRoadBorders.cells_per_side);
    const float height = beam_return.z_m + static_cast<float>(mount_height_m);
    if (!(along >= 0.0F && along < static_cast<float>(kRoadBorders.slices)) ||
        !(across >= 0.0F && across < static_cast<float>(kCells)) || height > kRoadBorders.high_m) {
      continue;
    }
    const Eigen::Vector2d place_m(beam_return.x_m, beam_return.y_m);
    if (height > kRoadBorders.step_m &&
        std::ranges::any_of(standing, [&](const Standing& box) { return is_in(box, place_m); })) {
      continue;
    }
    const auto slice = static_cast<std::size_t>(along);
    Cell& cell = cells_[slice * kCells + static_cast<std::size_t>(across)];
    cell.lowest_m = std::min(cell.lowest_m, height);
    cell.highest_m = std::max(cell.highest_m, height);
    if (std::abs(beam_return.y_m) < kRoadBorders.middle_m) {
      level_m_[slice] = std::min(level_m_[slice], height);
    }
  }
  // Under the vehicle nothing is seen: the road goes on from the slice before.
  float last = 0.0F;
  for (std::size_t slice = 0; slice < kRoadBorders.slices; ++slice) {
    const bool is_plausible =
        std::abs(level_m_[slice] - last) <
        kRoadBorders.step_m + 2.0F * kRoadBorders.slope * kRoadBorders.slice_m;
    last = is_plausible ? level_m_[slice] : last;
    level_m_[slice] = last;
  }
}

// Outwards from the middle, until the road ends.
void BorderFinder::walk(std::size_t slice, int side, std::vector<BorderPlace>& found) const {
  const float middle =
      kRoadBorders.behind_m + (static_cast<float>(slice) + 0.5F) * kRoadBorders.slice_m;
  float level = level_m_[slice];
  float last = 0.0F;
  for (int step = 0; step < kRoadBorders.cells_per_side; ++step) {
    const int column = kRoadBorders.cells_per_side + (side > 0 ? step : -1 - step);
    const Cell& cell = cells_[slice * kCells + static_cast<std::size_t>(column)];
    const float away = (static_cast<float>(step) + 0.5F) * kRoadBorders.cell_m;
    if (cell.lowest_m == kNoLevel_m) {
      continue;
    }
    const float apart = away - last;
    if (apart > kRoadBorders.gap_m && last > 0.0F) {
      return;  // Occluded: the area between is unknown.
    }
    const float rise = std::abs(cell.lowest_m - level);
    const bool is_road = rise < kRoadBorders.step_m + kRoadBorders.slope * apart &&
                         cell.highest_m - cell.lowest_m < kRoadBorders.step_m;
    if (!is_road && away > kRoadBorders.middle_m) {
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
      if (std::abs(other.place_m.x() - x_m) <
          (kRoadBorders.neighbours + 0.5) * kRoadBorders.slice_m) {
        around.push_back(other.place_m.y());
      }
    }
    const double median = median_of(around);
    for (double& value : around) {
      value = std::abs(value - median);
    }
    const auto agreeing = static_cast<std::size_t>(
        std::ranges::count_if(around, [](double off) { return off < kRoadBorders.away_m; }));
    if (agreeing < kRoadBorders.agreeing || 2 * agreeing <= around.size() ||
        std::abs(found[index].place_m.y() - median) > kRoadBorders.away_m) {
      continue;
    }
    const double scatter = 1.48 * median_of(around);
    border.push_back({.place_m = found[index].place_m,
                      .stddev_m = std::hypot(kRoadBorders.resolution_m, scatter)});
  }
  return border.size() < kRoadBorders.places_min ? std::vector<BorderPlace>() : border;
}

}  // namespace ads
