#include "vehicle.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <span>
#include <utility>

#include <fmt/format.h>

namespace ads {
namespace {

// Some frames may be bad; a tenth of a second without a good one is a bus that cannot be trusted.
constexpr std::int64_t kRefusedInARowMax = 10;

std::span<const std::uint8_t> payload_of(const can::Frame& frame) {
  return {reinterpret_cast<const std::uint8_t*>(frame.data().data()), frame.data().size()};
}

bool is_driving_by_itself(supervision::DrivingState state) {
  return state == supervision::ENGAGED || state == supervision::ENGAGED_DEGRADED ||
         state == supervision::MINIMAL_RISK_STOP || state == supervision::STOPPED;
}

}  // namespace

Vehicle::Bus::Bus(const Dbc& dbc)
    : command(dbc.message("ADS_COMMAND")),
      state(dbc.message("VEHICLE_STATE")),
      command_guard(command),
      state_guard(state) {
  // Said at the start, not when the first frame comes.
  for (const char* const signal : {"STEERING", "ACCELERATION", "AUTONOMOUS"}) {
    (void)command.signal(signal);
    (void)state.signal(signal);
  }
  (void)state.signal("SPEED");
  const auto its = std::ranges::find(dbc.messages(), "DRIVER_INPUT", &DbcMessage::name);
  if (its != dbc.messages().end()) {
    driver = *its;
    driver_guard.emplace(*driver);
    for (const char* const signal : {"STEERING_TORQUE", "BRAKE_PEDAL", "TAKEOVER_BUTTON"}) {
      (void)driver->signal(signal);
    }
  }
}

Vehicle::Vehicle(fastcycle::Context& context)
    : Component(context),
      dbc_(context.param<fastcycle::Path>("dbc", {.description = "The DBC file of the bus"})),
      supervision_age_max_s_(context.param<double>(
          "supervision_age_max_s",
          {.fallback = 0.5,
           .min = 0.01,
           .max = 10.0,
           .unit = "s",
           .description =
               "Time without supervision messages after which only stop commands are sent"})),
      driver_torque_nm_(context.param<double>(
          "driver_torque_nm",
          {.fallback = 3.0,
           .min = 0.1,
           .max = 20.0,
           .unit = "Nm",
           .description = "Steering torque from which the driver overrides such a stop too"})),
      driver_brake_pedal_(context.param<double>(
          "driver_brake_pedal",
          {.fallback = 0.05,
           .min = 0.001,
           .max = 1.0,
           .unit = "1",
           .description = "Brake pedal position from which the driver overrides such a stop too"})),
      states_(context.create_publisher<vehicle::State>("vehicle/state")),
      drivers_(context.create_publisher<vehicle::DriverInput>("vehicle/driver")),
      frames_(context.create_publisher<can::Frame>("can/command")),
      supervision_(context.create_latest<supervision::State>("supervision/state")) {
  context.create_subscriber<can::Frame>("can/state",
                                        [this](const can::Frame& frame) { on_frame(frame); });
  context.create_subscriber<control::Command>(
      "control/command", [this](const control::Command& command) { on_command(command); });
}

void Vehicle::start() {
  bus_.emplace(Dbc::read(dbc_.get()));
}

void Vehicle::stop() {
  report("frames_received", received_);
  report("frames_refused", refused_);
  report("frames_lost", static_cast<std::int64_t>(bus_->state_guard.lost()));
  report("driver_frames_refused", driver_refused_);
  report("commands_sent", sent_);
  report("commands_sent_autonomous", sent_autonomous_);
  report("commands_withheld", withheld_);
  report("commands_invalid", invalid_);
  report("commands_repeated", repeated_);
}

void Vehicle::on_frame(const can::Frame& frame) {
  if (bus_->driver && frame.address() == bus_->driver->address) {
    on_driver(frame);
    return;
  }
  if (frame.address() != bus_->state.address) {
    return;
  }
  ++received_;
  const auto payload = payload_of(frame);
  const FrameGuard::Verdict verdict = bus_->state_guard.check(payload);
  if (verdict != FrameGuard::Verdict::kGood) {
    refuse(frame, verdict);
    return;
  }
  if (refused_in_a_row_ > kRefusedInARowMax) {
    health(fastcycle::Health::kOk);
  }
  refused_in_a_row_ = 0;
  auto state = states_.loan();
  state->mutable_header()->set_taken_ns(frame.header().taken_ns());
  state->set_speed_mps(bus_->state.signal("SPEED").decode(payload));
  state->set_steering_rad(bus_->state.signal("STEERING").decode(payload));
  state->set_acceleration_mps2(bus_->state.signal("ACCELERATION").decode(payload));
  state->set_is_autonomous(bus_->state.signal("AUTONOMOUS").decode(payload) != 0.0);
  states_.publish(std::move(state));
}

// A frame that is refused is none: supervision misses it.
void Vehicle::on_driver(const can::Frame& frame) {
  const auto payload = payload_of(frame);
  if (bus_->driver_guard->check(payload) != FrameGuard::Verdict::kGood) {
    ++driver_refused_;
    return;
  }
  const double percent = bus_->driver->signal("BRAKE_PEDAL").decode(payload);
  auto input = drivers_.loan();
  input->mutable_header()->set_taken_ns(frame.header().taken_ns());
  input->set_steering_torque_nm(bus_->driver->signal("STEERING_TORQUE").decode(payload));
  input->set_brake_pedal(0.01 * percent);
  input->set_takeover_button(bus_->driver->signal("TAKEOVER_BUTTON").decode(payload) != 0.0);
  if (input->takeover_button() || input->brake_pedal() >= driver_brake_pedal_.get() ||
      std::abs(input->steering_torque_nm()) >= driver_torque_nm_.get()) {
    driver_acted_ = now();
  }
  drivers_.publish(std::move(input));
}

void Vehicle::refuse(const can::Frame& frame, FrameGuard::Verdict verdict) {
  ++refused_;
  ++refused_in_a_row_;
  if (refused_in_a_row_ == kRefusedInARowMax + 1) {
    health(fastcycle::Health::kDegraded,
           fmt::format("{} frames of address {} in a row were refused, the last one for its {}",
                       refused_in_a_row_, frame.address(), text_of(verdict)));
  }
}

void Vehicle::on_command(const control::Command& command) {
  if (!std::isfinite(command.steering_rad()) || !std::isfinite(command.acceleration_mps2())) {
    ++invalid_;
    return;
  }
  // One that repeats would go on for ever: a curve's steering, long after the curve.
  if (command_ns_ && command.header().taken_ns() <= *command_ns_) {
    ++repeated_;
    return;
  }
  command_ns_ = command.header().taken_ns();
  const auto state = supervision_.get();
  bool is_engaged = state && is_driving_by_itself(state->state());
  const auto age_max = std::chrono::duration<double>(supervision_age_max_s_.get());
  if (is_engaged && *supervision_.age() > age_max) {
    if (driver_acted_ && *driver_acted_ > now() - *supervision_.age()) {
      is_engaged = false;  // The driver has taken over from a stop of control alone.
    } else if (!command.is_stopping_alone()) {
      ++withheld_;
      return;
    }
  }
  const bool is_autonomous = is_engaged && command.is_autonomous();
  std::array<std::uint8_t, 64> bytes{};
  const std::span payload = std::span(bytes).first(bus_->command.byte_count);
  bus_->command.signal("STEERING").encode(command.steering_rad(), payload);
  bus_->command.signal("ACCELERATION").encode(command.acceleration_mps2(), payload);
  bus_->command.signal("AUTONOMOUS").encode(is_autonomous ? 1.0 : 0.0, payload);
  bus_->command_guard.seal(payload);
  auto frame = frames_.loan();
  frame->mutable_header()->set_taken_ns(command.header().taken_ns());
  frame->set_address(bus_->command.address);
  frame->mutable_data()->assign(payload.begin(), payload.end());
  frames_.publish(std::move(frame));
  ++sent_;
  sent_autonomous_ += is_autonomous ? 1 : 0;
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Vehicle)
