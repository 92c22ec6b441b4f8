#include "skyline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "perception_tuning.h"

namespace ads {
namespace {

constexpr double kBin_rad = 2.0 * std::numbers::pi / kSkyline.bins;

}  // namespace

Skyline::Skyline() : nearest_m_(kSkyline.bins), begin_(kSkyline.bins + 1) {}

void Skyline::fill(std::span<const LidarReturn> returns, double sensor_height_m) {
  sensor_height_m_ = static_cast<float>(sensor_height_m);
  std::fill(nearest_m_.begin(), nearest_m_.end(), std::numeric_limits<float>::infinity());
  std::fill(begin_.begin(), begin_.end(), 0U);
  for (const LidarReturn& beam_return : returns) {
    const std::size_t bin = bin_of(beam_return.azimuth_rad);
    nearest_m_[bin] = std::min(nearest_m_[bin], beam_return.range_m);
    ++begin_[bin + 1];
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  sights_.resize(returns.size());
  for (const LidarReturn& beam_return : returns) {
    sights_[begin_[bin_of(beam_return.azimuth_rad)]++] = {
        .range_m = beam_return.range_m,
        .slope = (beam_return.height_m - sensor_height_m_) / std::max(beam_return.range_m, 0.1F)};
  }
  // Each begin has moved to its end.
  std::shift_right(begin_.begin(), begin_.end(), 1);
  begin_[0] = 0;
}

bool Skyline::is_hidden_beside(float azimuth_rad, float range_m, int side) const {
  for (int step = 1; step <= kSkyline.beside; ++step) {
    if (nearest_m_[bin_of(azimuth_rad + side * step * kBin_rad)] < range_m - kSkyline.nearer_m) {
      return true;
    }
  }
  return false;
}

double Skyline::hidden_share(double azimuth_rad, double half_width_rad, double range_m) const {
  const int reach = static_cast<int>(half_width_rad / kBin_rad);
  int hidden = 0;
  for (int step = -reach; step <= reach; ++step) {
    hidden +=
        nearest_m_[bin_of(azimuth_rad + step * kBin_rad)] < range_m - kSkyline.nearer_m ? 1 : 0;
  }
  return static_cast<double>(hidden) / (2 * reach + 1);
}

float Skyline::hidden_height_m(float azimuth_rad, float range_m) const {
  const std::size_t bin = bin_of(azimuth_rad);
  float height = 0.0F;
  for (std::size_t index = begin_[bin]; index < begin_[bin + 1]; ++index) {
    if (sights_[index].range_m < range_m - static_cast<float>(kSkyline.before_m)) {
      height = std::max(height, sensor_height_m_ + sights_[index].slope * range_m);
    }
  }
  return height;
}

std::size_t Skyline::bin_of(double azimuth_rad) const {
  const auto bin = static_cast<int>(std::floor(azimuth_rad / kBin_rad));
  return static_cast<std::size_t>(((bin % kSkyline.bins) + kSkyline.bins) % kSkyline.bins);
}

}  // namespace ads
