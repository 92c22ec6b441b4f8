#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include <fastcycle/fastcycle.h>

#include "bus.h"
#include "can/frame.pb.h"
#include "devices/device_component.h"

namespace ads {

/// Connects a CAN bus to the application: publishes received frames, and sends commands.
///
/// In:   `can/command`
/// Out:  `can/state`, one message for each data frame of the bus
class CanBusComponent final : public DeviceComponent {
 public:
  explicit CanBusComponent(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  [[nodiscard]] bool receive(const can_frame& frame);
  void receive_error(const can_frame& frame);
  void on_command(const can::Frame& command);

  fastcycle::Param<std::string> interface_;
  fastcycle::Param<fastcycle::Path> fake_;
  fastcycle::Param<std::uint32_t> bus_number_;
  fastcycle::Param<double> command_age_max_s_;
  fastcycle::ExternalPublisher<can::Frame> frames_;

  std::unique_ptr<CanBus> bus_;
  std::uint32_t errors_seen_ = 0;  // Of the thread: error classes already logged.
  std::atomic<std::int64_t> received_ = 0;
  std::atomic<std::int64_t> errors_ = 0;
  std::atomic<std::int64_t> bus_offs_ = 0;
  std::int64_t sent_ = 0;
  std::int64_t unsent_ = 0;
  std::int64_t too_old_ = 0;
  std::int64_t invalid_ = 0;
};

}  // namespace ads
