#include "ground.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "perception_tuning.h"

namespace ads {
namespace {

constexpr float kNoReturn_m = std::numeric_limits<float>::infinity();

}  // namespace

Ground::Ground(const GroundConfig& config)
    : config_(config),
      bins_per_sector_(static_cast<std::size_t>(config.range_max_m / kGround.bin_m) + 1),
      bins_(kGround.sectors * bins_per_sector_),
      ground_z_m_(bins_.size()) {}

void Ground::fit(std::span<const RawReturn> returns, double mount_height_m) {
  std::fill(bins_.begin(), bins_.end(), Bin{.lowest_z_m = kNoReturn_m, .range_m = 0.0F});
  for (const RawReturn& beam_return : returns) {
    Bin& bin = bins_[sector_of(beam_return) * bins_per_sector_ + bin_of(beam_return.range_m)];
    if (beam_return.z_m < bin.lowest_z_m) {
      bin = {.lowest_z_m = beam_return.z_m, .range_m = beam_return.range_m};
    }
  }
  for (std::size_t sector = 0; sector < kGround.sectors; ++sector) {
    walk(sector, static_cast<float>(-mount_height_m));
  }
}

float Ground::height_m(const RawReturn& beam_return) const {
  return beam_return.z_m -
         ground_z_m_[sector_of(beam_return) * bins_per_sector_ + bin_of(beam_return.range_m)];
}

// Sectors need not be of one size: a pseudo-angle spares the arc tangent.
std::size_t Ground::sector_of(const RawReturn& beam_return) const {
  const float sum = std::abs(beam_return.x_m) + std::abs(beam_return.y_m) + 1e-6F;
  const float quarter = beam_return.y_m / sum;
  const float turn = beam_return.x_m >= 0.0F ? quarter : 2.0F - quarter;  // In [-1, 3].
  const auto sector = static_cast<std::size_t>((turn + 1.0F) * (0.25F * kGround.sectors));
  return std::min<std::size_t>(sector, kGround.sectors - 1);
}

std::size_t Ground::bin_of(float range_m) const {
  return std::min(static_cast<std::size_t>(range_m / kGround.bin_m), bins_per_sector_ - 1);
}

void Ground::walk(std::size_t sector, float begin_z_m) {
  const std::size_t first = sector * bins_per_sector_;
  float last_range = 0.0F;
  float last_z = begin_z_m;
  float slope = 0.0F;
  std::size_t done = 0;
  for (std::size_t bin = 0; bin < bins_per_sector_; ++bin) {
    const Bin& lowest = bins_[first + bin];
    const float apart = lowest.range_m - last_range;
    const float rise = lowest.lowest_z_m - last_z;
    const bool is_ground = lowest.lowest_z_m < kNoReturn_m &&
                           std::abs(rise) <= static_cast<float>(config_.slope_max) * apart +
                                                 static_cast<float>(config_.step_max_m);
    if (!is_ground) {
      continue;
    }
    slope = rise / std::max(apart, kGround.bin_m);
    for (; done <= bin; ++done) {
      const float middle = (static_cast<float>(done) + 0.5F) * kGround.bin_m;
      ground_z_m_[first + done] = last_z + slope * std::clamp(middle - last_range, 0.0F, apart);
    }
    last_range = lowest.range_m;
    last_z = lowest.lowest_z_m;
  }
  for (; done < bins_per_sector_; ++done) {
    ground_z_m_[first + done] = last_z;
  }
}

}  // namespace ads
