#include "speed_filter.h"

#include <algorithm>

#include "common/scalar.h"
#include "localization_tuning.h"

namespace ads {
namespace {}  // namespace

SpeedFilter::SpeedFilter(const SpeedFilterConfig& config) : config_(config) {
  memory_.covariance =
      Eigen::Vector3d(squared(kSpeedFilter.speed_mps), squared(kSpeedFilter.acceleration_mps2),
                      squared(config.acceleration_bias_mps2))
          .asDiagonal();
}

void SpeedFilter::on_wheel_speed(std::chrono::nanoseconds time, double mps) {
  advance_to(time);
  update({1.0, 0.0, 0.0}, mps, config_.wheel_noise_mps);
}

void SpeedFilter::on_acceleration(std::chrono::nanoseconds time, double mps2) {
  advance_to(time);
  update({0.0, 1.0, 1.0}, mps2, config_.acceleration_noise_mps2);
}

void SpeedFilter::advance_to(std::chrono::nanoseconds time) {
  const double passed_s = std::chrono::duration<double>(time - memory_.time.value_or(time)).count();
  memory_.time = std::max(time, memory_.time.value_or(time));
  if (passed_s <= 0.0) {
    return;
  }
  if (passed_s > kSpeedFilter.longest_gap_s) {
    // The old acceleration is meaningless.
    memory_.state[1] = 0.0;
    memory_.covariance(0, 0) = squared(kSpeedFilter.speed_mps);
    memory_.covariance(1, 1) = squared(kSpeedFilter.acceleration_mps2);
    return;
  }
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Identity();
  jacobian(0, 1) = passed_s;
  memory_.state = jacobian * memory_.state;
  memory_.covariance = jacobian * memory_.covariance * jacobian.transpose();
  memory_.covariance(1, 1) += squared(config_.jerk_mps3_per_sqrt_hz) * passed_s;
}

void SpeedFilter::update(const Eigen::Vector3d& jacobian, double measured, double noise) {
  const Eigen::Vector3d spread = memory_.covariance * jacobian;
  const Eigen::Vector3d gain = spread / (jacobian.dot(spread) + squared(noise));
  memory_.state += gain * (measured - jacobian.dot(memory_.state));
  const Eigen::Matrix3d rest = Eigen::Matrix3d::Identity() - gain * jacobian.transpose();
  memory_.covariance =
      rest * memory_.covariance * rest.transpose() + squared(noise) * gain * gain.transpose();
}

}  // namespace ads
