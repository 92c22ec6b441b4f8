#include "picture.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "common/files.h"
#include "common/map_lines.h"

namespace ads {
namespace {

bool is_finite(const localization::Ego& ego) {
  return std::isfinite(ego.x_m()) && std::isfinite(ego.y_m()) && std::isfinite(ego.heading_rad()) &&
         std::isfinite(ego.speed_mps()) && std::isfinite(ego.acceleration_mps2());
}

std::string name_of(supervision::DrivingState state) {
  switch (state) {
    case supervision::AVAILABLE:
      return "available";
    case supervision::ENGAGED:
      return "engaged";
    case supervision::ENGAGED_DEGRADED:
      return "degraded";
    case supervision::MINIMAL_RISK_STOP:
      return "minimal-risk stop";
    case supervision::STOPPED:
      return "stopped";
    default:
      return "off";
  }
}

}  // namespace

Picture::Picture(fastcycle::Context& context)
    : Component(context),
      file_(context.param<fastcycle::Path>("file", {.fallback = fastcycle::Path("drive.svg"),
                                                    .description = "SVG file of the drive"})),
      title_(context.param<std::string>(
          "title", {.fallback = "A drive", .description = "Title of the picture"})),
      ego_length_m_(context.param<double>(
          "ego_length_m", {.fallback = 4.508, .min = 0.5, .max = 30.0, .unit = "m"})),
      ego_width_m_(context.param<double>(
          "ego_width_m", {.fallback = 1.610, .min = 0.5, .max = 5.0, .unit = "m"})) {
  context.create_subscriber<localization::Ego>(
      "localization/ego", [this](const localization::Ego& ego) { on_ego(ego); });
  context.create_subscriber<perception::Objects>(
      "perception/objects", [this](const perception::Objects& objects) { on_objects(objects); });
  context.create_subscriber<planning::Plan>("planning/checked_plan",
                                            [this](const planning::Plan& plan) { on_plan(plan); });
  context.create_subscriber<supervision::State>(
      "supervision/state", [this](const supervision::State& state) { on_state(state); });
  context.create_subscriber<mission::Goal>("mission/goal",
                                           [this](const mission::Goal& goal) { on_goal(goal); });
  context.create_subscriber<hd_map::Tile>("map/tile",
                                          [this](const hd_map::Tile& tile) { on_tile(tile); });
}

double Picture::seconds() const {
  return std::chrono::duration<double>(now() - engage_at_.value_or(start_time())).count();
}

void Picture::on_ego(const localization::Ego& ego) {
  if (is_finite(ego)) {
    ego_ = ego;
  }
}

void Picture::on_objects(const perception::Objects& objects) {
  if (!ego_ || !engage_at_ || now() < *engage_at_ || picture_.moments.size() >= kMomentsMax) {
    return;
  }
  DrivePicture::Moment moment{.time_s = seconds(),
                              .ego = {.center_m = {ego_->x_m(), ego_->y_m()},
                                      .heading_rad = ego_->heading_rad(),
                                      .length_m = ego_length_m_.get(),
                                      .width_m = ego_width_m_.get()},
                              .speed_mps = ego_->speed_mps(),
                              .acceleration_mps2 = ego_->acceleration_mps2(),
                              .gap_m = std::numeric_limits<double>::infinity(),
                              .state = name_of(state_.state()),
                              .objects = {},
                              .plan = plan_path_};
  for (const perception::Object& object : objects.objects()) {
    const Box box{.center_m = {object.x_m(), object.y_m()},
                  .heading_rad = object.heading_rad(),
                  .length_m = object.length_m(),
                  .width_m = object.width_m()};
    if (std::isfinite(box.center_m.sum() + box.heading_rad + box.length_m + box.width_m)) {
      moment.gap_m = std::min(moment.gap_m, distance_m(moment.ego, box));
      moment.objects.push_back({.id = object.id(), .box = box});
    }
  }
  picture_.moments.push_back(std::move(moment));
}

void Picture::on_plan(const planning::Plan& plan) {
  plan_path_.clear();
  for (const auto& point : plan.nominal().points()) {
    plan_path_.emplace_back(point.x_m(), point.y_m());
  }
}

void Picture::on_state(const supervision::State& state) {
  if (state.state() != state_.state() && picture_.events.size() < kEventsMax) {
    picture_.events.push_back(
        {.time_s = seconds(),
         .text = fmt::format("{} → {}{}{}", name_of(state_.state()), name_of(state.state()),
                             state.reason().empty() ? "" : ": ", state.reason())});
  }
  state_ = state;
}

void Picture::on_goal(const mission::Goal& goal) {
  engage_at_ = fastcycle::Time(fastcycle::Duration(goal.engage_ns()));
  picture_.goals.clear();
  if (goal.has_rectangle()) {
    const mission::Rectangle& rectangle = goal.rectangle();
    picture_.goals = {{.center_m = {rectangle.x_m(), rectangle.y_m()},
                       .heading_rad = rectangle.heading_rad(),
                       .length_m = rectangle.length_m(),
                       .width_m = rectangle.width_m()}};
  }
}

void Picture::on_tile(const hd_map::Tile& tile) {
  for (const hd_map::Lane& lane : tile.lanes()) {
    if (!lanes_.contains(lane.id())) {
      lanes_[lane.id()] = {.left = points_of(lane.left()), .right = points_of(lane.right())};
    }
  }
}

void Picture::stop() {
  picture_.title = title_.get();
  double length_m = 0.0;
  for (std::size_t i = 1; i < picture_.moments.size(); ++i) {
    length_m += (picture_.moments[i].ego.center_m - picture_.moments[i - 1].ego.center_m).norm();
  }
  picture_.subtitle = fmt::format("{:.0f} m; {}{}{}", length_m, name_of(state_.state()),
                                  state_.reason().empty() ? "" : ": ", state_.reason());
  for (const auto& [id, lane] : lanes_) {
    picture_.lanes.push_back(lane);
  }
  try {
    write_file(file_.get(), draw_svg(picture_));
    report("file", std::filesystem::absolute(file_.get()).lexically_normal().string());
  } catch (const std::runtime_error& error) {
    log().warning("{}", error.what());
    health(fastcycle::Health::kDegraded, "the picture of the drive cannot be written");
  }
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Picture)
