#include "level.h"

#include <algorithm>

namespace rav4 {
namespace {

constexpr double kFreeFall_mps2 = 1.0;

}  // namespace

void Level::on_acceleration(std::chrono::nanoseconds time, const Eigen::Vector3d& acceleration) {
  if (!acceleration.allFinite()) {
    return;
  }
  if (!time_) {
    time_ = time;
    up_ = acceleration;
    return;
  }
  const double passed_s = std::max(0.0, std::chrono::duration<double>(time - *time_).count());
  time_ = time;
  up_ += passed_s / (time_constant_s_ + passed_s) * (acceleration - up_);
}

double Level::yaw_rate(const Eigen::Vector3d& turn_rate) const {
  const double length = up_.norm();
  const bool is_level = !time_ || length < kFreeFall_mps2;
  return is_level ? -turn_rate.z() : turn_rate.dot(up_) / length;
}

}  // namespace rav4
