#include "pose_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>

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
constexpr double kLongestGap_s = 10.0;   // Beyond it the last speed says nothing any more.
constexpr double kUnknownPosition_m = 1e3;
constexpr double kStandingAfter_s = 0.5;
constexpr double kCourseGate = 10.8;  // 99.9 % of one dimension.
constexpr double kNoGate = std::numeric_limits<double>::infinity();

double squared(double value) {
  return value * value;
}

double wrapped(double angle_rad) {
  return std::remainder(angle_rad, 2.0 * std::numbers::pi);
}

Eigen::Vector2d heading(double yaw_rad) {
  return {std::cos(yaw_rad), std::sin(yaw_rad)};
}

Eigen::Vector2d left_of(const Eigen::Vector2d& direction) {
  return {-direction.y(), direction.x()};
}

}  // namespace

PoseFilter::PoseFilter(const PoseFilterConfig& config) : config_(config) {
  state_[kScale] = 1.0;
  covariance_(kScale, kScale) = squared(config.wheel_scale_stddev);
  covariance_(kGyroBias, kGyroBias) = squared(config.gyro_bias_stddev_radps);
}

void PoseFilter::on_known_pose(std::chrono::nanoseconds time, const KnownPose& pose) {
  advance_to(time);
  has_position_ = true;
  has_heading_ = true;
  outliers_in_a_row_ = 0;
  wheel_speed_mps_ = pose.speed_mps;
  state_.segment<2>(kEast) = pose.position_m;
  state_[kYaw] = wrapped(pose.yaw_rad);
  state_.segment<2>(kFixBias).setZero();
  forget(kEast, pose.position_stddev_m);
  forget(kNorth, pose.position_stddev_m);
  forget(kYaw, pose.yaw_stddev_rad);
  forget(kFixBias, config_.fix_bias_stddev_m);
  forget(kFixBias + 1, config_.fix_bias_stddev_m);
}

void PoseFilter::on_yaw_rate(std::chrono::nanoseconds time, double radps) {
  advance_to(time);
  yaw_rate_radps_ = radps;
  if (standing_s_ > kStandingAfter_s) {
    update_gyro_bias();
  }
}

void PoseFilter::on_wheel_speed(std::chrono::nanoseconds time, double mps) {
  advance_to(time);
  wheel_speed_mps_ = mps;
}

void PoseFilter::on_steered_yaw_rate(std::chrono::nanoseconds time, double radps,
                                     double stddev_radps) {
  advance_to(time);
  State jacobian = State::Zero();
  jacobian[kGyroBias] = 1.0;
  update_scalar(jacobian, {.innovation = yaw_rate_radps_ - radps - state_[kGyroBias],
                           .noise = std::hypot(stddev_radps, config_.gyro_noise_radps),
                           .gate = kCourseGate});
}

bool PoseFilter::on_fix(std::chrono::nanoseconds arrival, std::chrono::nanoseconds age,
                        const PlaneFix& fix) {
  const double age_s = std::chrono::duration<double>(age).count();
  advance_to(arrival);
  if (!has_position_) {
    begin(fix, age_s);
  }
  const Past past = look_back(age_s);
  if (!update_position(fix, past)) {
    outliers_in_a_row_ += 1;
    if (config_.fix_outliers_max > 0 && outliers_in_a_row_ >= config_.fix_outliers_max) {
      begin(fix, age_s);
    }
    return false;
  }
  outliers_in_a_row_ = 0;
  if (has_heading_) {
    update_course(fix, past);
  } else {
    begin_heading(fix, age_s);
  }
  return true;
}

PoseEstimate PoseFilter::estimate() const {
  const Step now{.wheel_speed_mps = wheel_speed_mps_, .yaw_rate_radps = yaw_rate_radps_};
  PoseEstimate estimate;
  estimate.time = time_.value_or(std::chrono::nanoseconds(0));
  estimate.position_m = state_.segment<2>(kEast);
  estimate.yaw_rad = state_[kYaw];
  estimate.yaw_rate_radps = yaw_rate_radps_ - state_[kGyroBias];
  estimate.has_heading = has_heading_;
  if (has_heading_) {
    estimate.velocity_mps = velocity(state_[kYaw], now);
  }
  estimate.position_stddev_m = std::sqrt(covariance_(kEast, kEast) + covariance_(kNorth, kNorth));
  estimate.yaw_stddev_rad = std::sqrt(covariance_(kYaw, kYaw));
  estimate.wheel_scale = state_[kScale];
  estimate.gyro_bias_radps = state_[kGyroBias];
  estimate.speed_mps = state_[kScale] * wheel_speed_mps_;
  Eigen::Matrix<double, 5, kSize> jacobian = Eigen::Matrix<double, 5, kSize>::Zero();
  jacobian.topLeftCorner<3, 3>().setIdentity();
  jacobian(3, kScale) = wheel_speed_mps_;
  jacobian(4, kGyroBias) = -1.0;
  estimate.covariance = jacobian * covariance_ * jacobian.transpose();
  estimate.covariance(3, 3) += squared(config_.wheel_noise_mps);
  estimate.covariance(4, 4) += squared(config_.gyro_noise_radps);
  return estimate;
}

