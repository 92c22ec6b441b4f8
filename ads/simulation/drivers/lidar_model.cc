#include "lidar_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "common/plane.h"

namespace ads {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr std::uint8_t kGroundIntensity = 20;
constexpr std::uint8_t kBodyIntensity = 120;

// The place of the same body in the scene before; from the index at which it is now, since bodies
// seldom change their order.
const world::Body* same_body(const world::Scene& before, const world::Body& body, int hint) {
  const int size = before.bodies_size();
  for (int step = 0; step < size; ++step) {
    const auto& candidate = before.bodies((hint + step) % size);
    if (candidate.id() == body.id()) {
      return &candidate;
    }
  }
  return nullptr;
}

}  // namespace

LidarModel::LidarModel(const LidarConfig& config, std::uint64_t seed)
    : config_(config), random_(seed) {
  const double step_deg = (config.elevation_max_deg - config.elevation_min_deg) /
                          std::max(1.0, static_cast<double>(config.rings - 1));
  for (int ring = 0; ring < config.rings; ++ring) {
    const double elevation_deg = config.elevations_deg.empty()
                                     ? config.elevation_min_deg + ring * step_deg
                                     : config.elevations_deg[static_cast<std::size_t>(ring)];
    const double elevation = elevation_deg * kRadPerDeg;
    const double slope = std::tan(elevation);
    rings_.push_back({.slope = slope,
                      .cosine = std::cos(elevation),
                      .ground_m = slope < 0.0 ? -config.mount_height_m / slope : kNever});
  }
}

std::size_t LidarModel::sweep_bytes() const {
  return sizeof(SweepPoint) * static_cast<std::size_t>(config_.columns) *
         static_cast<std::size_t>(config_.rings);
}

std::int64_t LidarModel::column_ns(int column) const {
  return config_.turn_ns * column / config_.columns;
}

void LidarModel::cast(const world::Scene& before, const world::Scene& after,
                      std::int64_t turn_begin_ns, int first, int last, std::span<char> points) {
  prepare(before, after);
  const auto begin_ns = before.header().taken_ns();
  const auto length_ns = static_cast<double>(after.header().taken_ns() - begin_ns);
  const auto dropout = static_cast<std::uint32_t>(std::min(config_.beam_dropout, 1.0) *
                                                  std::numeric_limits<std::uint32_t>::max());
  char* next = points.data() + static_cast<std::size_t>(first) * rings_.size() * sizeof(SweepPoint);

  for (int column = first; column < last; ++column) {
    const auto since_ns = static_cast<double>(turn_begin_ns + column_ns(column) - begin_ns);
    const double share = length_ns > 0.0 ? std::clamp(since_ns / length_ns, 0.0, 1.0) : 1.0;
    const double turned = 2.0 * std::numbers::pi * column / config_.columns;
    const double azimuth =
        config_.first_azimuth_deg * kRadPerDeg + (config_.is_clockwise ? -turned : turned);
    const double heading = ego_.heading_rad + share * ego_.turn_rad;
    const Eigen::Vector2d sensor_m =
        ego_.begin_m + share * ego_.change_m + config_.mount_forward_m * direction(heading);
    cross(sensor_m, direction(heading + azimuth), share);
    const Eigen::Vector2d seen = direction(azimuth);
    SweepPoint point;
    point.time = static_cast<std::uint16_t>(65536LL * column / config_.columns);

    for (std::size_t ring = 0; ring < rings_.size(); ++ring) {
      const LidarReturn beam_return = meet(rings_[ring]);
      const auto bits = random_();
      const double range = beam_return.distance_m / rings_[ring].cosine;
      const bool has_return = range <= config_.range_max_m && (bits >> 32) >= dropout;
      point.x_m = point.y_m = point.z_m = 0.0F;
      point.intensity = 0;
      if (has_return) {
        const double flat =
            beam_return.distance_m + config_.range_stddev_m * normal_(bits) * rings_[ring].cosine;
        point.x_m = static_cast<float>(flat * seen.x());
        point.y_m = static_cast<float>(flat * seen.y());
        point.z_m = static_cast<float>(flat * rings_[ring].slope);
        point.intensity = beam_return.is_body ? kBodyIntensity : kGroundIntensity;
      }
      point.ring = static_cast<std::uint8_t>(ring);
      std::memcpy(next, &point, sizeof point);
      next += sizeof point;
    }
  }
}

