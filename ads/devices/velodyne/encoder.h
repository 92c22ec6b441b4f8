#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>

#include "lidar/sweep.pb.h"
#include "model.h"
#include "packet.h"

namespace ads::velodyne {

/// Encodes the packets of a sensor, for tests and simulated devices.
///
/// @threads  Confined.
class PacketEncoder {
 public:
  /// Called with each packet, and with its time of sending, in ns after the time of the first
  /// firing added.
  using Sink = std::function<void(std::span<const std::uint8_t>, std::int64_t sent_ns)>;

  PacketEncoder(Model model, Sink sink) : model_(std::move(model)), sink_(std::move(sink)) {}

  /// Adds one firing of all lasers, in the order of the packets. `azimuth_deg` is clockwise from
  /// ahead, `time_us` since the hour of the sensor's clock.
  void add(double azimuth_deg, std::int64_t time_us, std::span<const Return> returns);

  /// Adds all columns of a sweep from a clockwise sensor whose rings are those of the model. The
  /// first is measured at `time_us`.
  void add(const lidar::Sweep& sweep, std::int64_t time_us);

  /// Starts a new packet; discards what was added since the last one.
  void restart() { firings_ = 0; }

 private:
  void add_vlp16(std::uint16_t azimuth, std::span<const Return> returns);
  void add_hdl64(std::uint16_t azimuth, std::span<const Return> returns);

  Model model_;
  Sink sink_;
  Packet packet_;
  std::size_t firings_ = 0;  // In `packet_`.
};

}  // namespace ads::velodyne
