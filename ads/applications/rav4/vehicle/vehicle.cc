#include "vehicle.h"

#include <numbers>
#include <utility>

namespace rav4 {
namespace {

constexpr double kDegPerRad = 180.0 / std::numbers::pi;

std::span<const std::uint8_t> payload_of(const can::Frame& frame) {
  return {reinterpret_cast<const std::uint8_t*>(frame.data().data()), frame.data().size()};
}

}  // namespace

Vehicle::Vehicle(fastcycle::Context& context)
    : Component(context),
      dbc_(context.param<fastcycle::Path>(
          "dbc", {.description = "The DBC file of the bus with the wheel speeds"})),
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

void Vehicle::start() {
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

void Vehicle::stop() {
  if (short_frames_ > 0) {
    report("vehicle_short_frames", short_frames_);
  }
}

fastcycle::Param<std::string> Vehicle::name(fastcycle::Context& context, std::string_view param,
                                            const std::string& fallback) {
  return context.param<std::string>(param,
                                    {.fallback = fallback, .description = "Name in the DBC file"});
}

void Vehicle::on_frame(const can::Frame& frame) {
  if (frame.bus() != bus_.get()) {
    return;
  }
  if (frame.address() == wheel_rules_->address && is_whole(frame, wheel_rules_->byte_count)) {
    publish_wheel_speeds(frame);
  }
  if (frame.address() == steering_rules_->address && is_whole(frame, steering_rules_->byte_count)) {
    publish_steering(frame);
  }
}

bool Vehicle::is_whole(const can::Frame& frame, std::size_t byte_count) {
  if (frame.data().size() >= byte_count) {
    return true;
  }
  ++short_frames_;
  health(fastcycle::Health::kDegraded, "CAN frames are shorter than the DBC file says");
  return false;
}

void Vehicle::publish_wheel_speeds(const can::Frame& frame) {
  const auto payload = payload_of(frame);
  auto speeds = wheel_speeds_.loan();
  speeds->mutable_header()->set_taken_ns(frame.header().taken_ns());
  speeds->set_front_left_mps(wheel_rules_->front_left.decode(payload));
  speeds->set_front_right_mps(wheel_rules_->front_right.decode(payload));
  speeds->set_rear_left_mps(wheel_rules_->rear_left.decode(payload));
  speeds->set_rear_right_mps(wheel_rules_->rear_right.decode(payload));
  wheel_speeds_.publish(std::move(speeds));
}

void Vehicle::publish_steering(const can::Frame& frame) {
  const auto payload = payload_of(frame);
  auto steering = steering_.loan();
  steering->mutable_header()->set_taken_ns(frame.header().taken_ns());
  steering->set_wheel_angle_deg(kDegPerRad * (steering_rules_->angle.decode(payload) +
                                              steering_rules_->fraction.decode(payload)));
  steering_.publish(std::move(steering));
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::Vehicle)
