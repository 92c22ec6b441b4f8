#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <fastcycle/fastcycle.h>

#include "can/frame.pb.h"
#include "radar/tracks.pb.h"
#include "scan.h"

namespace rav4 {

/// Decodes the tracks of the car's radar, as defined by its DBC file.
///
/// In:   `can/frames`
/// Out:  `radar/tracks`, one message for each scan
class Radar final : public fastcycle::Component {
 public:
  explicit Radar(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  static fastcycle::Param<std::string> name(fastcycle::Context& context, std::string_view param,
                                            const std::string& fallback);
  void on_frame(const can::Frame& frame);
  void publish_scan();

  fastcycle::Param<fastcycle::Path> dbc_;
  fastcycle::Param<std::uint32_t> bus_;
  fastcycle::Param<std::string> message_prefix_;
  fastcycle::Param<std::string> forward_;
  fastcycle::Param<std::string> right_;
  fastcycle::Param<std::string> relative_speed_;
  fastcycle::Param<std::string> is_new_;
  fastcycle::Param<std::string> is_valid_;
  fastcycle::Publisher<radar::Tracks> scans_;

  std::optional<TrackDecoder> decoder_;
  std::optional<ScanCollector> scan_;
  std::int64_t scan_taken_ns_ = 0;
  std::int64_t valid_tracks_ = 0;
};

}  // namespace rav4
