#include "scan_matcher.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "common/plane.h"
#include "common/scalar.h"
#include "odometry_tuning.h"

namespace odometry {
namespace {

using ads::squared;

std::array<int, 3> voxel_at(const Eigen::Vector3f& place_m, double size_m) {
  const auto index = [size_m](float value) {
    return static_cast<int>(std::floor(static_cast<double>(value) / size_m));
  };
  return {index(place_m.x()), index(place_m.y()), index(place_m.z())};
}

Eigen::Vector3f placed(const Pose& pose, const Eigen::Vector3f& point_m) {
  const Eigen::Vector2d place_m =
      pose.place_m + Eigen::Rotation2Dd(pose.heading_rad) * point_m.head<2>().cast<double>();
  return {static_cast<float>(place_m.x()), static_cast<float>(place_m.y()), point_m.z()};
}

}  // namespace

Pose Pose::moved(const Pose& motion) const {
  return {.place_m = place_m + Eigen::Rotation2Dd(heading_rad) * motion.place_m,
          .heading_rad = ads::normalize_angle(heading_rad + motion.heading_rad)};
}

Pose Pose::motion_to(const Pose& other) const {
  return {.place_m = Eigen::Rotation2Dd(-heading_rad) * (other.place_m - place_m),
          .heading_rad = ads::normalize_angle(other.heading_rad - heading_rad)};
}

std::size_t ScanMatcher::VoxelHash::operator()(const Voxel& voxel) const {
  std::size_t hash = 0;
  for (const int index : voxel) {
    hash = hash * 1'000'003U + static_cast<std::size_t>(index + (1 << 20));
  }
  return hash;
}

ScanMatcher::ScanMatcher(const ScanMatcherConfig& config) : config_(config) {}

void ScanMatcher::take(std::span<const TimedPoint> points, double turn_s, double passed_s) {
  if (sweeps_++ == 0) {
    first_.assign(points.begin(), points.end());
    add_to_map(at_end(points, Pose{}));
    return;
  }
  if (!first_.empty()) {
    // Now the motion is known roughly, and both sweeps can be taken to one time.
    find_first_rate(points, turn_s, passed_s);
    map_.clear();
    add_to_map(at_end(first_, over(turn_s)));
    first_.clear();
  } else if (passed_s > kScanMatcher.gap * turn_s) {
    (void)match(points, turn_s, passed_s, config_.reach_first_m);
  }
  pose_ = match(points, turn_s, passed_s, config_.reach_m);
  add_to_map(at_end(points, over(turn_s)));
}

// The motion at the present rate.
Pose ScanMatcher::over(double time_s) const {
  return {.place_m = time_s * rate_.place_m, .heading_rad = time_s * rate_.heading_rad};
}

// Where the sensor is now, if it went on about as before; the rate becomes that to there.
Pose ScanMatcher::match(std::span<const TimedPoint> points, double turn_s, double passed_s,
                        double reach_m) {
  const Pose after = align(at_end(points, over(turn_s)), pose_.moved(over(passed_s)), reach_m);
  const Pose moved = pose_.motion_to(after);
  rate_ = {.place_m = moved.place_m / passed_s, .heading_rad = moved.heading_rad / passed_s};
  return after;
}

// From standing still; where that leads nowhere, from speeds so far from each other that one of
// them is in reach.
void ScanMatcher::find_first_rate(std::span<const TimedPoint> points, double turn_s,
                                  double passed_s) {
  const double step_m = config_.reach_first_m;
  Pose best;
  double best_share = -1.0;
  const auto try_step = [&](int step) {
    rate_ = {.place_m = {step * step_m / passed_s, 0.0}, .heading_rad = 0.0};
    const Pose after = match(points, turn_s, passed_s, config_.reach_first_m);
    if (const double share = share_on_map(at_end(points, over(turn_s)), after);
        share > best_share) {
      best_share = share;
      best = rate_;
    }
  };
  const auto steps = [&](double speed_mps) {
    return static_cast<int>(std::min(speed_mps * passed_s / step_m, kScanMatcher.steps_max));
  };
  try_step(0);
  for (int step = -steps(kScanMatcher.backwards_max_mps);
       best_share < kScanMatcher.matched && step <= steps(kScanMatcher.forwards_max_mps); ++step) {
    try_step(step);
  }
  rate_ = best;
}

// Of the points, how many lie on the map.
double ScanMatcher::share_on_map(const std::vector<Eigen::Vector3f>& points,
                                 const Pose& pose) const {
  std::size_t count = 0;
  std::size_t on_map = 0;
  for (std::size_t index = 0; index < points.size(); index += kScanMatcher.some) {
    ++count;
    on_map += nearest(placed(pose, points[index]), 0.5 * config_.reach_m) != nullptr ? 1 : 0;
  }
  return count == 0 ? 0.0 : static_cast<double>(on_map) / static_cast<double>(count);
}

// The useful points, relative to the sensor at the end of the sweep.
std::vector<Eigen::Vector3f> ScanMatcher::at_end(std::span<const TimedPoint> points,
                                                 const Pose& motion) const {
  std::vector<Eigen::Vector3f> places;
  const Pose back = motion.motion_to(Pose{});
  for (const TimedPoint& point : points) {
    const double range = point.place_m.head<2>().norm();
    if (!(range >= config_.range_min_m && range <= config_.range_max_m) ||
        !(point.place_m.z() >= config_.height_min_m && point.place_m.z() <= config_.height_max_m)) {
      continue;
    }
    const double rest = 1.0 - static_cast<double>(point.share);
    places.push_back(placed(
        {.place_m = rest * back.place_m, .heading_rad = rest * back.heading_rad}, point.place_m));
  }
  return places;
}

Pose ScanMatcher::align(const std::vector<Eigen::Vector3f>& points, Pose pose, double reach_m) {
  Voxels seen;
  std::vector<Eigen::Vector3f> thinned;
  for (const Eigen::Vector3f& point : points) {
    if (auto& voxel = seen[voxel_at(point, kScanMatcher.thinning * config_.voxel_m)];
        voxel.empty()) {
      voxel.push_back(point);
      thinned.push_back(point);
    }
  }
  for (int iteration = 0; iteration < kScanMatcher.iterations_max; ++iteration) {
    // Weights of Geman and McClure: what is off by a third of the reach counts a quarter.
    const double scale2 = squared(reach_m / 3.0);
    Eigen::Vector2d from = Eigen::Vector2d::Zero();
    Eigen::Vector2d to = Eigen::Vector2d::Zero();
    double sum = 0.0;
    double along = 0.0;
    double aside = 0.0;
    double distances = 0.0;
    std::size_t matched = 0;
    for (const Eigen::Vector3f& point : thinned) {
      const Eigen::Vector3f place = placed(pose, point);
      const Eigen::Vector3f* const there = nearest(place, reach_m);
      if (there == nullptr) {
        continue;
      }
      // From the sensor: so the sums stay small wherever it is.
      const Eigen::Vector2d here = place.head<2>().cast<double>() - pose.place_m;
      const Eigen::Vector2d target = there->head<2>().cast<double>() - pose.place_m;
      const double off2 = (target - here).squaredNorm();
      const double weight = squared(scale2 / (scale2 + off2));
      from += weight * here;
      to += weight * target;
      sum += weight;
      along += weight * here.dot(target);
      aside += weight * ads::cross(here, target);
      distances += std::sqrt(off2);
      ++matched;
    }
    const auto part = [](double whole, std::size_t of) {
      return of > 0 ? whole / static_cast<double>(of) : 0.0;
    };
    matched_share_ = part(static_cast<double>(matched), thinned.size());
    residual_m_ = part(distances, matched);
    if (matched < kScanMatcher.points_min) {
      return pose;  // Nothing to hold on to: the motion goes on.
    }
    // The turn and the shift that take one set of points to the other, least squares.
    const double turn = std::atan2(aside - ads::cross(from, to) / sum, along - from.dot(to) / sum);
    const Eigen::Vector2d shift = (to - Eigen::Rotation2Dd(turn) * from) / sum;
    pose.place_m += shift;
    pose.heading_rad = ads::normalize_angle(pose.heading_rad + turn);
    if (shift.norm() < kScanMatcher.settled_m && std::abs(turn) < kScanMatcher.settled_rad) {
      break;
    }
  }
  return pose;
}

const Eigen::Vector3f* ScanMatcher::nearest(const Eigen::Vector3f& place_m, double reach_m) const {
  const Voxel center = voxel_at(place_m, config_.voxel_m);
  const int around = static_cast<int>(std::ceil(reach_m / config_.voxel_m));
  const Eigen::Vector3f* best = nullptr;
  auto best2 = static_cast<float>(squared(reach_m));
  for (int x = -around; x <= around; ++x) {
    for (int y = -around; y <= around; ++y) {
      for (int z = -around; z <= around; ++z) {
        const auto voxel = map_.find({center[0] + x, center[1] + y, center[2] + z});
        if (voxel == map_.end()) {
          continue;
        }
        for (const Eigen::Vector3f& point : voxel->second) {
          const float distance2 = (point - place_m).squaredNorm();
          if (distance2 < best2) {
            best2 = distance2;
            best = &point;
          }
        }
      }
    }
  }
  return best;
}

void ScanMatcher::add_to_map(const std::vector<Eigen::Vector3f>& points) {
  const auto apart2 = static_cast<float>(squared(kScanMatcher.apart * config_.voxel_m));
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3f place = placed(pose_, point);
    auto& voxel = map_[voxel_at(place, config_.voxel_m)];
    if (voxel.size() < kScanMatcher.points_per_voxel &&
        std::ranges::none_of(voxel, [&](const Eigen::Vector3f& other) {
          return (other - place).squaredNorm() < apart2;
        })) {
      voxel.push_back(place);
    }
  }
  std::erase_if(map_, [&](const auto& voxel) {
    return (voxel.second.front().template head<2>().template cast<double>() - pose_.place_m)
               .norm() > config_.map_range_m;
  });
}

}  // namespace odometry