void LidarModel::prepare(const world::Scene& before, const world::Scene& after) {
  const auto moving = [](const world::Body& from, const world::Body& to) {
    const Eigen::Vector2d begin_m(from.x_m(), from.y_m());
    return Moving{.begin_m = begin_m,
                  .change_m = Eigen::Vector2d(to.x_m(), to.y_m()) - begin_m,
                  .heading_rad = from.heading_rad(),
                  .turn_rad = normalize_angle(to.heading_rad() - from.heading_rad()),
                  .half_length_m = 0.5 * to.length_m(),
                  .half_width_m = 0.5 * to.width_m(),
                  .radius_m = 0.5 * std::hypot(to.length_m(), to.width_m()),
                  .height_m = to.height_m()};
  };
  ego_ = moving(before.ego(), after.ego());
  bodies_.clear();
  for (int index = 0; index < after.bodies_size(); ++index) {
    const auto& body = after.bodies(index);
    const auto* earlier = same_body(before, body, index);
    bodies_.push_back(moving(earlier != nullptr ? *earlier : body, body));
  }
}

// Fills `crossings_` with the bodies that the column passes over.
void LidarModel::cross(const Eigen::Vector2d& sensor_m, const Eigen::Vector2d& column,
                       double share) {
  crossings_.clear();
  for (const Moving& body : bodies_) {
    const Eigen::Vector2d apart = sensor_m - body.begin_m - share * body.change_m;
    const double ahead = -apart.dot(column);
    const bool is_aside = std::abs(ads::cross(column, apart)) > body.radius_m;
    if (is_aside || ahead < -body.radius_m || ahead > config_.range_max_m + body.radius_m) {
      continue;
    }
    const Eigen::Vector2d axis = direction(body.heading_rad + share * body.turn_rad);
    double enter = -kNever;
    double leave = kNever;
    const auto cut = [&](double place, double pace, double half) {
      if (pace == 0.0) {
        leave = std::abs(place) <= half ? leave : -kNever;
        return;
      }
      const double one = (-half - place) / pace;
      const double other = (half - place) / pace;
      enter = std::max(enter, std::min(one, other));
      leave = std::min(leave, std::max(one, other));
    };
    cut(apart.dot(axis), column.dot(axis), body.half_length_m);
    cut(apart.dot(left_of(axis)), column.dot(left_of(axis)), body.half_width_m);
    if (enter > 0.0 && enter < leave) {
      crossings_.push_back({.enter_m = enter, .leave_m = leave, .height_m = body.height_m});
    }
  }
}

LidarModel::LidarReturn LidarModel::meet(const Ring& ring) const {
  LidarReturn beam_return{.distance_m = ring.ground_m, .is_body = false};
  for (const Crossing& body : crossings_) {
    const double height = config_.mount_height_m + body.enter_m * ring.slope;
    if (height < 0.0) {
      continue;  // It met the ground before.
    }
    double distance = body.enter_m;
    if (height > body.height_m) {
      // Above the front: it may come down onto the roof.
      distance = ring.slope < 0.0 ? (body.height_m - config_.mount_height_m) / ring.slope : kNever;
      if (distance > body.leave_m) {
        continue;
      }
    }
    if (distance < beam_return.distance_m) {
      beam_return = {.distance_m = distance, .is_body = true};
    }
  }
  return beam_return;
}

void spoil(std::string& points) {
  const float nothing = std::numeric_limits<float>::quiet_NaN();
  const std::array<float, 3> place{nothing, nothing, nothing};
  for (std::size_t offset = 0; offset + sizeof(SweepPoint) <= points.size();
       offset += sizeof(SweepPoint)) {
    std::memcpy(points.data() + offset, place.data(), sizeof place);
  }
}

}  // namespace ads
