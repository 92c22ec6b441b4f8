#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include <fastcycle/fastcycle.h>

#include "devices/device_component.h"
#include "lidar/sweep.pb.h"
#include "pcap.h"
#include "revolution.h"
#include "udp.h"

namespace ads {

/// Publishes the revolutions of a Velodyne lidar, received by a thread over UDP or read from a
/// capture file.
///
/// Out:  `lidar/points`, one sweep for each revolution
class Velodyne final : public DeviceComponent {
 public:
  explicit Velodyne(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  [[nodiscard]] velodyne::Model make_model() const;
  [[nodiscard]] bool take(std::span<const std::uint8_t> payload, std::int64_t arrival_ns);
  void fill(lidar::Sweep& sweep) const;
  void keep_counts();
  void play();
  void read_ahead();

  fastcycle::Param<velodyne::ModelKind> model_;
  fastcycle::Param<fastcycle::Path> calibration_;
  fastcycle::Param<bool> nominal_calibration_;
  fastcycle::Param<fastcycle::Path> capture_;
  fastcycle::Param<std::string> address_;
  fastcycle::Param<int> port_;
  fastcycle::Param<std::string> sensor_address_;
  velodyne::RevolutionConfig config_;
  double mount_forward_m_;
  double mount_height_m_;

  std::optional<velodyne::RevolutionDecoder> decoder_;  // Used by the thread, if there is one.
  std::array<bool, velodyne::kPacketFaults> has_warned_{};
  mutable std::mutex counts_mutex_;
  velodyne::RevolutionCounts counts_;

  // By UDP.
  std::optional<fastcycle::ExternalPublisher<lidar::Sweep>> received_;
  std::optional<velodyne::UdpDevice> device_;

  // From a file.
  std::optional<fastcycle::Publisher<lidar::Sweep>> played_;
  std::optional<fastcycle::Timer> timer_;
  std::optional<fastcycle::Source> source_;
  std::optional<velodyne::PcapReader> reader_;
  std::optional<std::int64_t> first_ns_;
};

}  // namespace ads
