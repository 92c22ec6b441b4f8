#include "can_bus.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>

namespace ads {
namespace {

constexpr double kSilence_s = 0.5;

}  // namespace

CanBusComponent::CanBusComponent(fastcycle::Context& context)
    : DeviceComponent(context, kSilence_s),
      interface_(context.param<std::string>(
          "interface",
          {.fallback = "can0", .description = "Linux network interface, as listed by `ip link`"})),
      fake_(context.param<fastcycle::Path>(
          "fake", {.fallback = fastcycle::Path(),
                   .description = "Path of two sockets that replace the bus; empty: none"})),
      bus_number_(context.param<std::uint32_t>(
          "bus", {.fallback = 0, .max = 127, .description = "Bus number of the published frames"})),
      command_age_max_s_(context.param<double>(
          "command_age_max_s", {.fallback = 0.1,
                                .min = 0.001,
                                .max = 10.0,
                                .unit = "s",
                                .description = "Maximum age of a command that is sent"})),
      frames_(context.create_external_publisher<can::Frame>("can/state")) {
  context.create_subscriber<can::Frame>("can/command",
                                        [this](const can::Frame& frame) { on_command(frame); });
  create_device_thread(context, "can_bus", [this]() -> Device& { return *bus_; });
}

void CanBusComponent::start() {
  auto sink = [this](const can_frame& frame) { return receive(frame); };
  if (fake_.get().empty()) {
    bus_ = std::make_unique<SocketCanBus>(interface_.get(), std::move(sink));
  } else {
    bus_ = std::make_unique<FakeCanBus>(FakeCanBus::ads_end(fake_.get()),
                                        FakeCanBus::vehicle_end(fake_.get()), std::move(sink));
  }
}

bool CanBusComponent::receive(const can_frame& frame) {
  if ((frame.can_id & CAN_ERR_FLAG) != 0) {
    receive_error(frame);
    return false;
  }
  if ((frame.can_id & CAN_RTR_FLAG) != 0) {
    return false;  // Somebody asks for a frame; it has no data.
  }
  const bool is_extended = (frame.can_id & CAN_EFF_FLAG) != 0;
  const fastcycle::Time taken = frames_.now();
  auto message = frames_.loan();
  message->mutable_header()->set_taken_ns(taken.time_since_epoch().count());
  message->set_address(frame.can_id & (is_extended ? CAN_EFF_MASK : CAN_SFF_MASK));
  message->set_is_extended(is_extended);
  message->set_bus(bus_number_.get());
  message->mutable_data()->assign(frame.data, frame.data + frame.can_dlc);
  frames_.publish(std::move(message), taken);
  ++received_;
  return true;
}

// Each class of errors is logged once; bus-off is the device's trouble until a frame arrives again.
void CanBusComponent::receive_error(const can_frame& frame) {
  const CanError error = can_error_of(frame);
  ++errors_;
  if (error.is_bus_off) {
    ++bus_offs_;
    trouble().set(fmt::format("{}: {}", bus_->name(), error.text));
  }
  const std::uint32_t classes = frame.can_id & CAN_ERR_MASK;
  if ((classes & ~errors_seen_) != 0) {
    errors_seen_ |= classes;
    log().warning("{}: {}", bus_->name(), error.text);
  }
}

void CanBusComponent::on_command(const can::Frame& command) {
  const bool is_extended = command.is_extended() || command.address() > CAN_SFF_MASK;
  if (command.address() > CAN_EFF_MASK || command.data().size() > CAN_MAX_DLEN) {
    ++invalid_;
    return;
  }
  const fastcycle::Time taken(fastcycle::Duration(command.header().taken_ns()));
  if (now() - taken > std::chrono::duration<double>(command_age_max_s_.get())) {
    ++too_old_;
    return;
  }
  can_frame frame{};
  frame.can_id = command.address() | (is_extended ? CAN_EFF_FLAG : 0U);
  frame.can_dlc = static_cast<__u8>(command.data().size());
  std::ranges::copy(command.data(), frame.data);
  const std::string why_not = observe("sent", [&] { return bus_->send(frame); });
  set_trouble(why_not);
  ++(why_not.empty() ? sent_ : unsent_);
}

void CanBusComponent::stop() {
  report("frames_received", received_.load());
  report("error_frames", errors_.load());
  report("bus_offs", bus_offs_.load());
  report("commands_sent", sent_);
  report("commands_unsent", unsent_);
  report("commands_too_old", too_old_);
  report("commands_invalid", invalid_);
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::CanBusComponent)
