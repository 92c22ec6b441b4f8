#include "pose_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>

#include "common/plane.h"
#include "common/scalar.h"

namespace ads {
namespace {

// Places in the state.
constexpr int kEast = 0;
constexpr int kNorth = 1;
constexpr int kYaw = 2;
constexpr int kScale = 3;
constexpr int kGyroBias = 4;
constexpr int kFixBias = 5;

constexpr double kHistory_s = 1.0;
constexpr double kLongestStep_s = 0.05;  // A longer gap is reckoned in parts.
constexpr double kLongestGap_s = 10.0;   // Beyond it the last speed is meaningless.
constexpr double kUnknownPosition_m = 1e3;
constexpr double kStandingAfter_s = 0.5;
constexpr double kSteeringErrorLasts_s = 1.0;
constexpr double kCourseGate = 10.8;  // 99.9 % of one dimension.
constexpr double kNoGate = std::numeric_limits<double>::infinity();

double wrapped(double angle_rad) {
  return std::remainder(angle_rad, 2.0 * std::numbers::pi);
}

Eigen::Vector2d heading(double yaw_rad) {
  return {std::cos(yaw_rad), std::sin(yaw_rad)};
}

}  // namespace

PoseFilter::PoseFilter(const PoseFilterConfig& config) : config_(config) {
  memory_.state[kScale] = 1.0;
  memory_.covariance(kScale, kScale) = squared(config.wheel_scale_stddev);
  memory_.covariance(kGyroBias, kGyroBias) = squared(config.gyro_bias_stddev_radps);
}

void PoseFilter::on_known_pose(std::chrono::nanoseconds time, const KnownPose& pose) {
  advance_to(time);
  memory_.has_position = true;
  memory_.has_heading = true;
  memory_.outliers_in_a_row = 0;
  memory_.wheel_speed_mps = pose.speed_mps;
  memory_.state.segment<2>(kEast) = pose.position_m;
  memory_.state[kYaw] = wrapped(pose.yaw_rad);
  memory_.state.segment<2>(kFixBias).setZero();
  forget(kEast, pose.position_stddev_m);
  forget(kNorth, pose.position_stddev_m);
  forget(kYaw, pose.yaw_stddev_rad);
  forget(kFixBias, config_.fix_bias_stddev_m);
  forget(kFixBias + 1, config_.fix_bias_stddev_m);
}

void PoseFilter::on_yaw_rate(std::chrono::nanoseconds time, double radps) {
  advance_to(time);
  memory_.yaw_rate_radps = radps;
  if (memory_.standing_s > kStandingAfter_s) {
    update_gyro_bias();
  }
}

void PoseFilter::on_wheel_speed(std::chrono::nanoseconds time, double mps) {
  advance_to(time);
  memory_.wheel_speed_mps = mps;
}

void PoseFilter::on_steered_yaw_rate(std::chrono::nanoseconds time, double radps,
                                     double stddev_radps) {
  advance_to(time);
  State jacobian = State::Zero();
  jacobian[kGyroBias] = 1.0;
  update_scalar(jacobian, {.innovation = memory_.yaw_rate_radps - radps - memory_.state[kGyroBias],
                           .noise = std::hypot(stddev_radps, config_.gyro_noise_radps),
                           .gate = kCourseGate});
}

void PoseFilter::on_steering_alone(std::chrono::nanoseconds time, double radps,
                                   double stddev_radps) {
  const double passed_s = std::chrono::duration<double>(time - memory_.time.value_or(time)).count();
  advance_to(time);
  memory_.yaw_rate_radps = radps + memory_.state[kGyroBias];
  memory_.covariance(kYaw, kYaw) +=
      squared(stddev_radps) * kSteeringErrorLasts_s * std::max(0.0, passed_s);
}

bool PoseFilter::on_fix(std::chrono::nanoseconds arrival, std::chrono::nanoseconds age,
                        const PlaneFix& fix) {
  const double age_s = std::chrono::duration<double>(age).count();
  advance_to(arrival);
  if (!memory_.has_position) {
    begin(fix, age_s);
  }
  const Past past = look_back(age_s);
  if (!update_position(fix, past)) {
    memory_.outliers_in_a_row += 1;
    if (config_.fix_outliers_max > 0 && memory_.outliers_in_a_row >= config_.fix_outliers_max) {
      begin(fix, age_s);
    }
    return false;
  }
  memory_.outliers_in_a_row = 0;
  if (memory_.has_heading) {
    update_course(fix, past);
  } else {
    begin_heading(fix, age_s);
  }
  return true;
}

PoseEstimate PoseFilter::estimate() const {
  const Step now{.wheel_speed_mps = memory_.wheel_speed_mps,
                 .yaw_rate_radps = memory_.yaw_rate_radps};
  PoseEstimate estimate;
  estimate.time = memory_.time.value_or(std::chrono::nanoseconds(0));
  estimate.position_m = memory_.state.segment<2>(kEast);
  estimate.yaw_rad = memory_.state[kYaw];
  estimate.yaw_rate_radps = memory_.yaw_rate_radps - memory_.state[kGyroBias];
  estimate.has_heading = memory_.has_heading;
  if (memory_.has_heading) {
    estimate.velocity_mps = velocity(memory_.state[kYaw], now);
  }
  estimate.position_stddev_m =
      std::sqrt(memory_.covariance(kEast, kEast) + memory_.covariance(kNorth, kNorth));
  estimate.yaw_stddev_rad = std::sqrt(memory_.covariance(kYaw, kYaw));
  estimate.wheel_scale = memory_.state[kScale];
  estimate.gyro_bias_radps = memory_.state[kGyroBias];
  estimate.speed_mps = memory_.state[kScale] * memory_.wheel_speed_mps;
  Eigen::Matrix<double, 5, kSize> jacobian = Eigen::Matrix<double, 5, kSize>::Zero();
  jacobian.topLeftCorner<3, 3>().setIdentity();
  jacobian(3, kScale) = memory_.wheel_speed_mps;
  jacobian(4, kGyroBias) = -1.0;
  estimate.covariance = jacobian * memory_.covariance * jacobian.transpose();
  estimate.covariance(3, 3) += squared(config_.wheel_noise_mps);
  estimate.covariance(4, 4) += squared(config_.gyro_noise_radps);
  return estimate;
}

void PoseFilter::advance_to(std::chrono::nanoseconds time) {
  if (!memory_.time) {
    memory_.time = time;
  }
  double left_s = std::chrono::duration<double>(time - *memory_.time).count();
  if (left_s <= 0.0) {
    return;
  }
  memory_.time = time;
  if (left_s > kLongestGap_s) {
    memory_.has_position = false;
    memory_.has_heading = false;
    memory_.steps.clear();
    memory_.steps_s = 0.0;
    return;
  }
  const double part_s = left_s / std::ceil(left_s / kLongestStep_s);
  for (; left_s > 0.5 * part_s; left_s -= part_s) {
    const Step step{.duration_s = part_s,
                    .wheel_speed_mps = memory_.wheel_speed_mps,
                    .yaw_rate_radps = memory_.yaw_rate_radps};
    remember(step);
    predict(step);
  }
}

void PoseFilter::remember(const Step& step) {
  memory_.steps.push_back(step);
  memory_.steps_s += step.duration_s;
  while (memory_.steps.size() > kStepsMax ||
         memory_.steps_s - memory_.steps.front().duration_s > kHistory_s) {
    memory_.steps_s -= memory_.steps.front().duration_s;
    memory_.steps.pop_front();
  }
  memory_.standing_s = step.wheel_speed_mps == 0.0 ? memory_.standing_s + step.duration_s : 0.0;
}

Eigen::Vector2d PoseFilter::velocity(double yaw_rad, const Step& step) const {
  const Eigen::Vector2d ahead = heading(yaw_rad);
  const double yaw_rate = step.yaw_rate_radps - memory_.state[kGyroBias];
  return memory_.state[kScale] * step.wheel_speed_mps * ahead +
         yaw_rate * config_.rear_axle_to_point_m * left_of(ahead);
}

void PoseFilter::predict(const Step& step) {
  const double duration = step.duration_s;
  const double yaw_rate = step.yaw_rate_radps - memory_.state[kGyroBias];
  const double yaw_mean = memory_.state[kYaw] + 0.5 * yaw_rate * duration;
  const Eigen::Vector2d ahead = heading(yaw_mean);
  const double keeps = std::exp(-duration / config_.fix_bias_time_s);
  Covariance jacobian = Covariance::Identity();
  Covariance noise = Covariance::Zero();

  if (memory_.has_heading) {
    const Eigen::Vector2d moved = duration * velocity(yaw_mean, step);
    memory_.state.segment<2>(kEast) += moved;
    jacobian.block<2, 1>(kEast, kYaw) = left_of(moved);
    jacobian.block<2, 1>(kEast, kScale) = duration * step.wheel_speed_mps * ahead;
    jacobian.block<2, 1>(kEast, kGyroBias) =
        -0.5 * duration * left_of(moved) - duration * config_.rear_axle_to_point_m * left_of(ahead);
    // A standing car does not creep away; from walking pace on the walk has its full size.
    const double size = duration * std::min(1.0, std::abs(step.wheel_speed_mps));
    noise.block<2, 2>(kEast, kEast) =
        size *
        (squared(config_.distance_walk_m_per_sqrt_s) * ahead * ahead.transpose() +
         squared(config_.slip_walk_m_per_sqrt_s) * left_of(ahead) * left_of(ahead).transpose());
  } else {
    // It may have moved in any direction.
    noise.block<2, 2>(kEast, kEast) =
        squared(step.wheel_speed_mps * duration) * Eigen::Matrix2d::Identity();
  }
  memory_.state[kYaw] = wrapped(memory_.state[kYaw] + yaw_rate * duration);
  jacobian(kYaw, kGyroBias) = -duration;
  noise(kYaw, kYaw) = duration * squared(config_.yaw_walk_rad_per_sqrt_s);
  noise(kScale, kScale) = duration * squared(config_.wheel_scale_walk_per_sqrt_s);
  noise(kGyroBias, kGyroBias) = duration * squared(config_.gyro_bias_walk_radps_per_sqrt_s);

  memory_.state.segment<2>(kFixBias) *= keeps;
  jacobian.block<2, 2>(kFixBias, kFixBias) *= keeps;
  noise.block<2, 2>(kFixBias, kFixBias) =
      squared(config_.fix_bias_stddev_m) * (1.0 - keeps * keeps) * Eigen::Matrix2d::Identity();

  memory_.covariance = jacobian * memory_.covariance * jacobian.transpose() + noise;
}

// Where the memory ends before `age_s`, its oldest step goes on.
PoseFilter::Past PoseFilter::look_back(double age_s) const {
  Past past;
  past.yaw_rad = memory_.state[kYaw];
  past.step = {.wheel_speed_mps = memory_.wheel_speed_mps,
               .yaw_rate_radps = memory_.yaw_rate_radps};
  if (!memory_.has_heading) {
    return past;
  }
  auto next = memory_.steps.rbegin();
  for (double left_s = age_s; left_s > 0.0;) {
    double part_s = std::min(left_s, kLongestStep_s);
    if (next != memory_.steps.rend()) {
      past.step = *next++;
      part_s = std::min(left_s, past.step.duration_s);
    }
    const double turned = (past.step.yaw_rate_radps - memory_.state[kGyroBias]) * part_s;
    const double yaw_mean = past.yaw_rad - 0.5 * turned;
    past.moved_m += part_s * velocity(yaw_mean, past.step);
    past.per_wheel_scale_m += part_s * past.step.wheel_speed_mps * heading(yaw_mean);
    past.yaw_rad -= turned;
    left_s -= part_s;
  }
  return past;
}

void PoseFilter::begin(const PlaneFix& fix, double age_s) {
  memory_.has_position = true;
  memory_.has_heading = false;
  memory_.outliers_in_a_row = 0;
  memory_.state.segment<2>(kEast) = fix.position_m;
  memory_.state[kYaw] = 0.0;
  memory_.state.segment<2>(kFixBias).setZero();
  forget(kEast, kUnknownPosition_m);
  forget(kNorth, kUnknownPosition_m);
  forget(kYaw, std::numbers::pi);
  forget(kFixBias, config_.fix_bias_stddev_m);
  forget(kFixBias + 1, config_.fix_bias_stddev_m);
  begin_heading(fix, age_s);
}

void PoseFilter::forget(int place, double stddev) {
  memory_.covariance.row(place).setZero();
  memory_.covariance.col(place).setZero();
  memory_.covariance(place, place) = squared(stddev);
}

// Until now the position was that of the fix as it arrived; from now on it is reckoned forward.
void PoseFilter::begin_heading(const PlaneFix& fix, double age_s) {
  if (!fix.yaw_rad || fix.speed_mps < config_.course_speed_min_mps) {
    return;
  }
  memory_.has_heading = true;
  memory_.state[kYaw] = wrapped(*fix.yaw_rad);
  memory_.covariance.row(kYaw).setZero();
  memory_.covariance.col(kYaw).setZero();
  memory_.covariance(kYaw, kYaw) = squared(config_.course_stddev_rad);
  const Past since = look_back(age_s);
  memory_.state.segment<2>(kEast) += since.moved_m;
  memory_.covariance.block<2, 1>(kEast, kYaw) =
      memory_.covariance(kYaw, kYaw) * left_of(since.moved_m);
  memory_.covariance.block<1, 2>(kYaw, kEast) =
      memory_.covariance.block<2, 1>(kEast, kYaw).transpose();
  memory_.covariance.block<2, 2>(kEast, kEast) +=
      memory_.covariance(kYaw, kYaw) * left_of(since.moved_m) * left_of(since.moved_m).transpose();
}

bool PoseFilter::update_position(const PlaneFix& fix, const Past& past) {
  FixJacobian jacobian = FixJacobian::Zero();
  jacobian.block<2, 2>(0, kEast).setIdentity();
  jacobian.block<2, 2>(0, kFixBias).setIdentity();
  if (memory_.has_heading) {
    jacobian.block<2, 1>(0, kYaw) = -left_of(past.moved_m);
    jacobian.block<2, 1>(0, kScale) = -past.per_wheel_scale_m;
  }
  const Eigen::Vector2d expected =
      memory_.state.segment<2>(kEast) - past.moved_m + memory_.state.segment<2>(kFixBias);
  const Eigen::Vector2d innovation = fix.position_m - expected;
  const Eigen::Matrix2d noise = squared(config_.fix_noise_m) * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d spread = jacobian * memory_.covariance * jacobian.transpose() + noise;
  const Eigen::Matrix2d inverse = spread.inverse();
  if (innovation.dot(inverse * innovation) > config_.fix_gate) {
    return false;
  }
  const Eigen::Matrix<double, kSize, 2> gain = memory_.covariance * jacobian.transpose() * inverse;
  memory_.state += gain * innovation;
  memory_.state[kYaw] = wrapped(memory_.state[kYaw]);
  // Joseph's form: it stays symmetric and positive whatever is rounded (Groves, equation 3.58).
  const Covariance rest = Covariance::Identity() - gain * jacobian;
  memory_.covariance =
      rest * memory_.covariance * rest.transpose() + gain * noise * gain.transpose();
  return true;
}

// The point moves where the heading points, but for its own turning about the rear axle.
void PoseFilter::update_course(const PlaneFix& fix, const Past& past) {
  const bool is_fast =
      std::min(fix.speed_mps, past.step.wheel_speed_mps) >= config_.course_speed_min_mps;
  if (!fix.yaw_rad || !is_fast) {
    return;
  }
  const Eigen::Vector2d moving = velocity(past.yaw_rad, past.step);
  State jacobian = State::Zero();
  jacobian[kYaw] = 1.0;
  update_scalar(jacobian, {.innovation = wrapped(*fix.yaw_rad - std::atan2(moving.y(), moving.x())),
                           .noise = config_.course_noise_rad,
                           .gate = kCourseGate});
}

void PoseFilter::update_gyro_bias() {
  State jacobian = State::Zero();
  jacobian[kGyroBias] = 1.0;
  update_scalar(jacobian, {.innovation = memory_.yaw_rate_radps - memory_.state[kGyroBias],
                           .noise = config_.gyro_noise_radps,
                           .gate = kNoGate});
}

void PoseFilter::update_scalar(const State& jacobian, const Scalar& scalar) {
  const double spread = jacobian.dot(memory_.covariance * jacobian) + squared(scalar.noise);
  if (squared(scalar.innovation) > scalar.gate * spread) {
    return;
  }
  const State gain = memory_.covariance * jacobian / spread;
  memory_.state += gain * scalar.innovation;
  memory_.state[kYaw] = wrapped(memory_.state[kYaw]);
  const Covariance rest = Covariance::Identity() - gain * jacobian.transpose();
  memory_.covariance = rest * memory_.covariance * rest.transpose() +
                       squared(scalar.noise) * gain * gain.transpose();
}

}  // namespace ads
