#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "can/frame.pb.h"
#include "common/dbc.h"
#include "vehicle/motion.pb.h"

namespace rav4 {
namespace {

constexpr double kDegPerRad = 180.0 / std::numbers::pi;

/// A signal of a CAN message that is read in SI units.
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

// Where the wheel speeds are.
struct WheelRules {
  std::uint32_t address;
  std::size_t byte_count;
  Quantity front_left;
  Quantity front_right;
  Quantity rear_left;
  Quantity rear_right;
};

// Where the steering angle is: the sum of a coarse and a fine signal.
struct SteeringRules {
  std::uint32_t address;
  std::size_t byte_count;
  Quantity angle;
  Quantity fraction;
};

std::span<const std::uint8_t> payload_of(const can::Frame& frame) {
  return {reinterpret_cast<const std::uint8_t*>(frame.data().data()), frame.data().size()};
}

}  // namespace

/// Decodes what the car says of its motion, by the rules of a DBC file.
///
/// In:   `can/frames`
/// Out:  `vehicle/wheel_speeds`, `vehicle/steering`, one message for each CAN frame that has it
class Vehicle final : public fastcycle::Component {
 public:
  explicit Vehicle(fastcycle::Context& context)
      : Component(context),
        dbc_(context.param<fastcycle::Path>(
            "dbc", {.description = "The DBC file of the bus that has the wheel speeds"})),
        bus_(context.param<std::uint32_t>(
            "bus", {.fallback = 0, .max = 255, .description = "The number of that bus"})),
        wheel_message_(name(context, "wheel_message", "WHEEL_SPEEDS")),
        front_left_(name(context, "front_left", "WHEEL_SPEED_FL")),
        front_right_(name(context, "front_right", "WHEEL_SPEED_FR")),
        rear_left_(name(context, "rear_left", "WHEEL_SPEED_RL")),
        rear_right_(name(context, "rear_right", "WHEEL_SPEED_RR")),
        steering_message_(name(context, "steering_message", "STEER_ANGLE_SENSOR")),
        steering_angle_(name(context, "steering_angle", "STEER_ANGLE")),
        steering_fraction_(name(context, "steering_fraction", "STEER_FRACTION")),
        wheel_speeds_(context.create_publisher<vehicle::WheelSpeeds>("vehicle/wheel_speeds")),
        steering_(context.create_publisher<vehicle::Steering>("vehicle/steering")) {
    context.create_subscriber<can::Frame>("can/frames",
                                          [this](const can::Frame& frame) { on_frame(frame); });
  }

  void start() override {
    const ads::Dbc dbc = ads::Dbc::read(dbc_.get());
    const ads::DbcMessage& wheels = dbc.message(wheel_message_.get());
    wheel_rules_ = {.address = wheels.address,
                    .byte_count = wheels.byte_count,
                    .front_left = {wheels, front_left_.get()},
                    .front_right = {wheels, front_right_.get()},
                    .rear_left = {wheels, rear_left_.get()},
                    .rear_right = {wheels, rear_right_.get()}};
    const ads::DbcMessage& steering = dbc.message(steering_message_.get());
    steering_rules_ = {.address = steering.address,
                       .byte_count = steering.byte_count,
                       .angle = {steering, steering_angle_.get()},
                       .fraction = {steering, steering_fraction_.get()}};
  }

  void stop() override {
    if (short_frames_ > 0) {
      report("vehicle_short_frames", short_frames_);
    }
  }

 private:
  static fastcycle::Param<std::string> name(fastcycle::Context& context, std::string_view param,
                                            const std::string& fallback) {
    return context.param<std::string>(
        param, {.fallback = fallback, .description = "A name in the DBC file"});
  }

  void on_frame(const can::Frame& frame) {
    if (frame.bus() != bus_.get()) {
      return;
    }
    if (frame.address() == wheel_rules_->address && is_whole(frame, wheel_rules_->byte_count)) {
      publish_wheel_speeds(frame);
    }
    if (frame.address() == steering_rules_->address &&
        is_whole(frame, steering_rules_->byte_count)) {
      publish_steering(frame);
    }
  }

  bool is_whole(const can::Frame& frame, std::size_t byte_count) {
    if (frame.data().size() >= byte_count) {
      return true;
    }
    ++short_frames_;
    health(fastcycle::Health::kDegraded, "CAN frames are shorter than the DBC file says");
    return false;
  }

  void publish_wheel_speeds(const can::Frame& frame) {
    const auto payload = payload_of(frame);
    auto speeds = wheel_speeds_.loan();
    speeds->mutable_header()->set_taken_ns(frame.header().taken_ns());
    speeds->set_front_left_mps(wheel_rules_->front_left.decode(payload));
    speeds->set_front_right_mps(wheel_rules_->front_right.decode(payload));
    speeds->set_rear_left_mps(wheel_rules_->rear_left.decode(payload));
    speeds->set_rear_right_mps(wheel_rules_->rear_right.decode(payload));
    wheel_speeds_.publish(std::move(speeds));
  }

  void publish_steering(const can::Frame& frame) {
    const auto payload = payload_of(frame);
    auto steering = steering_.loan();
    steering->mutable_header()->set_taken_ns(frame.header().taken_ns());
    steering->set_wheel_angle_deg(kDegPerRad * (steering_rules_->angle.decode(payload) +
                                                steering_rules_->fraction.decode(payload)));
    steering_.publish(std::move(steering));
  }

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

FASTCYCLE_COMPONENT(rav4::Vehicle)
