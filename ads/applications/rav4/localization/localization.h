#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include <fastcycle/fastcycle.h>

#include "common/geodesy.h"
#include "common/pose_filter.h"
#include "gnss/fix.pb.h"
#include "level.h"
#include "localization/pose.pb.h"
#include "motion/motion.pb.h"
#include "receiver_clock.h"
#include "vehicle/motion.pb.h"

namespace rav4 {

/// Estimates the car's pose from fixes, wheel speeds and turn rates; see `PoseFilter`.
///
/// In:   `gnss/fix`, `imu/accelerometer`, `imu/gyro`, `vehicle/wheel_speeds`
/// Out:  `localization/pose`, with every wheel speed message from the first fix on
class Localization final : public fastcycle::Component {
 public:
  explicit Localization(fastcycle::Context& context);
  void stop() override;

 private:
  // The filter's times: since the first message, so that they are small.
  template <typename Measurement>
  std::chrono::nanoseconds time_of(const Measurement& message) {
    const std::chrono::nanoseconds taken(message.header().taken_ns());
    if (!first_taken_) {
      first_taken_ = taken;
    }
    return taken - *first_taken_;
  }

  void on_fix(const gnss::Fix& message);
  void on_acceleration(const motion::Imu& imu);
  void on_turn_rate(const motion::Imu& imu);
  void on_wheel_speeds(const vehicle::WheelSpeeds& speeds);
  void publish_pose();

  fastcycle::Param<double> fix_delay_s_;
  Level level_;
  ads::PoseFilter filter_;
  fastcycle::Publisher<localization::Pose> poses_;

  ReceiverClock receiver_clock_;
  std::optional<std::chrono::nanoseconds> first_taken_;
  std::optional<ads::LocalFrame> plane_;
  std::int64_t fixes_rejected_ = 0;
};

}  // namespace rav4
