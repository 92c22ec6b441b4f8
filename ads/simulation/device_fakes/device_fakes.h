#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fastcycle/fastcycle.h>
#include <netinet/in.h>

#include "can/frame.pb.h"
#include "common/geodesy.h"
#include "devices/can_bus/bus.h"
#include "devices/device_component.h"
#include "devices/velodyne/encoder.h"
#include "gnss/position.pb.h"
#include "lidar/sweep.pb.h"

namespace ads {

/// Emulates the devices of a vehicle: sends the measurements of simulated sensors in the format of
/// real devices, and connects the vehicle's end of a fake CAN bus to the simulated vehicle.
///
/// In:   `fake/lidar/points`, as UDP packets; `fake/gnss/position`, as NMEA on a pseudo terminal;
///       `fake/can/state`, as frames
/// Out:  `fake/can/command`, frames sent by the ADS
class DeviceFakes final : public DeviceComponent {
 public:
  explicit DeviceFakes(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  using Bytes = std::vector<std::uint8_t>;

  void on_sweep(const lidar::Sweep& sweep);
  void send_some();
  void on_position(const gnss::Position& position);
  void on_state(const can::Frame& frame);
  [[nodiscard]] bool receive(const can_frame& frame);

  fastcycle::Param<velodyne::ModelKind> lidar_model_;
  fastcycle::Param<std::string> lidar_address_;
  fastcycle::Param<int> lidar_port_;
  fastcycle::Param<fastcycle::Path> gnss_line_;
  fastcycle::Param<fastcycle::Path> can_;
  GeodeticPosition origin_;
  fastcycle::ExternalPublisher<can::Frame> commands_;
  fastcycle::Timer timer_;

  Descriptor socket_;
  sockaddr_in to_{};
  std::optional<velodyne::PacketEncoder> encoder_;
  std::deque<Bytes> packets_;
  Descriptor line_;
  std::optional<LocalFrame> map_;
  std::unique_ptr<CanBus> bus_;
  std::int64_t packets_sent_ = 0;
  std::int64_t fixes_sent_ = 0;
  std::int64_t frames_sent_ = 0;
};

}  // namespace ads
