#include "skyline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace ads {
namespace {

constexpr int kBins = 1440;
constexpr double kBin_rad = 2.0 * std::numbers::pi / kBins;
// What is nearer by less may be the same object.
constexpr double kNearer_m = 0.4;
constexpr int kBeside = 3;

}  // namespace

Skyline::Skyline() : nearest_m_(kBins) {}

void Skyline::fill(std::span<const Echo> echoes) {
  std::fill(nearest_m_.begin(), nearest_m_.end(), std::numeric_limits<float>::infinity());
  for (const Echo& echo : echoes) {
    float& nearest = nearest_m_[bin_of(echo.azimuth_rad)];
    nearest = std::min(nearest, echo.range_m);
  }
}

bool Skyline::is_hidden_beside(float azimuth_rad, float range_m, int side) const {
  for (int step = 1; step <= kBeside; ++step) {
    if (nearest_m_[bin_of(azimuth_rad + side * step * kBin_rad)] < range_m - kNearer_m) {
      return true;
    }
  }
  return false;
}

double Skyline::hidden_share(double azimuth_rad, double half_width_rad, double range_m) const {
  const int reach = static_cast<int>(half_width_rad / kBin_rad);
  int hidden = 0;
  for (int step = -reach; step <= reach; ++step) {
    hidden += nearest_m_[bin_of(azimuth_rad + step * kBin_rad)] < range_m - kNearer_m ? 1 : 0;
  }
  return static_cast<double>(hidden) / (2 * reach + 1);
}

std::size_t Skyline::bin_of(double azimuth_rad) const {
  const auto bin = static_cast<int>(std::floor(azimuth_rad / kBin_rad));
  return static_cast<std::size_t>(((bin % kBins) + kBins) % kBins);
}

}  // namespace ads
