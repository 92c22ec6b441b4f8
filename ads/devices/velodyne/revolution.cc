#include "revolution.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <utility>

namespace ads::velodyne {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr std::size_t kPointBytes = 16;
constexpr std::int64_t kHour_us = 3'600'000'000;
constexpr std::int64_t kHour_ns = kHour_us * 1000;
constexpr std::int64_t kSecond_ns = 1'000'000'000;
// Both sensors turn 300 to 1200 times a minute: a revolution takes 50 to 200 ms.
constexpr std::int64_t kRevolutionMax_ns = 250'000'000;
constexpr std::int64_t kGapMax_ns = 25'000'000;
// From one block to the next a VLP-16 turns by 0.8 degrees at most.
constexpr double kBlockStepMax_deg = 5.0;
constexpr std::size_t kVlp16Lasers = 16;

double turned_deg(double from_deg, double to_deg) {
  const double turns = (to_deg - from_deg) / 360.0;
  return 360.0 * (turns - std::floor(turns));
}

double azimuth_deg(const Block& block) {
  return 0.01 * block.azimuth;
}

}  // namespace

void RevolutionDecoder::Turn::clear() {
  columns_ns.clear();
  points.clear();
  offset_ns = std::numeric_limits<std::int64_t>::max();
}

RevolutionDecoder::RevolutionDecoder(Model model, const RevolutionConfig& config)
    : model_(std::move(model)), config_(config) {}

std::optional<PacketFault> RevolutionDecoder::check(const Packet& packet) const {
  if (model_.kind == ModelKind::kVlp16) {
    const auto mode = static_cast<ReturnMode>(packet.factory[0]);
    if (packet.factory[1] != kProductVlp16) {
      return PacketFault::kModel;
    }
    if (mode != ReturnMode::kStrongest && mode != ReturnMode::kLast && mode != ReturnMode::kDual) {
      return PacketFault::kReturnMode;
    }
  }
  for (std::size_t index = 0; index < kBlocks; ++index) {
    const bool is_second = model_.kind == ModelKind::kHdl64 && index % 2 == 1;
    const BlockFlag expected = is_second ? BlockFlag::kLasers32To63 : BlockFlag::kLasers0To31;
    if (packet.blocks[index].flag != expected) {
      return PacketFault::kModel;
    }
  }
  return std::nullopt;
}

std::size_t RevolutionDecoder::firings_of(const Packet& packet) const {
  if (model_.kind == ModelKind::kVlp16) {
    const bool is_dual = static_cast<ReturnMode>(packet.factory[0]) == ReturnMode::kDual;
    return is_dual ? model_.firings / 2 : model_.firings;
  }
  // An HDL-64E packet does not contain its mode; the azimuth is unchanged between two returns.
  std::size_t firings = 1;
  for (std::size_t index = 2; index < kBlocks; index += 2) {
    firings += packet.blocks[index].azimuth != packet.blocks[index - 2].azimuth ? 1 : 0;
  }
  return firings;
}

bool RevolutionDecoder::take(std::span<const std::uint8_t> payload, std::int64_t arrival_ns) {
  fault_ = parse_packet(payload, packet_);
  if (!fault_) {
    fault_ = check(packet_);
  }
  if (fault_) {
    ++counts_.faults[static_cast<std::size_t>(*fault_)];
    return false;
  }
  ++counts_.packets;
  follow_clock(arrival_ns, static_cast<std::int64_t>(firings_of(packet_)) * model_.firing_ns);
  return model_.kind == ModelKind::kVlp16 ? take_vlp16() : take_hdl64();
}

// The sensor's clock wraps each hour; `sensor_ns_` does not.
void RevolutionDecoder::follow_clock(std::int64_t arrival_ns, std::int64_t span_ns) {
  if (last_us_) {
    std::int64_t passed_us = std::int64_t{packet_.since_hour_us} - *last_us_;
    if (passed_us < -kHour_us / 2) {
      passed_us += kHour_us;
    }
    if (passed_us < 0) {
      ++counts_.clock_steps;
      give_up_turn();
      passed_us = 0;
    }
    const std::int64_t passed_ns = 1000 * passed_us;
    if (passed_ns > kGapMax_ns) {
      give_up_turn();
    }
    if (passed_ns < kSecond_ns && last_span_ns_ > 0) {
      const auto packets = (passed_ns + last_span_ns_ / 2) / last_span_ns_;
      counts_.packets_lost += std::max<std::int64_t>(0, packets - 1);
    }
    sensor_ns_ += passed_ns;
  }
  last_us_ = packet_.since_hour_us;
  last_span_ns_ = span_ns;
  if (config_.clock == ClockSource::kArrival) {
    // A packet is sent after the returns of its last firing.
    offset_ns_ = arrival_ns - sensor_ns_ - span_ns;
    return;
  }
  const std::int64_t since_hour_ns = 1000 * std::int64_t{packet_.since_hour_us};
  const std::int64_t hours = (arrival_ns - since_hour_ns + kHour_ns / 2) / kHour_ns;
  offset_ns_ = hours * kHour_ns + since_hour_ns - sensor_ns_;
}

