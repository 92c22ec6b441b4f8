#include "perception.h"

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "object_class.h"
#include "perception_tuning.h"

namespace ads {
namespace {

RecognizerConfig read_config(fastcycle::Context& context) {
  RecognizerConfig config;
  const auto read = [&context](std::string_view name, double& value, double max, std::string unit,
                               std::string description) {
    value = context
                .param<double>(name, {.fallback = value,
                                      .min = 1e-6,
                                      .max = max,
                                      .unit = std::move(unit),
                                      .description = std::move(description)})
                .get();
  };
  const auto count = [&context](std::string_view name, int& value, int max,
                                std::string description) {
    value =
        context
            .param<int>(
                name,
                {.fallback = value, .min = 1, .max = max, .description = std::move(description)})
            .get();
  };
  read("range_max_m", config.tracker.clustering.range_max_m, 200.0, "m",
       "Maximum range of returns");
  config.ground.range_max_m = config.tracker.clustering.range_max_m;
  read("ground_slope_max", config.ground.slope_max, 1.0, "1", "Maximum slope of the ground");
  read("ground_step_max_m", config.ground.step_max_m, 1.0, "m", "Maximum step of the ground");
  read("height_min_m", config.height_min_m, 2.0, "m",
       "Minimum height of a return; lower ones belong to the ground");
  read("height_max_m", config.height_max_m, 20.0, "m",
       "Maximum height of a return; the vehicle passes under higher ones");
  read("own_length_m", config.own_length_m, 50.0, "m",
       "Length of the area whose returns belong to the vehicle itself");
  read("own_width_m", config.own_width_m, 10.0, "m",
       "Width of the area whose returns belong to the vehicle itself");
  read("invalid_share_max", config.invalid_share_max, 1.0, "1",
       "Maximum share of non-finite returns in a sweep");
  count("returns_min", config.returns_min, 1'000'000, "Minimum number of returns of a sweep");
  read("across_m", config.tracker.clustering.across_m, 5.0, "m",
       "Maximum distance between returns of one group");
  read("along_max_m", config.tracker.clustering.along_max_m, 10.0, "m",
       "Maximum distance along the line of sight, far away");
  count("object_returns_min", config.tracker.returns_min, 10'000,
        "Minimum number of returns of a new object");
  count("sightings_min", config.tracker.sightings_min, 100,
        "Number of sweeps with a detection before an object is reported");
  read("open_max_s", config.tracker.open_max_s, 60.0, "s",
       "Time for which an object is kept that should be visible and is not detected");
  read("hidden_max_s", config.tracker.hidden_max_s, 60.0, "s",
       "Time for which an occluded object is kept");
  read("hidden_speed_error_mps", config.tracker.hidden_speed_error_mps, 100.0, "m/s",
       "Speed error of an object that reappears after at least 0.5 s");
  read("hidden_acceleration_mps2", config.tracker.hidden_acceleration_mps2, 100.0, "m/s²",
       "The most that it may have had meanwhile");
  read("reach_m", config.tracker.reach_m, 20.0, "m",
       "Distance around its box within which a track takes returns of the same group");
  config.are_borders_sought =
      context
          .param<bool>("borders", {.fallback = config.are_borders_sought,
                                   .description = "Whether road borders are detected"})
          .get();
  read("low_length_max_m", config.tracker.low_length_max_m, 50.0, "m",
       "Maximum length of a low object; a longer one is two objects");
  config.tracker.structure_likeness =
      context
          .param<double>("structure_likeness",
                         {.fallback = config.tracker.structure_likeness,
                          .min = -1e3,
                          .max = 0.0,
                          .unit = "1",
                          .description = "Tracks below this vehicle likeness take only returns "
                                         "that no other track claims"})
          .get();
  TrackConfig& track = config.tracker.track;
  read("length_m", track.length_m, 50.0, "m",
       "Assumed length of an object before it is measured well");
  read("length_stddev_m", track.length_stddev_m, 50.0, "m", "1 sigma");
  read("width_m", track.width_m, 10.0, "m",
       "Assumed width of an object before it is measured well");
  read("width_stddev_m", track.width_stddev_m, 10.0, "m", "1 sigma");
  read("speed_stddev_mps", track.speed_stddev_mps, 100.0, "m/s",
       "1 sigma of the speed of a new object, per axis");
  read("maneuver_s", track.maneuver_s, 60.0, "s", "Duration of an acceleration");
  read("forward_stddev_mps2", track.forward_stddev_mps2, 50.0, "m/s^2",
       "Accelerations along the heading, 1 sigma");
  read("sideways_stddev_mps2", track.sideways_stddev_mps2, 50.0, "m/s^2",
       "Accelerations across it, 1 sigma");
  read("yaw_walk_radps_per_sqrt_s", track.yaw_walk_radps_per_sqrt_s, 10.0, "rad/s/sqrt(s)",
       "How fast the yaw rate changes");
  return config;
}

void fill(perception::Border& message, const std::vector<BorderPlace>& border,
          double mount_forward_m) {
  for (const BorderPlace& place : border) {
    message.add_x_m(place.place_m.x() + mount_forward_m);
    message.add_y_m(place.place_m.y());
    message.add_stddev_m(place.stddev_m);
  }
}

void fill(perception::Object& message, const TrackedObject& object, std::int64_t time_ns,
          double likeness_min) {
  Track track = object.track;
  track.predict(time_ns);
  message.set_id(object.id);
  message.set_object_class(class_of(object, likeness_min));
  message.set_x_m(track.center_m().x());
  message.set_y_m(track.center_m().y());
  message.set_heading_rad(track.heading_rad());
  message.set_length_m(track.length_m());
  message.set_width_m(track.width_m());
  message.set_height_m(track.height_m());
  message.set_speed_mps(track.speed_mps());
  message.set_acceleration_mps2(track.acceleration_mps2());
  message.set_yaw_rate_radps(track.yaw_rate_radps());
  message.set_position_stddev_m(track.position_stddev_m());
  message.set_speed_stddev_mps(track.speed_stddev_mps());
  message.set_heading_stddev_rad(track.heading_stddev_rad());
  message.set_sightings(object.sightings);
  message.set_unseen_s(object.missed == 0 ? 0.0
                                          : static_cast<double>(time_ns - object.seen_ns) * 1e-9);
}

}  // namespace

Perception::Perception(fastcycle::Context& context)
    : Component(context),
      sweep_age_max_s_(
          context.param<double>("sweep_age_max_s", {.fallback = 0.3,
                                                    .min = 0.0,
                                                    .max = 10.0,
                                                    .unit = "s",
                                                    .description = "Maximum age of a sweep"})),
      likeness_min_(context.param<double>(
          "likeness_min", {.fallback = -1e3,
                           .min = -1e3,
                           .max = 5.0,
                           .unit = "1",
                           .description = "Minimum vehicle likeness for a class: number of sweeps "
                                          "for it minus those against"})),
      recognizer_(read_config(context)),
      ego_(context.create_history<localization::Ego>("localization/ego",
                                                     {.depth = kPerception.poses})),
      objects_(context.create_publisher<perception::Objects>("perception/objects")),
      state_(context.state<perception::TrackerState>("tracker",
                                                     [this](auto& state) { save(state); })) {
  load(*state_);
  if (recognizer_.are_borders_sought()) {
    borders_.emplace(context.create_publisher<perception::Borders>("perception/borders"));
  }
  context.create_subscriber<lidar::Sweep>("lidar/points",
                                          [this](const lidar::Sweep& sweep) { on_sweep(sweep); });
}

void Perception::save(perception::TrackerState& state) const {
  recognizer_.save(state);
  state.set_sweeps(sweep_count_);
  state.set_sweeps_invalid(invalid_count_);
  state.set_objects_max(confirmed_max_);
  state.set_borders_left(borders_left_);
  state.set_borders_right(borders_right_);
}

void Perception::load(const perception::TrackerState& state) {
  recognizer_.load(state);
  sweep_count_ = state.sweeps();
  invalid_count_ = state.sweeps_invalid();
  confirmed_max_ = state.objects_max();
  borders_left_ = state.borders_left();
  borders_right_ = state.borders_right();
}

void Perception::stop() {
  report("sweeps", sweep_count_);
  report("sweeps_invalid", invalid_count_);
  report("objects_max", confirmed_max_);
  if (borders_) {
    report("borders_left", borders_left_);
    report("borders_right", borders_right_);
  }
}

void Perception::on_sweep(const lidar::Sweep& sweep) {
  ++sweep_count_;
  const std::int64_t end_ns = sweep.header().taken_ns() + sweep.duration_ns();
  const double age_s = static_cast<double>(now().time_since_epoch().count() - end_ns) * 1e-9;
  SweepResult result;
  if (!take_ego()) {
    result = recognizer_.pass_over(end_ns, "localization/ego has no estimate");
  } else if (age_s > sweep_age_max_s_.get()) {
    result = recognizer_.pass_over(
        end_ns, fmt::format("expected a sweep of at most {} s, found one of {:.3f} s",
                            sweep_age_max_s_.get(), age_s));
  } else {
    result = recognizer_.take({.taken_ns = sweep.header().taken_ns(),
                               .duration_ns = sweep.duration_ns(),
                               .columns = sweep.columns(),
                               .rings = sweep.rings(),
                               .points = sweep.points(),
                               .mount_forward_m = sweep.mount_forward_m(),
                               .mount_height_m = sweep.mount_height_m()},
                              motion_);
  }
  if (result.reason.empty()) {
    health(fastcycle::Health::kOk);
  } else {
    ++invalid_count_;
    health(fastcycle::Health::kDegraded, result.reason);
  }
  publish(end_ns, result);
  if (borders_ && recognizer_.borders() != nullptr) {
    publish_borders(end_ns - sweep.duration_ns() / 2, sweep.mount_forward_m());
  }
}

// False if there is no pose.
bool Perception::take_ego() {
  motion_.clear();
  bool has_pose = false;
  for (std::size_t index = 0; index < ego_.size(); ++index) {
    const auto sample = ego_[index];
    const localization::Ego& ego = *sample;
    if (ego.quality() == localization::INITIALIZING) {
      continue;
    }
    motion_.add({.time_ns = ego.header().taken_ns(),
                 .position_m = {ego.x_m(), ego.y_m()},
                 .heading_rad = ego.heading_rad(),
                 .speed_mps = ego.speed_mps(),
                 .yaw_rate_radps = ego.yaw_rate_radps()});
    has_pose = true;
  }
  return has_pose;
}

void Perception::publish(std::int64_t time_ns, const SweepResult& result) {
  auto objects = objects_.loan();
  objects->mutable_header()->set_taken_ns(time_ns);
  objects->mutable_header()->set_frame("map");
  objects->set_is_sweep_valid(result.reason.empty());
  objects->set_reason(result.reason);
  objects->set_returns(result.returns);
  objects->set_invalid_returns(result.invalid_returns);
  objects->set_ground_returns(result.ground_returns);
  for (const TrackedObject& object : recognizer_.objects()) {
    if (object.is_confirmed) {
      fill(*objects->add_objects(), object, time_ns, likeness_min_.get());
    }
  }
  confirmed_max_ = std::max(confirmed_max_, std::int64_t{objects->objects_size()});
  objects_.publish(std::move(objects));
}

void Perception::publish_borders(std::int64_t time_ns, double mount_forward_m) {
  const RoadBorders& found = *recognizer_.borders();
  auto borders = borders_->loan();
  borders->mutable_header()->set_taken_ns(time_ns);
  borders->mutable_header()->set_frame("vehicle");
  if (!found.left.empty()) {
    fill(*borders->mutable_left(), found.left, mount_forward_m);
    ++borders_left_;
  }
  if (!found.right.empty()) {
    fill(*borders->mutable_right(), found.right, mount_forward_m);
    ++borders_right_;
  }
  borders_->publish(std::move(borders));
}

}  // namespace ads
