#include "rav4_visualization.h"

#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "common/params.h"

namespace ads {
namespace {

constexpr std::string_view kVehicle = "vehicle";
constexpr Rgba kTrack{.red = 0.85, .green = 0.2, .blue = 0.2, .alpha = 0.8};
constexpr double kTrack_m = 0.6;

}  // namespace

Rav4Visualization::Rav4Visualization(fastcycle::Context& context)
    : Component(context),
      length_m_(number_param(context, "length_m", 4.6, 0.0, 100.0, "m", "Of the vehicle")),
      width_m_(number_param(context, "width_m", 1.85, 0.0, 100.0, "m", "Of the vehicle")),
      height_m_(number_param(context, "height_m", 1.7, 0.0, 100.0, "m", "Of the vehicle")),
      radar_forward_m_(number_param(context, "radar_forward_m", 2.3, 0.0, 100.0, "m",
                                    "Of the radar before the vehicle's centre")),
      fixes_(context.create_publisher<foxglove::LocationFix>("visualization/fix")),
      estimates_(context.create_publisher<foxglove::LocationFix>("visualization/estimate")),
      transforms_(context.create_publisher<foxglove::FrameTransforms>("visualization/transforms")),
      poses_(context.create_publisher<foxglove::PoseInFrame>("visualization/pose")),
      vehicles_(context.create_publisher<foxglove::SceneUpdate>("visualization/vehicle")),
      radars_(context.create_publisher<foxglove::SceneUpdate>("visualization/radar")) {
  context.create_subscriber<gnss::Fix>("gnss/fix", [this](const gnss::Fix& fix) { on_fix(fix); });
  context.create_subscriber<localization::Pose>(
      "localization/pose", [this](const localization::Pose& pose) { on_pose(pose); });
  context.create_subscriber<radar::Tracks>(
      "radar/tracks", [this](const radar::Tracks& tracks) { on_tracks(tracks); });
}

void Rav4Visualization::on_fix(const gnss::Fix& fix) {
  auto out = fixes_.loan();
  draw_fix({.latitude_deg = fix.latitude_deg(),
            .longitude_deg = fix.longitude_deg(),
            .altitude_m = fix.altitude_m()},
           0.0, kVehicle, fix.header().taken_ns(), *out);
  fixes_.publish(std::move(out));
}

void Rav4Visualization::on_pose(const localization::Pose& pose) {
  const std::int64_t time_ns = pose.header().taken_ns();
  const bool is_first = !plane_;
  if (is_first) {
    plane_.emplace(GeodeticPosition{.latitude_deg = pose.origin_latitude_deg(),
                                    .longitude_deg = pose.origin_longitude_deg(),
                                    .altitude_m = pose.origin_altitude_m()});
  }
  foxglove::Pose place;
  set_pose(pose.east_m(), pose.north_m(), 0.0, pose.has_heading() ? pose.yaw_rad() : 0.0, place);

  auto transforms = transforms_.loan();
  set_transform(pose.header().frame(), kVehicle, time_ns, place, *transforms->add_transforms());
  foxglove::Pose mount;
  set_pose(radar_forward_m_.get(), 0.0, 0.0, 0.0, mount);
  set_transform(kVehicle, "radar", time_ns, mount, *transforms->add_transforms());
  transforms_.publish(std::move(transforms));

  auto out = poses_.loan();
  set_time(time_ns, *out->mutable_timestamp());
  out->set_frame_id(pose.header().frame());
  *out->mutable_pose() = place;
  poses_.publish(std::move(out));

  auto estimate = estimates_.loan();
  draw_fix(plane_->geodetic_from_enu({pose.east_m(), pose.north_m(), 0.0}),
           pose.position_stddev_m() / std::sqrt(2.0), kVehicle, time_ns, *estimate);
  estimates_.publish(std::move(estimate));

  if (is_first) {
    auto update = vehicles_.loan();
    draw_vehicle(
        kVehicle, time_ns,
        {.length_m = length_m_.get(), .width_m = width_m_.get(), .height_m = height_m_.get()},
        *update);
    vehicles_.publish(std::move(update));
  }
}

void Rav4Visualization::on_tracks(const radar::Tracks& tracks) {
  auto update = radars_.loan();
  foxglove::SceneEntity& entity = *update->add_entities();
  set_time(tracks.header().taken_ns(), *entity.mutable_timestamp());
  entity.set_frame_id(tracks.header().frame());
  entity.set_id("tracks");
  entity.set_frame_locked(true);
  for (const radar::Track& track : tracks.tracks()) {
    foxglove::CubePrimitive& cube = *entity.add_cubes();
    set_pose(track.forward_m(), track.left_m(), 0.5 * kTrack_m, 0.0, *cube.mutable_pose());
    cube.mutable_size()->set_x(kTrack_m);
    cube.mutable_size()->set_y(kTrack_m);
    cube.mutable_size()->set_z(kTrack_m);
    set_color(kTrack, *cube.mutable_color());
    foxglove::TextPrimitive& text = *entity.add_texts();
    set_pose(track.forward_m(), track.left_m(), 2.0 * kTrack_m, 0.0, *text.mutable_pose());
    text.set_billboard(true);
    text.set_font_size(kTrack_m);
    set_color(kTrack, *text.mutable_color());
    text.set_text(fmt::format("{} {:+.1f} m/s", track.slot(), track.relative_speed_mps()));
  }
  radars_.publish(std::move(update));
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Rav4Visualization)
