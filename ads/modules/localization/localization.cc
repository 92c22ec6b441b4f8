#include "localization.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

namespace ads {
namespace {

/// An initial pose that is older does not replace a known position.
constexpr std::chrono::seconds kPoseAgeMax{1};
// Without a motion for longer, the inertial sensor is silent; it gives one each 10 ms.
constexpr std::chrono::milliseconds kSilent{30};

class Reader {
 public:
  explicit Reader(fastcycle::Context& context) : context_(context) {}

  double operator()(std::string_view name, double fallback, std::string unit,
                    std::string description) {
    return context_
        .param<double>(name, {.fallback = fallback,
                              .min = 1e-9,
                              .max = 1e6,
                              .unit = std::move(unit),
                              .description = std::move(description)})
        .get();
  }

 private:
  fastcycle::Context& context_;
};

PoseFilterConfig read_pose_config(fastcycle::Context& context) {
  Reader read(context);
  PoseFilterConfig config;
  config.fix_outliers_max = 0;
  config.fix_noise_m = read("fix_noise_m", 0.1, "m", "Independent error of each fix, per axis");
  config.fix_bias_stddev_m =
      read("fix_bias_stddev_m", 0.15, "m", "Slow error of the receiver, per axis");
  config.fix_bias_time_s = read("fix_bias_time_s", 60.0, "s", "Correlation time of the slow error");
  config.fix_gate = read("fix_gate", config.fix_gate, "1",
                         "Squared Mahalanobis distance beyond which a fix is rejected");
  config.wheel_scale_stddev =
      read("wheel_scale_stddev", 0.005, "1", "Scale error of the wheel speed");
  config.wheel_scale_walk_per_sqrt_s =
      read("wheel_scale_walk_per_sqrt_s", 1e-4, "1/sqrt(s)", "Its random walk");
  config.distance_walk_m_per_sqrt_s =
      read("distance_walk_m_per_sqrt_s", 0.02, "m/sqrt(s)", "Of the position, along the heading");
  config.slip_walk_m_per_sqrt_s =
      read("slip_walk_m_per_sqrt_s", 0.02, "m/sqrt(s)", "The same across it");
  config.yaw_walk_rad_per_sqrt_s =
      read("yaw_walk_rad_per_sqrt_s", 0.0005, "rad/sqrt(s)", "Of the heading");
  config.gyro_bias_stddev_radps =
      read("gyro_bias_stddev_radps", 0.002, "rad/s", "Bias of the gyroscope");
  config.gyro_bias_walk_radps_per_sqrt_s =
      read("gyro_bias_walk_radps_per_sqrt_s", 1e-4, "rad/s/sqrt(s)", "Its random walk");
  config.gyro_noise_radps =
      read("gyro_noise_radps", 0.0028, "rad/s", "Noise of one measurement of the gyroscope");
  config.wheel_noise_mps = 0.0;  // The speed is estimated by its own filter.
  config.rear_axle_to_point_m = read("rear_axle_to_center_m", 1.29, "m",
                                     "Distance from the rear axle to the vehicle's centre");
  return config;
}

SpeedFilterConfig read_speed_config(fastcycle::Context& context) {
  Reader read(context);
  SpeedFilterConfig config;
  config.wheel_noise_mps =
      read("wheel_noise_mps", config.wheel_noise_mps, "m/s", "Noise of one wheel speed");
  config.acceleration_noise_mps2 = read("acceleration_noise_mps2", config.acceleration_noise_mps2,
                                        "m/s^2", "Noise of one acceleration");
  config.acceleration_bias_mps2 = read("acceleration_bias_mps2", config.acceleration_bias_mps2,
                                       "m/s^2", "Offset of the accelerometer");
  config.jerk_mps3_per_sqrt_hz = read("jerk_mps3_per_sqrt_hz", config.jerk_mps3_per_sqrt_hz,
                                      "m/s^3/sqrt(Hz)", "How fast the acceleration changes");
  return config;
}

QualityLimits read_limits(fastcycle::Context& context) {
  Reader read(context);
  QualityLimits limits;
  limits.fix_uncertain_s = read("fix_uncertain_s", limits.fix_uncertain_s, "s",
                                "Time without a good fix after which it is uncertain");
  limits.fix_lost_s =
      read("fix_lost_s", limits.fix_lost_s, "s", "Time without a good fix after which it is lost");
  limits.position_uncertain_m = read("position_uncertain_m", limits.position_uncertain_m, "m",
                                     "Standard deviation from which it is uncertain");
  limits.position_lost_m = read("position_lost_m", limits.position_lost_m, "m",
                                "Standard deviation from which it is lost");
  limits.heading_uncertain_rad = read("heading_uncertain_rad", limits.heading_uncertain_rad, "rad",
                                      "Standard deviation from which it is uncertain");
  limits.heading_lost_rad = read("heading_lost_rad", limits.heading_lost_rad, "rad",
                                 "Standard deviation from which it is lost");
  const auto count = [&context](std::string_view name, std::size_t fallback,
                                std::string description) {
    return context
        .param<std::size_t>(name,
                            {.fallback = fallback, .min = 1, .description = std::move(description)})
        .get();
  };
  limits.rejected_uncertain =
      count("rejected_uncertain", limits.rejected_uncertain,
            "Number of consecutive rejected fixes after which it is uncertain");
  limits.rejected_lost = count("rejected_lost", limits.rejected_lost,
                               "Number of consecutive rejected fixes after which it is lost");
  limits.input_lost_s = read("input_lost_s", limits.input_lost_s, "s",
                             "Time without motion or vehicle state after which it is lost");
  return limits;
}

using Doubles = google::protobuf::RepeatedField<double>;

template <typename Matrix>
void write(const Matrix& matrix, Doubles& doubles) {
  doubles.Assign(matrix.data(), matrix.data() + matrix.size());
}

/// Leaves `matrix` as it is where the sizes differ.
template <typename Matrix>
void read(const Doubles& doubles, Matrix& matrix) {
  if (doubles.size() == matrix.size()) {
    std::copy(doubles.begin(), doubles.end(), matrix.data());
  }
}

void write(const PoseFilter::Memory& memory, localization::PoseMemory& message) {
  if (memory.time) {
    message.set_time_ns(memory.time->count());
  }
  message.set_wheel_speed_mps(memory.wheel_speed_mps);
  message.set_yaw_rate_radps(memory.yaw_rate_radps);
  message.set_standing_s(memory.standing_s);
  for (const PoseFilter::Step& step : memory.steps) {
    localization::Step& its = *message.add_steps();
    its.set_duration_s(step.duration_s);
    its.set_wheel_speed_mps(step.wheel_speed_mps);
    its.set_yaw_rate_radps(step.yaw_rate_radps);
  }
  message.set_steps_s(memory.steps_s);
  message.set_has_position(memory.has_position);
  message.set_has_heading(memory.has_heading);
  message.set_outliers_in_a_row(memory.outliers_in_a_row);
  write(memory.state, *message.mutable_state());
  write(memory.covariance, *message.mutable_covariance());
}

PoseFilter::Memory read(const localization::PoseMemory& message) {
  PoseFilter::Memory memory;
  if (message.has_time_ns()) {
    memory.time = std::chrono::nanoseconds(message.time_ns());
  }
  memory.wheel_speed_mps = message.wheel_speed_mps();
  memory.yaw_rate_radps = message.yaw_rate_radps();
  memory.standing_s = message.standing_s();
  for (const localization::Step& step : message.steps()) {
    memory.steps.push_back({.duration_s = step.duration_s(),
                            .wheel_speed_mps = step.wheel_speed_mps(),
                            .yaw_rate_radps = step.yaw_rate_radps()});
  }
  memory.steps_s = message.steps_s();
  memory.has_position = message.has_position();
  memory.has_heading = message.has_heading();
  memory.outliers_in_a_row = message.outliers_in_a_row();
  read(message.state(), memory.state);
  read(message.covariance(), memory.covariance);
  return memory;
}

void write(const SpeedFilter::Memory& memory, localization::SpeedMemory& message) {
  if (memory.time) {
    message.set_time_ns(memory.time->count());
  }
  write(memory.state, *message.mutable_state());
  write(memory.covariance, *message.mutable_covariance());
}

SpeedFilter::Memory read(const localization::SpeedMemory& message) {
  SpeedFilter::Memory memory;
  if (message.has_time_ns()) {
    memory.time = std::chrono::nanoseconds(message.time_ns());
  }
  read(message.state(), memory.state);
  read(message.covariance(), memory.covariance);
  return memory;
}

}  // namespace

Localization::Localization(fastcycle::Context& context)
    : Component(context),
      limits_(read_limits(context)),
      wheelbase_m_(
          context.param<double>("wheelbase_m", {.fallback = 2.58,
                                                .min = 0.1,
                                                .max = 20.0,
                                                .unit = "m",
                                                .description = "Distance between the axles"})),
      steering_noise_radps_(context.param<double>(
          "steering_noise_radps",
          {.fallback = 0.02,
           .min = 1e-6,
           .max = 10.0,
           .unit = "rad/s",
           .description = "Error of the yaw rate from steering, when driving straight"})),
      steering_noise_share_(context.param<double>(
          "steering_noise_share", {.fallback = 0.1,
                                   .min = 0.0,
                                   .max = 1.0,
                                   .unit = "1",
                                   .description = "Additional error, as a share of the yaw rate"})),
      pose_(read_pose_config(context)),
      speed_(read_speed_config(context)),
      egos_(context.create_publisher<localization::Ego>("localization/ego")),
      state_(context.state<localization::FilterState>("filter",
                                                      [this](auto& state) { save(state); })) {
  load(*state_);
  context.create_subscriber<mission::InitialPose>(
      "mission/initial_pose", [this](const mission::InitialPose& pose) { on_initial_pose(pose); });
  context.create_subscriber<gnss::Position>(
      "gnss/position", [this](const gnss::Position& position) { on_position(position); });
  context.create_subscriber<motion::Imu>("imu/motion",
                                         [this](const motion::Imu& imu) { on_motion(imu); });
  context.create_subscriber<vehicle::State>(
      "vehicle/state", [this](const vehicle::State& state) { on_vehicle_state(state); });
}

void Localization::save(localization::FilterState& state) const {
  write(pose_.memory(), *state.mutable_pose());
  write(speed_.memory(), *state.mutable_speed());
  const auto write_time = [&state](const std::optional<Time>& time, auto set) {
    if (time) {
      (state.*set)(time->count());
    }
  };
  write_time(first_taken_, &localization::FilterState::set_first_taken_ns);
  write_time(received_.motion, &localization::FilterState::set_received_motion_ns);
  write_time(received_.vehicle_state, &localization::FilterState::set_received_vehicle_state_ns);
  write_time(received_.fix, &localization::FilterState::set_received_fix_ns);
  write_time(received_.good_fix, &localization::FilterState::set_received_good_fix_ns);
  state.set_newest_ns(newest_.count());
  state.set_fixes(fix_count_);
  state.set_fixes_rejected(rejected_count_);
  state.set_inputs_invalid(invalid_count_);
  state.set_estimates_lost(lost_count_);
  state.set_estimates_uncertain(uncertain_count_);
}

void Localization::load(const localization::FilterState& state) {
  if (!state.has_pose()) {
    return;  // It begins.
  }
  pose_.set_memory(read(state.pose()));
  speed_.set_memory(read(state.speed()));
  const auto read_time = [](bool is_there, std::int64_t ns) {
    return is_there ? std::optional(Time(ns)) : std::nullopt;
  };
  first_taken_ = read_time(state.has_first_taken_ns(), state.first_taken_ns());
  received_.motion = read_time(state.has_received_motion_ns(), state.received_motion_ns());
  received_.vehicle_state =
      read_time(state.has_received_vehicle_state_ns(), state.received_vehicle_state_ns());
  received_.fix = read_time(state.has_received_fix_ns(), state.received_fix_ns());
  received_.good_fix = read_time(state.has_received_good_fix_ns(), state.received_good_fix_ns());
  newest_ = Time(state.newest_ns());
  fix_count_ = state.fixes();
  rejected_count_ = state.fixes_rejected();
  invalid_count_ = state.inputs_invalid();
  lost_count_ = state.estimates_lost();
  uncertain_count_ = state.estimates_uncertain();
}

void Localization::stop() {
  report("fixes", fix_count_);
  report("fixes_rejected", rejected_count_);
  report("inputs_invalid", invalid_count_);
  report("estimates_uncertain", uncertain_count_);
  report("estimates_lost", lost_count_);
  if (pose_.has_position()) {
    report("wheel_scale", pose_.estimate().wheel_scale);
    report("gyro_bias_radps", pose_.estimate().gyro_bias_radps);
  }
}

template <typename Measurement>
Localization::Time Localization::time_of(const Measurement& message) {
  const Time taken(message.header().taken_ns());
  if (!first_taken_) {
    first_taken_ = taken;
  }
  return taken - *first_taken_;
}

void Localization::on_initial_pose(const mission::InitialPose& pose) {
  const KnownPose known{.position_m = {pose.x_m(), pose.y_m()},
                        .yaw_rad = pose.heading_rad(),
                        .speed_mps = pose.speed_mps(),
                        .position_stddev_m = std::max(pose.position_stddev_m(), 1e-3),
                        .yaw_stddev_rad = std::max(pose.heading_stddev_rad(), 1e-4)};
  if (!known.position_m.allFinite() || !std::isfinite(known.yaw_rad) ||
      !std::isfinite(known.speed_mps) || !std::isfinite(known.position_stddev_m) ||
      !std::isfinite(known.yaw_stddev_rad)) {
    ++invalid_count_;
    return;
  }
  const Time taken = time_of(pose);
  if (pose_.has_position() && taken + kPoseAgeMax < newest_) {
    return;  // That of the begin, again: this or its sender was restarted.
  }
  newest_ = std::max(newest_, taken);
  pose_.on_known_pose(newest_, known);
  received_.good_fix = newest_;
}

// Whether it is later than the last one of its source; else that is frozen.
bool Localization::take(std::optional<Time>& last, Time taken) {
  if (last && taken <= *last) {
    ++invalid_count_;
    return false;
  }
  last = taken;
  return true;
}

void Localization::on_position(const gnss::Position& position) {
  const PlaneFix fix{.position_m = {position.x_m(), position.y_m()}, .yaw_rad = std::nullopt};
  if (!fix.position_m.allFinite()) {
    ++invalid_count_;
    return;
  }
  if (!pose_.has_position()) {
    return;  // It has no heading: the initial pose comes from the mission.
  }
  const Time taken = time_of(position);
  if (!take(received_.fix, taken)) {
    return;
  }
  newest_ = std::max(newest_, taken);
  ++fix_count_;
  if (pose_.on_fix(newest_, newest_ - taken, fix)) {
    received_.good_fix = newest_;
  } else {
    ++rejected_count_;
  }
}

void Localization::on_motion(const motion::Imu& imu) {
  const double yaw_rate_radps = imu.angular_rate_radps().z();
  const double forward_mps2 = imu.acceleration_mps2().x();
  if (!imu.has_angular_rate_radps() || !imu.has_acceleration_mps2() ||
      !std::isfinite(yaw_rate_radps) || !std::isfinite(forward_mps2)) {
    ++invalid_count_;
    return;
  }
  const Time taken = time_of(imu);
  if (!take(received_.motion, taken)) {
    return;
  }
  newest_ = std::max(newest_, taken);
  pose_.on_yaw_rate(newest_, yaw_rate_radps);
  speed_.on_acceleration(newest_, forward_mps2);
  publish();
}

void Localization::on_vehicle_state(const vehicle::State& state) {
  if (!std::isfinite(state.speed_mps()) || !std::isfinite(state.steering_rad())) {
    ++invalid_count_;
    return;
  }
  newest_ = std::max(newest_, time_of(state));
  received_.vehicle_state = newest_;
  const double steered = state.speed_mps() * std::tan(state.steering_rad()) / wheelbase_m_.get();
  const double noise =
      steering_noise_radps_.get() + steering_noise_share_.get() * std::abs(steered);
  if (received_.motion && newest_ - *received_.motion > kSilent) {
    pose_.on_steering_alone(newest_, steered, noise);
  }
  pose_.on_wheel_speed(newest_, state.speed_mps());
  speed_.on_wheel_speed(newest_, state.speed_mps());
  if (received_.motion && newest_ - *received_.motion <= kSilent) {
    pose_.on_steered_yaw_rate(newest_, steered, noise);
  }
  // Else it is published with the next motion.
  if (std::chrono::duration<double>(newest_ - received_.motion.value_or(newest_)).count() >
      limits_.input_lost_s) {
    publish();
  }
}

void Localization::publish() {
  auto ego = egos_.loan();
  ego->mutable_header()->set_taken_ns((*first_taken_ + newest_).count());
  ego->mutable_header()->set_frame("map");
  if (!pose_.has_position()) {
    ego->set_quality(localization::INITIALIZING);
    ego->set_reason("there was no mission/initial_pose");
    egos_.publish(std::move(ego));
    return;
  }
  PoseEstimate estimate = pose_.estimate();
  estimate.covariance(3, 3) += speed_.speed_variance();
  ego->set_x_m(estimate.position_m.x());
  ego->set_y_m(estimate.position_m.y());
  ego->set_heading_rad(estimate.yaw_rad);
  const bool has_speed = received_.vehicle_state.has_value();
  ego->set_speed_mps(has_speed ? estimate.wheel_scale * speed_.speed_mps() : estimate.speed_mps);
  ego->set_acceleration_mps2(has_speed ? speed_.acceleration_mps2() : 0.0);
  ego->set_yaw_rate_radps(estimate.yaw_rate_radps);
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 5; ++column) {
      ego->add_covariance(estimate.covariance(row, column));
    }
  }
  const Judgement judgement = judge_estimate(estimate);
  ego->set_quality(judgement.quality);
  ego->set_reason(judgement.reason);
  uncertain_count_ += judgement.quality == localization::UNCERTAIN ? 1 : 0;
  lost_count_ += judgement.quality == localization::LOST ? 1 : 0;
  egos_.publish(std::move(ego));
}

Judgement Localization::judge_estimate(const PoseEstimate& estimate) const {
  const auto since = [this](const std::optional<Time>& received) {
    return std::chrono::duration<double>(newest_ - received.value_or(Time(0))).count();
  };
  return judge(limits_, {.since_fix_s = since(received_.good_fix),
                         .position_stddev_m = std::sqrt(
                             std::max(estimate.covariance(0, 0), estimate.covariance(1, 1))),
                         .heading_stddev_rad = std::sqrt(estimate.covariance(2, 2)),
                         .rejected = pose_.outliers_in_a_row(),
                         .since_vehicle_state_s = since(received_.vehicle_state),
                         .since_motion_s = since(received_.motion)});
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Localization)
