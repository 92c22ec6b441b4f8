#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <fastcycle/fastcycle.h>

#include "can/frame.pb.h"
#include "common/dbc.h"
#include "vehicle/motion.pb.h"

namespace rav4 {

/// A signal of a CAN message, read in SI units.
class Quantity {
 public:
  Quantity(const ads::DbcMessage& message, const std::string& name)
      : signal_(message.signal(name)), si_per_unit_(ads::si_per_unit(signal_.unit)) {}

  [[nodiscard]] double decode(std::span<const std::uint8_t> payload) const {
    return signal_.decode(payload) * si_per_unit_;
  }

 private:
  ads::DbcSignal signal_;
  double si_per_unit_;
};

/// The location of the wheel speeds.
struct WheelRules {
  std::uint32_t address;
  std::size_t byte_count;
  Quantity front_left;
  Quantity front_right;
  Quantity rear_left;
  Quantity rear_right;
};

/// The location of the steering angle: the sum of a coarse and a fine signal.
struct SteeringRules {
  std::uint32_t address;
  std::size_t byte_count;
  Quantity angle;
  Quantity fraction;
};

/// Decodes the car's motion from its CAN frames, as defined by a DBC file.
///
/// In:   `can/frames`
/// Out:  `vehicle/wheel_speeds`, `vehicle/steering`, one message for each CAN frame that has it
class Vehicle final : public fastcycle::Component {
 public:
  explicit Vehicle(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  static fastcycle::Param<std::string> name(fastcycle::Context& context, std::string_view param,
                                            const std::string& fallback);
  void on_frame(const can::Frame& frame);
  bool is_whole(const can::Frame& frame, std::size_t byte_count);
  void publish_wheel_speeds(const can::Frame& frame);
  void publish_steering(const can::Frame& frame);

  fastcycle::Param<fastcycle::Path> dbc_;
  fastcycle::Param<std::uint32_t> bus_;
  fastcycle::Param<std::string> wheel_message_;
  fastcycle::Param<std::string> front_left_;
  fastcycle::Param<std::string> front_right_;
  fastcycle::Param<std::string> rear_left_;
  fastcycle::Param<std::string> rear_right_;
  fastcycle::Param<std::string> steering_message_;
  fastcycle::Param<std::string> steering_angle_;
  fastcycle::Param<std::string> steering_fraction_;
  fastcycle::Publisher<vehicle::WheelSpeeds> wheel_speeds_;
  fastcycle::Publisher<vehicle::Steering> steering_;

  std::optional<WheelRules> wheel_rules_;
  std::optional<SteeringRules> steering_rules_;
  std::int64_t short_frames_ = 0;
};

}  // namespace rav4
