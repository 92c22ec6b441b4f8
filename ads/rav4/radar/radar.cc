#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "can/frame.pb.h"
#include "common/dbc.h"
#include "radar/tracks.pb.h"
#include "scan.h"

namespace rav4 {

/// Decodes the tracks of the car's radar, by the rules of its DBC file.
///
/// In:   `can/frames`
/// Out:  `radar/tracks`, one message for each scan
class Radar final : public fastcycle::Component {
 public:
  explicit Radar(fastcycle::Context& context)
      : Component(context),
        dbc_(context.param<fastcycle::Path>("dbc",
                                            {.description = "The DBC file of the radar's bus"})),
        bus_(context.param<std::uint32_t>(
            "bus", {.fallback = 1, .max = 255, .description = "The number of that bus"})),
        message_prefix_(name(context, "message_prefix", "TRACK_A_")),
        forward_(name(context, "forward", "LONG_DIST")),
        right_(name(context, "right", "LAT_DIST")),
        relative_speed_(name(context, "relative_speed", "REL_SPEED")),
        is_new_(name(context, "is_new", "NEW_TRACK")),
        is_valid_(name(context, "is_valid", "VALID")),
        scans_(context.create_publisher<radar::Tracks>("radar/tracks")) {
    context.create_subscriber<can::Frame>("can/frames",
                                          [this](const can::Frame& frame) { on_frame(frame); });
  }

  void start() override {
    decoder_.emplace(ads::Dbc::read(dbc_.get()), RadarNames{.message_prefix = message_prefix_.get(),
                                                            .forward = forward_.get(),
                                                            .right = right_.get(),
                                                            .relative_speed = relative_speed_.get(),
                                                            .is_new = is_new_.get(),
                                                            .is_valid = is_valid_.get()});
    scan_.emplace(decoder_->slots());
  }

  void stop() override { report("radar_tracks", valid_tracks_); }

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
    const auto* const payload = reinterpret_cast<const std::uint8_t*>(frame.data().data());
    const auto track = decoder_->decode(frame.address(), {payload, frame.data().size()});
    if (!track) {
      return;
    }
    valid_tracks_ += track->is_valid ? 1 : 0;
    if (scan_->begins_next_scan(*track)) {
      publish_scan();
    }
    scan_->add(*track);
    scan_taken_ns_ = frame.header().taken_ns();
    if (scan_->is_complete()) {
      publish_scan();
    }
  }

  void publish_scan() {
    auto scan = scans_.loan();
    scan->mutable_header()->set_taken_ns(scan_taken_ns_);
    scan->mutable_header()->set_frame("radar");
    for (const RadarTrack& track : scan_->tracks()) {
      radar::Track& out = *scan->add_tracks();
      out.set_slot(static_cast<std::uint32_t>(track.slot));
      out.set_is_new(track.is_new);
      out.set_forward_m(track.forward_m);
      out.set_left_m(track.left_m);
      out.set_relative_speed_mps(track.relative_speed_mps);
    }
    scans_.publish(std::move(scan));
    scan_->clear();
  }

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

FASTCYCLE_COMPONENT(rav4::Radar)
