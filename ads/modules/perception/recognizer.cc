#include "recognizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "common/plane.h"
#include "perception_tuning.h"

namespace ads {
namespace {

constexpr std::size_t kPointBytes = 16;

struct Point {
  float x_m;
  float y_m;
  float z_m;
  std::uint16_t time;
  std::uint8_t ring;
  std::uint8_t intensity;
};

}  // namespace

Recognizer::Recognizer(const RecognizerConfig& config)
    : config_(config), ground_(config.ground), tracker_(config.tracker) {}

void Recognizer::save(perception::TrackerState& state) const {
  tracker_.save(state);
  state.set_last_sweep_ns(last_ns_);
}

void Recognizer::load(const perception::TrackerState& state) {
  tracker_.load(state);
  last_ns_ = state.last_sweep_ns();
}

SweepResult Recognizer::take(const SweepBytes& sweep, const EgoMotion& ego) {
  SweepResult result;
  borders_ = nullptr;
  result.reason = error_of(sweep, ego);
  if (result.reason.empty()) {
    last_ns_ = sweep.taken_ns;
    read(sweep, result);
    const auto total = result.returns + result.invalid_returns;
    if (result.invalid_returns > config_.invalid_share_max * total) {
      result.reason = fmt::format("{} of {} returns are not finite", result.invalid_returns, total);
    } else if (result.returns < static_cast<std::uint32_t>(config_.returns_min)) {
      result.reason = fmt::format("expected at least {} returns, found {}", config_.returns_min,
                                  result.returns);
    }
  }
  if (result.reason.empty()) {
    find_obstacles(sweep, ego, result);
    tracker_.update(sweep_, ego);
    if (config_.are_borders_sought) {
      find_borders(sweep, ego);
    }
  } else {
    tracker_.coast(sweep.taken_ns + sweep.duration_ns);
  }
  return result;
}

SweepResult Recognizer::pass_over(std::int64_t end_ns, std::string reason) {
  borders_ = nullptr;
  tracker_.coast(end_ns);
  return {.reason = std::move(reason)};
}

std::string Recognizer::error_of(const SweepBytes& sweep, const EgoMotion& ego) const {
  const std::uint64_t expected = std::uint64_t{sweep.columns} * sweep.rings * kPointBytes;
  if (sweep.points.empty()) {
    return "the sweep is empty";
  }
  if (sweep.points.size() != expected) {
    return fmt::format("expected {} bytes of {} x {} points, found {}", expected, sweep.columns,
                       sweep.rings, sweep.points.size());
  }
  if (sweep.duration_ns <= 0 || sweep.duration_ns > 1'000'000'000) {
    return fmt::format("expected a duration of at most 1 s, found {} ns", sweep.duration_ns);
  }
  if (sweep.taken_ns <= last_ns_) {
    return "the sweep is not later than the one before";
  }
  if (!ego.at(sweep.taken_ns) || !ego.at(sweep.taken_ns + sweep.duration_ns)) {
    return "localization/ego says nothing of the time of the sweep";
  }
  return {};
}

void Recognizer::read(const SweepBytes& sweep, SweepResult& result) {
  raw_.clear();
  const auto half_length = static_cast<float>(0.5 * config_.own_length_m);
  const auto half_width = static_cast<float>(0.5 * config_.own_width_m);
  const auto forward = static_cast<float>(sweep.mount_forward_m);
  const auto tick_s = static_cast<float>(static_cast<double>(sweep.duration_ns) * 1e-9 / 65536.0);
  for (std::size_t offset = 0; offset < sweep.points.size(); offset += kPointBytes) {
    Point point;
    std::memcpy(&point, sweep.points.data() + offset, sizeof point);
    if (point.x_m == 0.0F && point.y_m == 0.0F && point.z_m == 0.0F) {
      continue;
    }
    // Finite only if all are; a place beyond any lidar's reach is no place.
    const float size = std::abs(point.x_m) + std::abs(point.y_m) + std::abs(point.z_m);
    if (!(size < 1e4F)) {
      ++result.invalid_returns;
      continue;
    }
    ++result.returns;
    if (std::abs(point.x_m + forward) < half_length && std::abs(point.y_m) < half_width) {
      continue;
    }
    raw_.push_back({.x_m = point.x_m,
                    .y_m = point.y_m,
                    .z_m = point.z_m,
                    .time_s = static_cast<float>(point.time) * tick_s,
                    .range_m = std::sqrt(point.x_m * point.x_m + point.y_m * point.y_m),
                    .is_of_top = point.ring + std::uint32_t{kRecognizer.top_rings} >= sweep.rings});
  }
}

// Possible vehicles are excluded from the borders, whether they stand or drive.
void Recognizer::find_borders(const SweepBytes& sweep, const EgoMotion& ego) {
  const std::int64_t middle_ns = sweep.taken_ns + sweep.duration_ns / 2;
  const auto pose = ego.at(middle_ns);
  const Eigen::Vector2d ahead = direction(pose->heading_rad);
  const Eigen::Vector2d sensor_m = pose->position_m + sweep.mount_forward_m * ahead;
  std::vector<Standing> standing;
  for (const TrackedObject& object : tracker_.objects()) {
    const Track& track = object.track;
    const double passed_s = static_cast<double>(middle_ns - track.time_ns()) * 1e-9;
    const Eigen::Vector2d apart = track.center_m() + passed_s * track.velocity_mps() - sensor_m;
    if (std::max(object.vehicle_likeness, object.two_wheeler_likeness) > 0.0 &&
        apart.norm() < kRecognizer.border_range_m) {
      standing.push_back({.center_m = {apart.dot(ahead), apart.dot(left_of(ahead))},
                          .heading_rad = track.heading_rad() - pose->heading_rad,
                          .length_m = track.length_m(),
                          .width_m = track.width_m()});
    }
  }
  borders_ = &border_finder_.find(raw_, sweep.mount_height_m, standing);
}

// Leaves in `sweep_` what stands on the ground, put into the map.
void Recognizer::find_obstacles(const SweepBytes& sweep, const EgoMotion& ego,
                                SweepResult& result) {
  ground_.fit(raw_, sweep.mount_height_m);
  const double duration_s = static_cast<double>(sweep.duration_ns) * 1e-9;
  sweep_.begin_ns = sweep.taken_ns;
  sweep_.duration_ns = sweep.duration_ns;
  sweep_.origin_m = ego.at(sweep.taken_ns)->position_m;
  sweep_.mount_forward_m = sweep.mount_forward_m;
  sweep_.mount_height_m = sweep.mount_height_m;
  sweep_.spread_rad = sweep.columns >= kRecognizer.columns_min
                          ? 2.0 * std::numbers::pi / sweep.columns
                          : kRecognizer.spread_rad;
  sweep_.returns.clear();
  sweep_.sight_lines.clear();

  struct Place {
    Eigen::Vector2f sensor_m;
    Eigen::Vector2f ahead;
  };
  std::array<Place, kRecognizer.slots + 1> places;
  for (std::size_t slot = 0; slot <= kRecognizer.slots; ++slot) {
    const auto pose = ego.at(sweep.taken_ns + sweep.duration_ns * static_cast<int>(slot) /
                                                  static_cast<int>(kRecognizer.slots));
    const Eigen::Vector2d ahead = direction(pose->heading_rad);
    places[slot] = {
        .sensor_m =
            (pose->position_m + sweep.mount_forward_m * ahead - sweep_.origin_m).cast<float>(),
        .ahead = ahead.cast<float>()};
  }
  const auto slots_per_s = static_cast<float>(kRecognizer.slots / duration_s);
  const auto range_max = static_cast<float>(config_.tracker.clustering.range_max_m);
  const auto lowest = static_cast<float>(config_.height_min_m);
  const auto highest = static_cast<float>(config_.height_max_m);
  for (const RawReturn& beam_return : raw_) {
    const float height = ground_.height_m(beam_return);
    result.ground_returns += height < lowest ? 1 : 0;
    if (beam_return.z_m < 0.0F) {
      sweep_.sight_lines.push_back({.azimuth_rad = std::atan2(beam_return.y_m, beam_return.x_m),
                                    .range_m = beam_return.range_m,
                                    .z_m = beam_return.z_m});
    }
    if (height < lowest || height > highest || beam_return.range_m > range_max) {
      continue;
    }
    const float slot =
        std::min(beam_return.time_s * slots_per_s, static_cast<float>(kRecognizer.slots) - 0.001F);
    const auto first = static_cast<std::size_t>(slot);
    const float share = slot - static_cast<float>(first);
    const Eigen::Vector2f sensor_m =
        (1.0F - share) * places[first].sensor_m + share * places[first + 1].sensor_m;
    const Eigen::Vector2f ahead =
        (1.0F - share) * places[first].ahead + share * places[first + 1].ahead;
    sweep_.returns.push_back({.place_m = sensor_m + beam_return.x_m * ahead +
                                         beam_return.y_m * Eigen::Vector2f(-ahead.y(), ahead.x()),
                              .height_m = height,
                              .time_s = beam_return.time_s,
                              .azimuth_rad = std::atan2(beam_return.y_m, beam_return.x_m),
                              .range_m = beam_return.range_m,
                              .ground_m = beam_return.z_m - height,
                              .is_of_top = beam_return.is_of_top});
  }
}

}  // namespace ads
