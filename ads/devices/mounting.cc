#include "mounting.h"

#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <Eigen/Geometry>

namespace ads {
namespace {

float read_angle(fastcycle::Context& context, std::string_view name, std::string description) {
  return static_cast<float>(context
                                .param<double>(name, {.fallback = 0.0,
                                                      .min = -std::numbers::pi,
                                                      .max = std::numbers::pi,
                                                      .unit = "rad",
                                                      .description = std::move(description)})
                                .get());
}

}  // namespace

Eigen::Matrix3f read_mount_rotation(fastcycle::Context& context) {
  using Axis = Eigen::Vector3f;
  const float roll = read_angle(context, "mount_roll_rad", "Of the sensor, about its x");
  const float pitch = read_angle(context, "mount_pitch_rad", "About its y");
  const float yaw = read_angle(context, "mount_yaw_rad", "About its z: how far left its x points");
  return (Eigen::AngleAxisf(yaw, Axis::UnitZ()) * Eigen::AngleAxisf(pitch, Axis::UnitY()) *
          Eigen::AngleAxisf(roll, Axis::UnitX()))
      .toRotationMatrix();
}

double read_mount_forward_m(fastcycle::Context& context) {
  return context
      .param<double>("mount_forward_m",
                     {.fallback = 0.0,
                      .min = -10.0,
                      .max = 10.0,
                      .unit = "m",
                      .description = "Distance of the sensor in front of the vehicle's centre"})
      .get();
}

double read_mount_height_m(fastcycle::Context& context) {
  return context
      .param<double>("mount_height_m", {.min = 0.0,
                                        .max = 10.0,
                                        .unit = "m",
                                        .description = "Height of the sensor above the ground"})
      .get();
}

}  // namespace ads