void PoseFilter::advance_to(std::chrono::nanoseconds time) {
  if (!time_) {
    time_ = time;
  }
  double left_s = std::chrono::duration<double>(time - *time_).count();
  if (left_s <= 0.0) {
    return;
  }
  time_ = time;
  if (left_s > kLongestGap_s) {
    has_position_ = false;
    has_heading_ = false;
    steps_.clear();
    steps_s_ = 0.0;
    return;
  }
  const double part_s = left_s / std::ceil(left_s / kLongestStep_s);
  for (; left_s > 0.5 * part_s; left_s -= part_s) {
    const Step step{.duration_s = part_s,
                    .wheel_speed_mps = wheel_speed_mps_,
                    .yaw_rate_radps = yaw_rate_radps_};
    remember(step);
    predict(step);
  }
}

void PoseFilter::remember(const Step& step) {
  steps_.push_back(step);
  steps_s_ += step.duration_s;
  while (steps_.size() > kStepsMax || steps_s_ - steps_.front().duration_s > kHistory_s) {
    steps_s_ -= steps_.front().duration_s;
    steps_.pop_front();
  }
  standing_s_ = step.wheel_speed_mps == 0.0 ? standing_s_ + step.duration_s : 0.0;
}

Eigen::Vector2d PoseFilter::velocity(double yaw_rad, const Step& step) const {
  const Eigen::Vector2d ahead = heading(yaw_rad);
  const double yaw_rate = step.yaw_rate_radps - state_[kGyroBias];
  return state_[kScale] * step.wheel_speed_mps * ahead +
         yaw_rate * config_.rear_axle_to_point_m * left_of(ahead);
}

void PoseFilter::predict(const Step& step) {
  const double duration = step.duration_s;
  const double yaw_rate = step.yaw_rate_radps - state_[kGyroBias];
  const double yaw_mean = state_[kYaw] + 0.5 * yaw_rate * duration;
  const Eigen::Vector2d ahead = heading(yaw_mean);
  const double keeps = std::exp(-duration / config_.fix_bias_time_s);
  Covariance jacobian = Covariance::Identity();
  Covariance noise = Covariance::Zero();

  if (has_heading_) {
    const Eigen::Vector2d moved = duration * velocity(yaw_mean, step);
    state_.segment<2>(kEast) += moved;
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
    // It may have gone anywhere.
    noise.block<2, 2>(kEast, kEast) =
        squared(step.wheel_speed_mps * duration) * Eigen::Matrix2d::Identity();
  }
  state_[kYaw] = wrapped(state_[kYaw] + yaw_rate * duration);
  jacobian(kYaw, kGyroBias) = -duration;
  noise(kYaw, kYaw) = duration * squared(config_.yaw_walk_rad_per_sqrt_s);
  noise(kScale, kScale) = duration * squared(config_.wheel_scale_walk_per_sqrt_s);
  noise(kGyroBias, kGyroBias) = duration * squared(config_.gyro_bias_walk_radps_per_sqrt_s);

  state_.segment<2>(kFixBias) *= keeps;
  jacobian.block<2, 2>(kFixBias, kFixBias) *= keeps;
  noise.block<2, 2>(kFixBias, kFixBias) =
      squared(config_.fix_bias_stddev_m) * (1.0 - keeps * keeps) * Eigen::Matrix2d::Identity();

  covariance_ = jacobian * covariance_ * jacobian.transpose() + noise;
}

// Where the memory ends before `age_s`, its oldest step goes on.
PoseFilter::Past PoseFilter::look_back(double age_s) const {
  Past past;
  past.yaw_rad = state_[kYaw];
  past.step = {.wheel_speed_mps = wheel_speed_mps_, .yaw_rate_radps = yaw_rate_radps_};
  if (!has_heading_) {
    return past;
  }
  auto next = steps_.rbegin();
  for (double left_s = age_s; left_s > 0.0;) {
    double part_s = std::min(left_s, kLongestStep_s);
    if (next != steps_.rend()) {
      past.step = *next++;
      part_s = std::min(left_s, past.step.duration_s);
    }
    const double turned = (past.step.yaw_rate_radps - state_[kGyroBias]) * part_s;
    const double yaw_mean = past.yaw_rad - 0.5 * turned;
    past.moved_m += part_s * velocity(yaw_mean, past.step);
    past.per_wheel_scale_m += part_s * past.step.wheel_speed_mps * heading(yaw_mean);
    past.yaw_rad -= turned;
    left_s -= part_s;
  }
  return past;
}

