#include "radar.h"

#include <span>
#include <utility>

#include "common/dbc.h"

namespace rav4 {

Radar::Radar(fastcycle::Context& context)
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

void Radar::start() {
  decoder_.emplace(ads::Dbc::read(dbc_.get()), RadarNames{.message_prefix = message_prefix_.get(),
                                                          .forward = forward_.get(),
                                                          .right = right_.get(),
                                                          .relative_speed = relative_speed_.get(),
                                                          .is_new = is_new_.get(),
                                                          .is_valid = is_valid_.get()});
  scan_.emplace(decoder_->slots());
}

void Radar::stop() {
  report("radar_tracks", valid_tracks_);
}

fastcycle::Param<std::string> Radar::name(fastcycle::Context& context, std::string_view param,
                                          const std::string& fallback) {
  return context.param<std::string>(param,
                                    {.fallback = fallback, .description = "Name in the DBC file"});
}

void Radar::on_frame(const can::Frame& frame) {
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

void Radar::publish_scan() {
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

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::Radar)
