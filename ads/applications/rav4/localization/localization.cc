#include "localization.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace rav4 {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

fastcycle::ParamOptions<double> positive(double fallback, std::string unit,
                                         std::string description) {
  return {.fallback = fallback,
          .min = 1e-9,
          .max = 1e9,
          .unit = std::move(unit),
          .description = std::move(description)};
}

ads::PoseFilterConfig read_filter_config(fastcycle::Context& context) {
  const ads::PoseFilterConfig standard;
  const auto value = [&context](std::string_view name, double fallback, std::string unit,
                                std::string description) {
    return context.param<double>(name, positive(fallback, std::move(unit), std::move(description)))
        .get();
  };
  ads::PoseFilterConfig config;
  config.fix_bias_stddev_m = value("fix_bias_stddev_m", standard.fix_bias_stddev_m, "m",
                                   "Slow error of the receiver, 1 sigma per axis");
  config.fix_bias_time_s = value("fix_bias_time_s", standard.fix_bias_time_s, "s",
                                 "Correlation time of the slow error of the receiver");
  config.fix_noise_m = value("fix_noise_m", standard.fix_noise_m, "m",
                             "Independent error of each fix, 1 sigma per axis");
  config.wheel_scale_stddev = value("wheel_scale_stddev", standard.wheel_scale_stddev, "1",
                                    "Scale error of the wheel speed, 1 sigma");
  config.wheel_scale_walk_per_sqrt_s =
      value("wheel_scale_walk_per_sqrt_s", standard.wheel_scale_walk_per_sqrt_s, "1/sqrt(s)",
            "Random walk of the wheel scale");
  config.distance_walk_m_per_sqrt_s =
      value("distance_walk_m_per_sqrt_s", standard.distance_walk_m_per_sqrt_s, "m/sqrt(s)",
            "Random walk of the position along the heading");
  config.slip_walk_m_per_sqrt_s =
      value("slip_walk_m_per_sqrt_s", standard.slip_walk_m_per_sqrt_s, "m/sqrt(s)",
            "Random walk of the position across the heading");
  config.yaw_walk_rad_per_sqrt_s =
      value("yaw_walk_rad_per_sqrt_s", standard.yaw_walk_rad_per_sqrt_s, "rad/sqrt(s)",
            "Random walk of the yaw angle: noise of the gyroscope");
  config.gyro_bias_stddev_radps = value("gyro_bias_stddev_radps", standard.gyro_bias_stddev_radps,
                                        "rad/s", "Bias of the gyroscope, 1 sigma");
  config.gyro_bias_walk_radps_per_sqrt_s =
      value("gyro_bias_walk_radps_per_sqrt_s", standard.gyro_bias_walk_radps_per_sqrt_s,
            "rad/s/sqrt(s)", "Random walk of the gyroscope's offset");
  config.gyro_noise_radps = value("gyro_noise_radps", standard.gyro_noise_radps, "rad/s",
                                  "Noise of one measurement of the gyroscope, 1 sigma");
  config.course_stddev_rad = value("course_stddev_rad", standard.course_stddev_rad, "rad",
                                   "Error of the course that initializes the heading, 1 sigma");
  config.course_noise_rad = value("course_noise_rad", standard.course_noise_rad, "rad",
                                  "Noise of every later course, 1 sigma");
  config.course_speed_min_mps = value("course_speed_min_mps", standard.course_speed_min_mps, "m/s",
                                      "Minimum speed at which the receiver's course is used");
  config.rear_axle_to_point_m =
      context
          .param<double>(
              "rear_axle_to_point_m",
              {.fallback = standard.rear_axle_to_point_m,
               .min = -10.0,
               .max = 10.0,
               .unit = "m",
               .description = "Distance of the estimated point in front of the rear axle"})
          .get();
  return config;
}

bool is_usable(const gnss::Fix& fix) {
  return std::isfinite(fix.latitude_deg()) && std::abs(fix.latitude_deg()) <= 90.0 &&
         std::isfinite(fix.longitude_deg()) && std::abs(fix.longitude_deg()) <= 360.0 &&
         std::isfinite(fix.altitude_m()) && std::abs(fix.altitude_m()) < 1e5 &&
         (fix.latitude_deg() != 0.0 || fix.longitude_deg() != 0.0);
}

}  // namespace

