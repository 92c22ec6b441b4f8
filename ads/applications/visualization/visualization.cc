#include "visualization.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "common/params.h"

namespace ads {
namespace {

constexpr std::array<std::string_view, 10> kOutputs = {
    "points",       "objects",    "lanes", "route",   "plan",
    "minimal_risk", "transforms", "pose",  "vehicle", "fix"};

}  // namespace

Visualization::Visualization(fastcycle::Context& context)
    : Component(context),
      except_(context.param<std::vector<std::string>>(
          "except", {.fallback = std::vector<std::string>{}, .description = "Outputs to omit"})),
      vehicle_frame_(context.param<std::string>(
          "vehicle_frame",
          {.fallback = "vehicle", .description = "The name of the vehicle's own frame"})),
      points_every_(
          context.param<int>("points_every", {.fallback = 1,
                                              .min = 1,
                                              .max = 1000,
                                              .description = "Every n-th lidar return is shown"})),
      length_m_(number_param(context, "length_m", 4.5, 0.1, 100.0, "m", "Of the vehicle")),
      width_m_(number_param(context, "width_m", 1.8, 0.1, 100.0, "m", "Of the vehicle")),
      height_m_(number_param(context, "height_m", 1.5, 0.1, 100.0, "m", "Of the vehicle")),
      origin_deg_(context.param<std::vector<double>>(
          "origin_deg", {.fallback = std::vector<double>{},
                         .min = -180.0,
                         .max = 180.0,
                         .unit = "deg",
                         .description = "Latitude and longitude of the map's origin; empty: "
                                        "unknown, and no fixes are published"})),
      clouds_(context.create_publisher<foxglove::PointCloud>("visualization/points")),
      objects_(context.create_publisher<foxglove::SceneUpdate>("visualization/objects")),
      lanes_(context.create_publisher<foxglove::SceneUpdate>("visualization/lanes")),
      routes_(context.create_publisher<foxglove::SceneUpdate>("visualization/route")),
      plans_(context.create_publisher<foxglove::PosesInFrame>("visualization/plan")),
      minimal_risks_(
          context.create_publisher<foxglove::PosesInFrame>("visualization/minimal_risk")),
      transforms_(context.create_publisher<foxglove::FrameTransforms>("visualization/transforms")),
      poses_(context.create_publisher<foxglove::PoseInFrame>("visualization/pose")),
      vehicles_(context.create_publisher<foxglove::SceneUpdate>("visualization/vehicle")),
      fixes_(context.create_publisher<foxglove::LocationFix>("visualization/fix")) {
  for (const std::string& name : except_.get()) {
    if (std::ranges::find(kOutputs, name) == kOutputs.end()) {
      throw std::invalid_argument(
          fmt::format("except: expected {}, found \"{}\"", fmt::join(kOutputs, ", "), name));
    }
  }
  const std::vector<double>& origin = origin_deg_.get();
  if (origin.size() == 2) {
    plane_.emplace(
        GeodeticPosition{.latitude_deg = origin[0], .longitude_deg = origin[1], .altitude_m = 0.0});
  } else if (!origin.empty()) {
    throw std::invalid_argument(fmt::format(
        "origin_deg: expected latitude and longitude, found {} numbers", origin.size()));
  }

  context.create_subscriber<localization::Ego>(
      "localization/ego", [this](const localization::Ego& ego) { on_ego(ego); });
  context.create_subscriber<lidar::Sweep>("lidar/points",
                                          [this](const lidar::Sweep& sweep) { on_sweep(sweep); });
  if (has("objects")) {
    context.create_subscriber<perception::Objects>("perception/objects",
                                                   [this](const perception::Objects& objects) {
                                                     auto update = objects_.loan();
                                                     draw_objects(objects, *update);
                                                     objects_.publish(std::move(update));
                                                   });
  }
  if (has("lanes")) {
    context.create_subscriber<hd_map::Tile>("map/tile", [this](const hd_map::Tile& tile) {
      auto update = lanes_.loan();
      draw_lanes(tile, *update);
      lanes_.publish(std::move(update));
    });
  }
  if (has("route")) {
    context.create_subscriber<hd_map::Route>("map/route", [this](const hd_map::Route& route) {
      auto update = routes_.loan();
      draw_route(route, *update);
      routes_.publish(std::move(update));
    });
  }
  if (has("plan") || has("minimal_risk")) {
    context.create_subscriber<planning::Plan>(
        "planning/plan", [this](const planning::Plan& plan) { on_plan(plan); });
  }
  if (has("fix") && plane_) {
    context.create_subscriber<gnss::Position>(
        "gnss/position", [this](const gnss::Position& position) { on_position(position); });
  }
}

bool Visualization::has(std::string_view output) const {
  return std::ranges::find(except_.get(), output) == except_.get().end();
}

void Visualization::on_sweep(const lidar::Sweep& sweep) {
  const std::int64_t end_ns = sweep.header().taken_ns() + sweep.duration_ns();
  if (has("transforms")) {
    foxglove::Pose mount;
    set_pose(sweep.mount_forward_m(), 0.0, sweep.mount_height_m(), 0.0, mount);
    auto transforms = transforms_.loan();
    set_transform(vehicle_frame_.get(), sweep.header().frame(), end_ns, mount,
                  *transforms->add_transforms());
    transforms_.publish(std::move(transforms));
  }
  if (has("points")) {
    auto cloud = clouds_.loan();
    draw_sweep(sweep, motion_, points_every_.get(), *cloud);
    clouds_.publish(std::move(cloud));
  }
}

void Visualization::on_plan(const planning::Plan& plan) {
  const std::int64_t time_ns = plan.header().taken_ns();
  if (has("plan")) {
    auto poses = plans_.loan();
    draw_trajectory(plan.nominal(), plan.header().frame(), time_ns, *poses);
    plans_.publish(std::move(poses));
  }
  if (has("minimal_risk")) {
    auto poses = minimal_risks_.loan();
    draw_trajectory(plan.minimal_risk(), plan.header().frame(), time_ns, *poses);
    minimal_risks_.publish(std::move(poses));
  }
}

void Visualization::on_ego(const localization::Ego& ego) {
  const std::int64_t time_ns = ego.header().taken_ns();
  if (ego.quality() == localization::INITIALIZING) {
    return;
  }
  motion_ = {.speed_mps = ego.speed_mps(), .yaw_rate_radps = ego.yaw_rate_radps()};
  foxglove::Pose pose;
  set_pose(ego.x_m(), ego.y_m(), 0.0, ego.heading_rad(), pose);
  if (has("transforms")) {
    auto transforms = transforms_.loan();
    set_transform(ego.header().frame(), vehicle_frame_.get(), time_ns, pose,
                  *transforms->add_transforms());
    transforms_.publish(std::move(transforms));
  }
  if (has("pose")) {
    auto out = poses_.loan();
    set_time(time_ns, *out->mutable_timestamp());
    out->set_frame_id(ego.header().frame());
    *out->mutable_pose() = pose;
    poses_.publish(std::move(out));
  }
  if (has("vehicle") && !has_vehicle_) {
    has_vehicle_ = true;
    publish_vehicle(time_ns);
  }
}

void Visualization::publish_vehicle(std::int64_t time_ns) {
  auto update = vehicles_.loan();
  draw_vehicle(
      vehicle_frame_.get(), time_ns,
      {.length_m = length_m_.get(), .width_m = width_m_.get(), .height_m = height_m_.get()},
      *update);
  vehicles_.publish(std::move(update));
}

void Visualization::on_position(const gnss::Position& position) {
  auto fix = fixes_.loan();
  draw_fix(plane_->geodetic_from_enu({position.x_m(), position.y_m(), 0.0}), position.stddev_m(),
           vehicle_frame_.get(), position.header().taken_ns(), *fix);
  fixes_.publish(std::move(fix));
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Visualization)