void RevolutionDecoder::give_up_turn() {
  if (std::exchange(is_turning_, false)) {
    ++counts_.incomplete;
  }
  turn_.clear();
  since_cut_deg_.reset();
}

// Of each laser the one of both returns that is asked for. Which of them comes first depends on
// the model, and on whether the last one is the strongest too.
void RevolutionDecoder::merge(std::span<const Return> from, std::span<Return> into) const {
  for (std::size_t index = 0; index < from.size(); ++index) {
    const Return& other = from[index];
    Return& its = into[index];
    const bool is_better =
        other.distance != 0 && (its.distance == 0 || (config_.dual_return == DualReturn::kStrongest
                                                          ? other.intensity > its.intensity
                                                          : other.distance > its.distance));
    if (is_better) {
      its = other;
    }
  }
}

// Each block has two firings of the 16 lasers, and the azimuth of the first.
bool RevolutionDecoder::take_vlp16() {
  const bool is_dual = static_cast<ReturnMode>(packet_.factory[0]) == ReturnMode::kDual;
  const std::size_t stride = is_dual ? 2 : 1;
  bool has_ended = false;
  std::int64_t time_ns = sensor_ns_;
  for (std::size_t index = 0; index < kBlocks; index += stride) {
    const Block& block = packet_.blocks[index];
    if (index + stride < kBlocks) {
      const double step_deg =
          turned_deg(azimuth_deg(block), azimuth_deg(packet_.blocks[index + stride]));
      step_deg_ = step_deg <= kBlockStepMax_deg ? 0.5 * step_deg : step_deg_;
    }
    for (std::size_t half = 0; half < 2; ++half) {
      Column column{.returns = {},
                    .azimuth_deg = azimuth_deg(block) + static_cast<double>(half) * step_deg_,
                    .step_deg = step_deg_,
                    .time_ns = time_ns};
      const std::size_t first = half * kVlp16Lasers;
      const std::span returns = std::span(column.returns).first(kVlp16Lasers);
      merge(std::span(block.returns).subspan(first, kVlp16Lasers), returns);
      if (is_dual) {
        merge(std::span(packet_.blocks[index + 1].returns).subspan(first, kVlp16Lasers), returns);
      }
      has_ended = add(column) || has_ended;
      time_ns += model_.firing_ns;
    }
  }
  return has_ended;
}

// Each pair of blocks has one firing of the 64 lasers, or the other return of the one before.
bool RevolutionDecoder::take_hdl64() {
  bool has_ended = false;
  std::int64_t time_ns = sensor_ns_;
  std::size_t index = 0;
  while (index < kBlocks) {
    Column column{.returns = {},
                  .azimuth_deg = azimuth_deg(packet_.blocks[index]),
                  .step_deg = 0.0,
                  .time_ns = time_ns};
    const std::uint16_t azimuth = packet_.blocks[index].azimuth;
    for (; index < kBlocks && packet_.blocks[index].azimuth == azimuth; index += 2) {
      const std::span returns = column.returns;
      merge(packet_.blocks[index].returns, returns.first(kReturnsPerBlock));
      merge(packet_.blocks[index + 1].returns, returns.last(kReturnsPerBlock));
    }
    has_ended = add(column) || has_ended;
    time_ns += model_.firing_ns;
  }
  return has_ended;
}

bool RevolutionDecoder::passes_cut(double azimuth_deg) {
  const double since_deg = turned_deg(config_.cut_azimuth_deg, azimuth_deg);
  const double before_deg = since_cut_deg_.value_or(since_deg);
  if (since_deg > before_deg + 180.0) {
    return false;  // The azimuth jitters at the cut, and has moved back a little.
  }
  since_cut_deg_ = since_deg;
  return since_deg + 180.0 < before_deg;
}

