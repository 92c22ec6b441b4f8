#pragma once

#include <Eigen/Core>
#include <fastcycle/fastcycle.h>

namespace ads {

/// Declares the params `mount_roll_rad`, `mount_pitch_rad` and `mount_yaw_rad` of a sensor, and
/// returns the rotation from its axes to the vehicle's (x forward, y left, z up): about z, then the
/// new y, then the new x.
Eigen::Matrix3f read_mount_rotation(fastcycle::Context& context);

/// Declares `mount_forward_m`: the sensor's distance ahead of the vehicle's centre.
double read_mount_forward_m(fastcycle::Context& context);
/// Declares `mount_height_m`, which is required: the sensor's height above the ground.
double read_mount_height_m(fastcycle::Context& context);

}  // namespace ads
