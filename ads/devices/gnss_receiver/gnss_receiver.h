#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include <fastcycle/fastcycle.h>

#include "common/geodesy.h"
#include "devices/device_component.h"
#include "fix.h"
#include "gnss/position.pb.h"
#include "localization/ego.pb.h"
#include "serial.h"
#include "stream.h"

namespace ads {

/// Publishes the positions of a satellite receiver on a serial line with NMEA 0183 or UBX, in the
/// plane of the map.
///
/// In:   `localization/ego`, for the antenna's position relative to the vehicle's centre
/// Out:  `gnss/position`, one for each fix
class GnssReceiver final : public DeviceComponent {
 public:
  explicit GnssReceiver(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  enum class ClockSource : std::uint8_t { kArrival, kUtc };

  [[nodiscard]] bool receive(std::string_view bytes);
  void publish(const GnssFix& fix);
  [[nodiscard]] fastcycle::Time time_of(const GnssFix& fix, fastcycle::Time arrived) const;

  SerialConfig serial_;
  double origin_latitude_deg_;
  double origin_longitude_deg_;
  double origin_altitude_m_;
  double antenna_forward_m_;
  double antenna_left_m_;
  double latency_s_;
  ClockSource clock_;
  FixReader reader_;
  fastcycle::ExternalPublisher<gnss::Position> positions_;

  std::optional<LocalFrame> map_;
  std::optional<gnss_stream::StreamParser> parser_;
  std::optional<SerialDevice> device_;
  std::atomic<bool> has_heading_ = false;
  std::atomic<double> heading_rad_ = 0.0;
  bool has_published_ = false;  // Of the bytes that are being received.

  std::mutex counts_mutex_;
  gnss_stream::StreamCounts counts_;
  std::int64_t positions_count_ = 0;
  std::int64_t malformed_ = 0;
  std::int64_t without_fix_ = 0;
};

}  // namespace ads
