#include "ego_motion.h"

#include <algorithm>

#include "common/plane.h"

namespace ads {
namespace {

EgoPose moved_on(const EgoPose& pose, std::int64_t time_ns) {
  const double passed_s = static_cast<double>(time_ns - pose.time_ns) * 1e-9;
  EgoPose moved = pose;
  moved.time_ns = time_ns;
  const double middle = pose.heading_rad + 0.5 * passed_s * pose.yaw_rate_radps;
  moved.position_m += passed_s * pose.speed_mps * direction(middle);
  moved.heading_rad += passed_s * pose.yaw_rate_radps;
  return moved;
}

}  // namespace

void EgoMotion::add(const EgoPose& pose) {
  if (poses_.empty() || pose.time_ns > poses_.back().time_ns) {
    poses_.push_back(pose);
  }
}

std::optional<EgoPose> EgoMotion::at(std::int64_t time_ns) const {
  const auto after =
      std::lower_bound(poses_.begin(), poses_.end(), time_ns,
                       [](const EgoPose& pose, std::int64_t time) { return pose.time_ns < time; });
  if (after == poses_.begin() || after == poses_.end()) {
    const bool is_early = after == poses_.begin();
    if (poses_.empty() ||
        std::abs(time_ns - (is_early ? poses_.front() : poses_.back()).time_ns) > kReach_ns) {
      return std::nullopt;
    }
    return moved_on(is_early ? poses_.front() : poses_.back(), time_ns);
  }
  const EgoPose& before = *(after - 1);
  const double share = static_cast<double>(time_ns - before.time_ns) /
                       static_cast<double>(after->time_ns - before.time_ns);
  EgoPose pose = before;
  pose.time_ns = time_ns;
  pose.position_m += share * (after->position_m - before.position_m);
  pose.heading_rad += share * normalize_angle(after->heading_rad - before.heading_rad);
  pose.speed_mps += share * (after->speed_mps - before.speed_mps);
  pose.yaw_rate_radps += share * (after->yaw_rate_radps - before.yaw_rate_radps);
  return pose;
}

}  // namespace ads