Localization::Localization(fastcycle::Context& context)
    : Component(context),
      fix_delay_s_(context.param<double>(
          "fix_delay_s", {.fallback = 0.0,
                          .min = 0.0,
                          .max = 1.0,
                          .unit = "s",
                          .description = "Mean age of a position when its fix arrives"})),
      level_(context
                 .param<double>("level_time_s",
                                positive(5.0, "s", "Time over which the vertical is averaged"))
                 .get()),
      filter_(read_filter_config(context)),
      poses_(context.create_publisher<localization::Pose>("localization/pose")) {
  context.create_subscriber<gnss::Fix>("gnss/fix", [this](const gnss::Fix& fix) { on_fix(fix); });
  context.create_subscriber<motion::Imu>("imu/accelerometer",
                                         [this](const motion::Imu& imu) { on_acceleration(imu); });
  context.create_subscriber<motion::Imu>("imu/gyro",
                                         [this](const motion::Imu& imu) { on_turn_rate(imu); });
  context.create_subscriber<vehicle::WheelSpeeds>(
      "vehicle/wheel_speeds",
      [this](const vehicle::WheelSpeeds& speeds) { on_wheel_speeds(speeds); });
}

void Localization::stop() {
  report("fixes_rejected", fixes_rejected_);
  if (filter_.has_position()) {
    report("wheel_scale", filter_.estimate().wheel_scale);
    report("gyro_bias_radps", filter_.estimate().gyro_bias_radps);
  }
}

void Localization::on_fix(const gnss::Fix& message) {
  if (!is_usable(message)) {
    ++fixes_rejected_;
    return;
  }
  const ads::GeodeticPosition place{.latitude_deg = message.latitude_deg(),
                                    .longitude_deg = message.longitude_deg(),
                                    .altitude_m = message.altitude_m()};
  if (!plane_) {
    plane_.emplace(place);
  }
  ads::PlaneFix fix{.position_m = plane_->enu_from_geodetic(place).head<2>(),
                    .yaw_rad = std::nullopt,
                    .speed_mps = message.speed_mps()};
  if (std::isfinite(message.course_deg())) {
    fix.yaw_rad = (90.0 - message.course_deg()) * kRadPerDeg;
  }
  const auto arrival = time_of(message);
  const auto delay = std::chrono::nanoseconds(std::llround(fix_delay_s_.get() * 1e9)) +
                     receiver_clock_.lateness(arrival, message.utc_ms());
  fixes_rejected_ +=
      filter_.on_fix(arrival, std::max(delay, std::chrono::nanoseconds(0)), fix) ? 0 : 1;
}

void Localization::on_acceleration(const motion::Imu& imu) {
  if (imu.has_acceleration_mps2()) {
    const motion::Vector& vector = imu.acceleration_mps2();
    level_.on_acceleration(time_of(imu), {vector.x(), vector.y(), vector.z()});
  }
}

void Localization::on_turn_rate(const motion::Imu& imu) {
  const motion::Vector& vector = imu.angular_rate_radps();
  const double yaw_rate = level_.yaw_rate({vector.x(), vector.y(), vector.z()});
  if (imu.has_angular_rate_radps() && std::isfinite(yaw_rate)) {
    filter_.on_yaw_rate(time_of(imu), yaw_rate);
  }
}

void Localization::on_wheel_speeds(const vehicle::WheelSpeeds& speeds) {
  // The middle of the rear axle moves along the heading, with the mean speed of its two wheels.
  const double speed_mps = 0.5 * (speeds.rear_left_mps() + speeds.rear_right_mps());
  if (!std::isfinite(speed_mps)) {
    return;
  }
  filter_.on_wheel_speed(time_of(speeds), speed_mps);
  if (filter_.has_position()) {
    publish_pose();
  }
}

void Localization::publish_pose() {
  const ads::PoseEstimate estimate = filter_.estimate();
  auto pose = poses_.loan();
  pose->mutable_header()->set_taken_ns((*first_taken_ + estimate.time).count());
  pose->mutable_header()->set_frame("local_enu");
  pose->set_origin_latitude_deg(plane_->origin().latitude_deg);
  pose->set_origin_longitude_deg(plane_->origin().longitude_deg);
  pose->set_origin_altitude_m(plane_->origin().altitude_m);
  pose->set_east_m(estimate.position_m.x());
  pose->set_north_m(estimate.position_m.y());
  pose->set_east_mps(estimate.velocity_mps.x());
  pose->set_north_mps(estimate.velocity_mps.y());
  pose->set_yaw_rad(estimate.yaw_rad);
  pose->set_yaw_rate_radps(estimate.yaw_rate_radps);
  pose->set_has_heading(estimate.has_heading);
  pose->set_position_stddev_m(estimate.position_stddev_m);
  pose->set_yaw_stddev_rad(estimate.yaw_stddev_rad);
  pose->set_wheel_scale(estimate.wheel_scale);
  pose->set_gyro_bias_radps(estimate.gyro_bias_radps);
  poses_.publish(std::move(pose));
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::Localization)