bool RevolutionDecoder::add(const Column& column) {
  bool has_ended = false;
  if (passes_cut(column.azimuth_deg)) {
    if (is_turning_) {
      std::swap(ended_, turn_);
      ended_.end_ns = column.time_ns;
      ++counts_.revolutions;
      has_ended = true;
    }
    turn_.clear();
    is_turning_ = true;
  }
  if (!is_turning_) {
    return has_ended;
  }
  if (!turn_.columns_ns.empty() && column.time_ns - turn_.columns_ns.front() > kRevolutionMax_ns) {
    give_up_turn();
    return has_ended;
  }
  place(column);
  return has_ended;
}

void RevolutionDecoder::place(const Column& column) {
  const std::size_t lasers = model_.lasers.size();
  const std::size_t first = turn_.points.size();
  turn_.columns_ns.push_back(column.time_ns);
  turn_.offset_ns = std::min(turn_.offset_ns, offset_ns_);
  turn_.points.resize(first + lasers);
  for (std::size_t index = 0; index < lasers; ++index) {
    const Laser& laser = model_.lasers[index];
    const double since_firing =
        static_cast<double>(laser.delay_ns) / static_cast<double>(model_.firing_ns);
    const double azimuth_rad =
        (column.azimuth_deg + column.step_deg * since_firing) * kRadPerDeg - laser.azimuth_rad;
    turn_.points[first + laser.ring] = point_of(laser, column.returns[index], azimuth_rad);
  }
}

// The formulas of the HDL-64E S3 User's Manual; without corrections they are those of
// the VLP-16 User Manual. The azimuth goes clockwise from ahead.
RevolutionDecoder::Point RevolutionDecoder::point_of(const Laser& laser, const Return& measured,
                                                     double azimuth_rad) const {
  const double range_m = measured.distance * kMetresPerUnit + laser.distance_m;
  if (measured.distance == 0 || !(range_m >= config_.range_min_m) ||
      !(range_m <= config_.range_max_m)) {
    return {};
  }
  const double up = std::sin(laser.elevation_rad);
  const double flat = std::cos(laser.elevation_rad);
  const double flat_m = range_m * flat - laser.vertical_m * up;
  const double sine = std::sin(azimuth_rad);
  const double cosine = std::cos(azimuth_rad);
  const Eigen::Vector3d place_m(flat_m * cosine + laser.horizontal_m * sine,
                                laser.horizontal_m * cosine - flat_m * sine,
                                range_m * up + laser.vertical_m * flat + laser.height_m);
  return {.place_m = config_.rotation * place_m.cast<float>(), .intensity = measured.intensity};
}

void RevolutionDecoder::write(lidar::Sweep& sweep) const {
  const std::size_t rings = model_.lasers.size();
  const std::size_t columns = ended_.columns_ns.size();
  const std::int64_t begin_ns = ended_.columns_ns.front();
  const std::int64_t duration_ns = std::max<std::int64_t>(1, ended_.end_ns - begin_ns);
  sweep.mutable_header()->set_taken_ns(begin_ns + ended_.offset_ns);
  sweep.mutable_header()->set_frame("lidar");
  sweep.set_duration_ns(duration_ns);
  sweep.set_columns(static_cast<std::uint32_t>(columns));
  sweep.set_rings(static_cast<std::uint32_t>(rings));
  std::vector<std::int64_t> delays_ns(rings);
  for (const Laser& laser : model_.lasers) {
    delays_ns[laser.ring] = laser.delay_ns;
  }
  std::string& bytes = *sweep.mutable_points();
  bytes.resize(ended_.points.size() * kPointBytes);
  char* at = bytes.data();
  for (std::size_t index = 0; index < ended_.points.size(); ++index) {
    const Point& point = ended_.points[index];
    const std::size_t its_ring = index % rings;
    const std::int64_t since_ns = ended_.columns_ns[index / rings] + delays_ns[its_ring] - begin_ns;
    const auto time = static_cast<std::uint16_t>(
        std::clamp<std::int64_t>(since_ns * 65'536 / duration_ns, 0, 65'535));
    const auto ring = static_cast<std::uint8_t>(its_ring);
    std::memcpy(at, point.place_m.data(), 12);
    std::memcpy(at + 12, &time, 2);
    std::memcpy(at + 14, &ring, 1);
    std::memcpy(at + 15, &point.intensity, 1);
    at += kPointBytes;
  }
}

}  // namespace ads::velodyne
