#include "encoder.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <vector>

#include <Eigen/Core>

namespace ads::velodyne {
namespace {

constexpr std::size_t kPointBytes = 16;
constexpr std::int64_t kHour_us = 3'600'000'000;
constexpr double kDegPerRad = 180.0 / std::numbers::pi;

struct LidarReturn {
  Eigen::Vector3f place_m;
  std::uint8_t intensity;
};

LidarReturn return_at(const lidar::Sweep& sweep, std::size_t index) {
  LidarReturn beam_return{.place_m = {}, .intensity = 0};
  const char* const at = sweep.points().data() + kPointBytes * index;
  std::memcpy(beam_return.place_m.data(), at, 12);
  std::memcpy(&beam_return.intensity, at + 15, 1);
  return beam_return;
}

// Where the first column looks, clockwise from ahead: the mean over all returns.
double first_azimuth_rad(const lidar::Sweep& sweep) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  const std::size_t rings = sweep.rings();
  for (std::size_t index = 0; index < sweep.columns() * rings; ++index) {
    const Eigen::Vector3f place_m = return_at(sweep, index).place_m;
    if (!place_m.isZero(0.0F) && place_m.allFinite()) {
      const double turned =
          2.0 * std::numbers::pi * static_cast<double>(index / rings) / sweep.columns();
      const double its = -std::atan2(place_m.y(), place_m.x()) - turned;
      sum += Eigen::Vector2d(std::cos(its), std::sin(its));
    }
  }
  return std::atan2(sum.y(), sum.x());
}

}  // namespace

void PacketEncoder::add(double azimuth_deg, std::int64_t time_us, std::span<const Return> returns) {
  const auto units = std::llround(azimuth_deg * 100.0) % kAzimuthUnits;
  const auto azimuth = static_cast<std::uint16_t>(units < 0 ? units + kAzimuthUnits : units);
  if (firings_ == 0) {
    packet_.since_hour_us = static_cast<std::uint32_t>(time_us % kHour_us);
  }
  if (model_.kind == ModelKind::kVlp16) {
    add_vlp16(azimuth, returns);
  } else {
    add_hdl64(azimuth, returns);
  }
  if (++firings_ == model_.firings) {
    firings_ = 0;
    sink_(encode_packet(packet_), (time_us * 1000) + model_.firing_ns);
  }
}

void PacketEncoder::add_vlp16(std::uint16_t azimuth, std::span<const Return> returns) {
  Block& block = packet_.blocks[firings_ / 2];
  block.flag = BlockFlag::kLasers0To31;
  if (firings_ % 2 == 0) {
    block.azimuth = azimuth;
  }
  const std::size_t half = kReturnsPerBlock / 2;
  std::ranges::copy(returns.first(half),
                    block.returns.begin() + static_cast<std::ptrdiff_t>(firings_ % 2 * half));
  packet_.factory = {static_cast<std::uint8_t>(ReturnMode::kStrongest), kProductVlp16};
}

void PacketEncoder::add_hdl64(std::uint16_t azimuth, std::span<const Return> returns) {
  for (std::size_t half = 0; half < 2; ++half) {
    Block& block = packet_.blocks[2 * firings_ + half];
    block.flag = half == 0 ? BlockFlag::kLasers0To31 : BlockFlag::kLasers32To63;
    block.azimuth = azimuth;
    std::ranges::copy(returns.subspan(half * kReturnsPerBlock, kReturnsPerBlock),
                      block.returns.begin());
  }
}

void PacketEncoder::add(const lidar::Sweep& sweep, std::int64_t time_us) {
  const std::size_t rings = model_.lasers.size();
  if (sweep.rings() != rings ||
      sweep.points().size() != kPointBytes * rings * std::size_t{sweep.columns()}) {
    return;  // A sweep that was spoiled on purpose: the sensor sends nothing.
  }
  const double first_deg = first_azimuth_rad(sweep) * kDegPerRad;
  std::vector<Return> returns(rings);
  for (std::size_t column = 0; column < sweep.columns(); ++column) {
    for (std::size_t index = 0; index < rings; ++index) {
      const Laser& laser = model_.lasers[index];
      const LidarReturn beam_return = return_at(sweep, column * rings + laser.ring);
      returns[index] = {};
      if (!beam_return.place_m.isZero(0.0F) && beam_return.place_m.allFinite()) {
        const Eigen::Vector3d from_laser_m =
            beam_return.place_m.cast<double>() - Eigen::Vector3d(0.0, 0.0, laser.height_m);
        const double units = (from_laser_m.norm() - laser.distance_m) / kMetresPerUnit;
        returns[index] = {
            .distance = static_cast<std::uint16_t>(std::clamp(std::round(units), 0.0, 65'535.0)),
            .intensity = beam_return.intensity};
      }
    }
    const double share = static_cast<double>(column) / sweep.columns();
    const double since_us = share * static_cast<double>(sweep.duration_ns()) * 1e-3;
    add(first_deg + 360.0 * share, time_us + std::llround(since_us), returns);
  }
}

}  // namespace ads::velodyne