void PoseFilter::begin(const PlaneFix& fix, double age_s) {
  has_position_ = true;
  has_heading_ = false;
  outliers_in_a_row_ = 0;
  state_.segment<2>(kEast) = fix.position_m;
  state_[kYaw] = 0.0;
  state_.segment<2>(kFixBias).setZero();
  forget(kEast, kUnknownPosition_m);
  forget(kNorth, kUnknownPosition_m);
  forget(kYaw, std::numbers::pi);
  forget(kFixBias, config_.fix_bias_stddev_m);
  forget(kFixBias + 1, config_.fix_bias_stddev_m);
  begin_heading(fix, age_s);
}

void PoseFilter::forget(int place, double stddev) {
  covariance_.row(place).setZero();
  covariance_.col(place).setZero();
  covariance_(place, place) = squared(stddev);
}

// Until now the position was that of the fix as it arrived; from now on it is reckoned forward.
void PoseFilter::begin_heading(const PlaneFix& fix, double age_s) {
  if (!fix.yaw_rad || fix.speed_mps < config_.course_speed_min_mps) {
    return;
  }
  has_heading_ = true;
  state_[kYaw] = wrapped(*fix.yaw_rad);
  covariance_.row(kYaw).setZero();
  covariance_.col(kYaw).setZero();
  covariance_(kYaw, kYaw) = squared(config_.course_stddev_rad);
  const Past since = look_back(age_s);
  state_.segment<2>(kEast) += since.moved_m;
  covariance_.block<2, 1>(kEast, kYaw) = covariance_(kYaw, kYaw) * left_of(since.moved_m);
  covariance_.block<1, 2>(kYaw, kEast) = covariance_.block<2, 1>(kEast, kYaw).transpose();
  covariance_.block<2, 2>(kEast, kEast) +=
      covariance_(kYaw, kYaw) * left_of(since.moved_m) * left_of(since.moved_m).transpose();
}

bool PoseFilter::update_position(const PlaneFix& fix, const Past& past) {
  FixJacobian jacobian = FixJacobian::Zero();
  jacobian.block<2, 2>(0, kEast).setIdentity();
  jacobian.block<2, 2>(0, kFixBias).setIdentity();
  if (has_heading_) {
    jacobian.block<2, 1>(0, kYaw) = -left_of(past.moved_m);
    jacobian.block<2, 1>(0, kScale) = -past.per_wheel_scale_m;
  }
  const Eigen::Vector2d expected =
      state_.segment<2>(kEast) - past.moved_m + state_.segment<2>(kFixBias);
  const Eigen::Vector2d innovation = fix.position_m - expected;
  const Eigen::Matrix2d noise = squared(config_.fix_noise_m) * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d spread = jacobian * covariance_ * jacobian.transpose() + noise;
  const Eigen::Matrix2d inverse = spread.inverse();
  if (innovation.dot(inverse * innovation) > config_.fix_gate) {
    return false;
  }
  const Eigen::Matrix<double, kSize, 2> gain = covariance_ * jacobian.transpose() * inverse;
  state_ += gain * innovation;
  state_[kYaw] = wrapped(state_[kYaw]);
  // Joseph's form: it stays symmetric and positive whatever is rounded (Groves, equation 3.58).
  const Covariance rest = Covariance::Identity() - gain * jacobian;
  covariance_ = rest * covariance_ * rest.transpose() + gain * noise * gain.transpose();
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
  update_scalar(jacobian, {.innovation = yaw_rate_radps_ - state_[kGyroBias],
                           .noise = config_.gyro_noise_radps,
                           .gate = kNoGate});
}

void PoseFilter::update_scalar(const State& jacobian, const Scalar& scalar) {
  const double spread = jacobian.dot(covariance_ * jacobian) + squared(scalar.noise);
  if (squared(scalar.innovation) > scalar.gate * spread) {
    return;
  }
  const State gain = covariance_ * jacobian / spread;
  state_ += gain * scalar.innovation;
  state_[kYaw] = wrapped(state_[kYaw]);
  const Covariance rest = Covariance::Identity() - gain * jacobian.transpose();
  covariance_ =
      rest * covariance_ * rest.transpose() + squared(scalar.noise) * gain * gain.transpose();
}

}  // namespace ads
