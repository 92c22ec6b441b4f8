#include "track.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <tuple>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "common/plane.h"
#include "common/scalar.h"
#include "perception_tuning.h"

namespace ads {
namespace {

template <typename Matrix>
void write(const Matrix& matrix, google::protobuf::RepeatedField<double>& values) {
  values.Add(matrix.data(), matrix.data() + matrix.size());
}

template <typename Matrix>
void read(Matrix& matrix, const google::protobuf::RepeatedField<double>& values) {
  if (values.size() != matrix.size()) {
    throw std::invalid_argument(fmt::format("state of a track: expected {} numbers, found {}",
                                            matrix.size(), values.size()));
  }
  std::copy(values.begin(), values.end(), matrix.data());
}

}  // namespace

Track::Track(const TrackConfig& config, std::int64_t time_ns, const Eigen::Vector2d& center_m,
             double heading_rad)
    : config_(config), time_ns_(time_ns), heading_(heading_rad, 0.0) {
  state_.head<2>() = center_m;
  covariance_.diagonal() << squared(kTrack.center_m), squared(kTrack.center_m),
      squared(config.speed_stddev_mps), squared(config.speed_stddev_mps),
      squared(config.forward_stddev_mps2), squared(config.forward_stddev_mps2), 0.0, 0.0;
  heading_covariance_ = Eigen::Vector2d(squared(kTrack.heading_rad), squared(0.1)).asDiagonal();
  begin_size();
}

Track::Track(const TrackConfig& config, const perception::TrackState& state)
    : config_(config),
      time_ns_(state.time_ns()),
      height_m_(state.height_m()),
      has_course_(state.has_course()),
      astray_(state.astray()),
      misfits_(state.misfits()) {
  read(state_, state.state());
  read(covariance_, state.covariance());
  read(heading_, state.heading());
  read(heading_covariance_, state.heading_covariance());
  config_.length_m = state.begin_length_m();
  config_.length_stddev_m = state.begin_length_stddev_m();
  config_.width_m = state.begin_width_m();
  config_.width_stddev_m = state.begin_width_stddev_m();
}

void Track::save(perception::TrackState& state) const {
  state.set_time_ns(time_ns_);
  write(state_, *state.mutable_state());
  write(covariance_, *state.mutable_covariance());
  write(heading_, *state.mutable_heading());
  write(heading_covariance_, *state.mutable_heading_covariance());
  state.set_height_m(height_m_);
  state.set_has_course(has_course_);
  state.set_astray(astray_);
  state.set_misfits(misfits_);
  state.set_begin_length_m(config_.length_m);
  state.set_begin_length_stddev_m(config_.length_stddev_m);
  state.set_begin_width_m(config_.width_m);
  state.set_begin_width_stddev_m(config_.width_stddev_m);
}

void Track::begin_size() {
  state_[6] = config_.length_m;
  state_[7] = config_.width_m;
  covariance_.middleRows<2>(6).setZero();
  covariance_.middleCols<2>(6).setZero();
  covariance_(6, 6) = squared(config_.length_stddev_m);
  covariance_(7, 7) = squared(config_.width_stddev_m);
}

void Track::predict(std::int64_t time_ns) {
  const double passed_s = static_cast<double>(time_ns - time_ns_) * 1e-9;
  time_ns_ = time_ns;
  if (passed_s == 0.0) {
    return;
  }
  const double span_s = std::abs(passed_s);
  const double keeps = std::exp(-span_s / config_.maneuver_s);
  Covariance jacobian = Covariance::Identity();
  jacobian.block<2, 2>(0, 2).diagonal().setConstant(passed_s);
  jacobian.block<2, 2>(0, 4).diagonal().setConstant(0.5 * passed_s * passed_s);
  jacobian.block<2, 2>(2, 4).diagonal().setConstant(passed_s);
  jacobian.block<2, 2>(4, 4).diagonal().setConstant(keeps);
  // The velocity gained in a step is assumed from its begin.
  const Eigen::Vector2d ahead = direction(heading_[0]);
  const Eigen::Vector2d left = left_of(ahead);
  const Eigen::Matrix2d gained =
      (1.0 - keeps * keeps) * (squared(config_.forward_stddev_mps2) * ahead * ahead.transpose() +
                               squared(config_.sideways_stddev_mps2) * left * left.transpose());
  Eigen::Matrix<double, 8, 2> entry = Eigen::Matrix<double, 8, 2>::Zero();
  entry.block<2, 2>(0, 0).diagonal().setConstant(0.5 * passed_s * passed_s);
  entry.block<2, 2>(2, 0).diagonal().setConstant(passed_s);
  entry.block<2, 2>(4, 0).setIdentity();
  state_ = jacobian * state_;
  covariance_ = jacobian * covariance_ * jacobian.transpose() + entry * gained * entry.transpose();

  const double turns_on = std::exp(-span_s / config_.turn_s);
  Eigen::Matrix2d turning;
  turning << 1.0, passed_s, 0.0, turns_on;
  heading_ = turning * heading_;
  const double walk = squared(config_.yaw_walk_radps_per_sqrt_s) * span_s;
  Eigen::Matrix2d noise;
  noise << walk * span_s * span_s / 3.0, walk * span_s / 2.0, walk * span_s / 2.0, walk;
  heading_covariance_ = turning * heading_covariance_ * turning.transpose() + noise;
}

void Track::update(const ObjectView& view, const Skyline& skyline) {
  const double near_heading = near_heading_of(view);
  if (const auto seen = heading_of_faces(view, center_m(), near_heading)) {
    const Eigen::Vector2d nearest_m = nearest_point(view.sensor_m);
    const double before = heading_[0];
    update_heading(seen->heading_rad, seen->stddev_rad);
    turn_about(nearest_m, heading_[0] - before);
  }
  // The state moves with each edge; what the edges are measured from must not.
  const BoxView box = view_box(view, skyline, Eigen::Vector2d(center_m()), heading_[0], width_m());
  const Eigen::Vector2d reference_m = center_m();
  const Eigen::Vector2d ahead = direction(heading_[0]);
  const std::array<double, 2> base{ahead.dot(reference_m), left_of(ahead).dot(reference_m)};
  const std::array<std::tuple<Edge, int, double>, 4> edges{
      {{box.front, 0, 1.0}, {box.rear, 0, -1.0}, {box.left, 1, 1.0}, {box.right, 1, -1.0}}};
  // A size is only doubted where it is measured: else what the seen side does would change it.
  doubt_size(box.front, box.rear, 0);
  doubt_size(box.left, box.right, 1);
  // Ends first: where they leave no doubt, bounds have no influence.
  for (const bool is_end : {true, false}) {
    for (auto [edge, axis, sign] : edges) {
      if (edge.is_end == is_end) {
        edge.place_m += base[static_cast<std::size_t>(axis)];
        update_edge(edge, axis, sign);
      }
    }
  }
  height_m_ = std::max(height_m_, box.height_m);
  const Eigen::Vector2d nearest_m = nearest_point(view.sensor_m);
  const double before = heading_[0];
  if (follow_course()) {
    turn_about(nearest_m, heading_[0] - before);
  }
}

// The point of the box that is closest to the sensor.
Eigen::Vector2d Track::nearest_point(const Eigen::Vector2d& sensor_m) const {
  const Eigen::Vector2d ahead = direction(heading_[0]);
  const Eigen::Vector2d apart = sensor_m - center_m();
  const double along = std::clamp(apart.dot(ahead), -0.5 * state_[6], 0.5 * state_[6]);
  const double across = std::clamp(apart.dot(left_of(ahead)), -0.5 * state_[7], 0.5 * state_[7]);
  return center_m() + along * ahead + across * left_of(ahead);
}

// The heading has changed: what was seen stays where it is, and the centre swings about it.
void Track::turn_about(const Eigen::Vector2d& point_m, double turn_rad) {
  const Eigen::Rotation2Dd turn(turn_rad);
  state_.head<2>() = point_m + turn * (center_m() - point_m);
  Covariance jacobian = Covariance::Identity();
  jacobian.topLeftCorner<2, 2>() = turn.toRotationMatrix();
  covariance_ = jacobian * covariance_ * jacobian.transpose();
}

// The heading of the rectangle that fits. If that is far off several times, it is believed.
double Track::near_heading_of(const ObjectView& view) {
  const double best = heading_by_closeness(view, heading_[0], 0.25 * std::numbers::pi);
  const bool is_near = std::abs(best - heading_[0]) < kTrack.turn_rad;
  misfits_ = is_near ? 0 : misfits_ + 1;
  if (misfits_ > kTrack.misfits_max) {
    misfits_ = 0;
    turn_to(best);
    return best;
  }
  return is_near ? best : heading_by_closeness(view, heading_[0], kTrack.turn_rad);
}

// Edges from the centre.
void Track::doubt_size(const Edge& high, const Edge& low, int axis) {
  const int size = 6 + axis;
  const double high_outside = high.place_m - 0.5 * state_[size];
  const double low_outside = -low.place_m - 0.5 * state_[size];
  const auto holds = [](const Edge& edge, double outside) {
    return edge.is_end && std::abs(outside) < kTrack.holds_m;
  };
  double doubt = high.is_end && low.is_end ? config_.size_doubt_m : 0.0;
  if ((holds(high, high_outside) && low_outside > kTrack.holds_m) ||
      (holds(low, low_outside) && high_outside > kTrack.holds_m)) {
    doubt = config_.growth_doubt_m;
  }
  covariance_(size, size) = std::max(covariance_(size, size), squared(doubt));
}

// One measurement of a scalar: the end of the box in the direction `sign` of an axis.
void Track::update_edge(const Edge& edge, int axis, double sign) {
  const Eigen::Vector2d ahead = direction(heading_[0]);
  const Eigen::Vector2d along = axis == 0 ? ahead : left_of(ahead);
  State jacobian = State::Zero();
  jacobian.head<2>() = along;
  jacobian[6 + axis] = 0.5 * sign;
  const double innovation = edge.place_m - jacobian.dot(state_);
  const bool is_outside = sign * innovation > 0.0;
  double noise = squared(edge.is_end ? edge.stddev_m : kTrack.bound_stddev_m);
  if (!edge.is_end && !is_outside) {
    return;
  }
  const State spread = covariance_ * jacobian;
  const double expected = jacobian.dot(spread);
  // Distant measurements are used, but with no more weight than at the gate.
  noise = std::max(noise, squared(innovation) / kTrack.gate - expected);
  State gain = spread / (expected + noise);
  // A size is learned from an edge whose place depends on it, and not from one that is well known:
  // else it would follow each move that was not foreseen.
  const int size = 6 + axis;
  const bool depends =
      squared(spread[size]) > kTrack.dependence * covariance_(size, size) * expected;
  gain[size] = depends ? gain[size] : 0.0;
  gain[7 - axis] = 0.0;
  state_ += gain * innovation;
  const Covariance rest = Covariance::Identity() - gain * jacobian.transpose();
  covariance_ = rest * covariance_ * rest.transpose() + noise * gain * gain.transpose();
  state_[6] = std::max(state_[6], 0.2);
  state_[7] = std::max(state_[7], 0.2);
}

void Track::update_heading(double heading_rad, double stddev_rad) {
  const double innovation = normalize_angle(heading_rad - heading_[0]);
  const double spread = heading_covariance_(0, 0) + squared(stddev_rad);
  const Eigen::Vector2d gain = heading_covariance_.col(0) / spread;
  heading_ += gain * innovation;
  Eigen::Matrix2d rest = Eigen::Matrix2d::Identity();
  rest.col(0) -= gain;
  heading_covariance_ =
      rest * heading_covariance_ * rest.transpose() + squared(stddev_rad) * gain * gain.transpose();
  heading_[0] = normalize_angle(heading_[0]);
}

// Where it moves shows where it heads. False if its box does not turn with it.
bool Track::follow_course() {
  const Eigen::Vector2d velocity = velocity_mps();
  const double speed = velocity.norm();
  const Eigen::Vector2d sideways = left_of(velocity / std::max(speed, 1e-3));
  const double course_stddev =
      std::sqrt(sideways.dot(covariance_.block<2, 2>(2, 2) * sideways)) / std::max(speed, 1e-3);
  if (speed < config_.course_speed_mps || course_stddev > 0.2) {
    return false;
  }
  const double course = std::atan2(velocity.y(), velocity.x());
  const double off = normalize_angle(course - heading_[0]);
  // It may drive backwards.
  const double axis_off = std::remainder(off, std::numbers::pi);
  if (std::abs(axis_off) > 0.25 * std::numbers::pi) {
    ++astray_;
    if (!has_course_ || (astray_ > kTrack.astray_max && speed > 2.0 * config_.course_speed_mps)) {
      turn_to(course);
      has_course_ = true;
    }
    return false;
  }
  astray_ = 0;
  if (!has_course_) {
    has_course_ = true;
    if (std::abs(off) > 0.5 * std::numbers::pi) {
      heading_[0] = normalize_angle(heading_[0] + std::numbers::pi);
      return false;
    }
  }
  update_heading(heading_[0] + axis_off, std::hypot(0.03, 2.0 * course_stddev));
  return true;
}

// The box was taken for one across: its size was that of other sides.
void Track::turn_to(double heading_rad) {
  heading_ = {heading_rad, 0.0};
  heading_covariance_ = Eigen::Vector2d(squared(kTrack.heading_rad), squared(0.1)).asDiagonal();
  begin_size();
  const Eigen::Matrix2d center =
      covariance_.block<2, 2>(0, 0) + squared(1.5) * Eigen::Matrix2d::Identity();
  covariance_.block<2, 2>(0, 0) = center;
}

void Track::cut(const Eigen::Vector2d& sensor_m) {
  const Eigen::Vector2d ahead = direction(heading_[0]);
  const double side = ahead.dot(sensor_m - center_m()) > 0.0 ? 1.0 : -1.0;
  state_.head<2>() += 0.5 * side * (state_[6] - config_.length_m) * ahead;
  const double width = state_[7];
  begin_size();
  state_[7] = width;
}

double Track::distance2(const ObjectView& view, const Skyline& skyline) const {
  const BoxView box = view_box(view, skyline, center_m(), heading_[0], width_m());
  const auto off = [](const Edge& high, const Edge& low, double size) {
    if (high.is_end != low.is_end) {
      return high.is_end ? high.place_m - 0.5 * size : low.place_m + 0.5 * size;
    }
    return 0.5 * (high.place_m + low.place_m);
  };
  const Eigen::Vector2d ahead = direction(heading_[0]);
  const Eigen::Vector2d innovation = off(box.front, box.rear, length_m()) * ahead +
                                     off(box.left, box.right, width_m()) * left_of(ahead);
  const Eigen::Matrix2d spread =
      covariance_.block<2, 2>(0, 0) + squared(0.5) * Eigen::Matrix2d::Identity();
  return innovation.dot(spread.inverse() * innovation);
}

double Track::speed_mps() const {
  return velocity_mps().dot(direction(heading_[0]));
}

double Track::acceleration_mps2() const {
  return state_.segment<2>(4).dot(direction(heading_[0]));
}

double Track::position_stddev_m() const {
  return std::sqrt(0.5 * covariance_.block<2, 2>(0, 0).trace());
}

double Track::speed_stddev_mps() const {
  const Eigen::Vector2d ahead = direction(heading_[0]);
  return std::sqrt(ahead.dot(covariance_.block<2, 2>(2, 2) * ahead));
}

double Track::length_stddev_m() const {
  return std::sqrt(covariance_(6, 6));
}

double Track::heading_stddev_rad() const {
  return std::sqrt(heading_covariance_(0, 0));
}

}  // namespace ads
