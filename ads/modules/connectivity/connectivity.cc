#include "connectivity.h"

#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "common/commonroad.h"
#include "connectivity_tuning.h"
#include "scenario_link.h"

namespace ads {
namespace {

fastcycle::ParamOptions<double> stddev(double fallback, std::string unit, std::string of) {
  return {.fallback = fallback,
          .min = 0.0,
          .max = 100.0,
          .unit = std::move(unit),
          .description = "One standard deviation of the initial " + of};
}

}  // namespace

std::string error_in(const connectivity::Hazard& hazard, fastcycle::Time now) {
  const std::string& frame = hazard.header().frame();
  if (!frame.empty() && frame != "map") {
    return fmt::format("frame: expected \"map\", found \"{}\"", frame);
  }
  if (!connectivity::Hazard::Kind_IsValid(hazard.kind())) {
    return fmt::format("kind: {} is not known", static_cast<int>(hazard.kind()));
  }
  if (hazard.is_cancelled()) {
    return "";
  }
  if (!std::isfinite(hazard.x_m()) || !std::isfinite(hazard.y_m())) {
    return "its place is not finite";
  }
  if (!(hazard.radius_m() > 0.0 && hazard.radius_m() <= kConnectivity.radius_max_m)) {
    return fmt::format("radius_m: expected above 0 to {}, found {}", kConnectivity.radius_max_m,
                       hazard.radius_m());
  }
  if (!(hazard.speed_limit_mps() >= 0.0) || !std::isfinite(hazard.speed_limit_mps())) {
    return fmt::format("speed_limit_mps: expected 0 or more, found {}", hazard.speed_limit_mps());
  }
  if (hazard.valid_until_ns() != 0 && hazard.valid_until_ns() <= now.time_since_epoch().count()) {
    return "it is over already";
  }
  return "";
}

Connectivity::Connectivity(fastcycle::Context& context)
    : Component(context),
      scenario_(context.param<fastcycle::Path>(
          "scenario",
          {.description = "The CommonRoad scenario whose planning problem is the mission"})),
      settle_s_(context.param<double>(
          "settle_s",
          {.fallback = 2.0,
           .min = 0.0,
           .max = 60.0,
           .unit = "s",
           .description = "Time from the application's start to step 0 of the scenario"})),
      position_stddev_m_(
          context.param<double>("position_stddev_m", stddev(0.5, "m", "position, per axis"))),
      heading_stddev_rad_(
          context.param<double>("heading_stddev_rad", stddev(0.02, "rad", "heading"))),
      speed_stddev_mps_(context.param<double>("speed_stddev_mps", stddev(0.5, "m/s", "speed"))),
      hazard_plan_(context.param<connectivity::HazardPlan>(
          "hazards", {.fallback = connectivity::HazardPlan(),
                      .description = "Hazards that are announced, by seconds since step 0"})),
      initial_poses_(context.create_publisher<mission::InitialPose>("mission/initial_pose")),
      goals_(context.create_publisher<mission::Goal>("mission/goal")),
      hazards_(context.create_publisher<connectivity::Hazard>("connectivity/hazard")),
      reports_(
          context.create_publisher<connectivity::VehicleReport>("connectivity/vehicle_report")),
      ego_(context.create_latest<localization::Ego>("localization/ego")),
      state_(context.create_latest<supervision::State>("supervision/state")),
      receive_timer_(context.create_timer([this] { receive(); })) {
  context.create_subscriber<connectivity::Hazard>(
      "connectivity/inbox", [this](const connectivity::Hazard& hazard) { take(hazard); });
  context.create_timer({.period = std::chrono::seconds(1)}, [this] { send_report(); });
}

void Connectivity::start() {
  // The mission's times count from the start of the timers, which is not known yet.
  receive_timer_.arm_at(now());
}

void Connectivity::receive() {
  if (link_ == nullptr) {
    const Scenario scenario = Scenario::read(scenario_.get());
    if (scenario.problem().goals.size() > 1) {
      log().warning("{} goals; the first one is taken", scenario.problem().goals.size());
    }
    link_ = std::make_unique<ScenarioLink>(
        scenario, hazard_plan_.get(), start_time(),
        ScenarioLinkOptions{.settle = duration_of(settle_s_.get()),
                            .position_stddev_m = position_stddev_m_.get(),
                            .heading_stddev_rad = heading_stddev_rad_.get(),
                            .speed_stddev_mps = speed_stddev_mps_.get()});
  }
  if (const auto mission = link_->receive_mission(now())) {
    publish(*mission);
  }
  for (const connectivity::Hazard& hazard : link_->receive_hazards(now())) {
    take(hazard);
  }
  if (const auto due = link_->next_due()) {
    receive_timer_.arm_at(*due);
  }
}

void Connectivity::publish(const Mission& mission) {
  auto pose = initial_poses_.loan();
  pose->CopyFrom(mission.initial_pose);
  initial_poses_.publish(std::move(pose));
  auto goal = goals_.loan();
  goal->CopyFrom(mission.goal);
  goals_.publish(std::move(goal));
}

void Connectivity::take(const connectivity::Hazard& hazard) {
  const std::string error = error_in(hazard, now());
  if (!error.empty()) {
    ++hazards_refused_;
    log().warning("hazard {} is refused: {}", hazard.id(), error);
    return;
  }
  ++hazards_passed_on_;
  auto message = hazards_.loan();
  message->CopyFrom(hazard);
  message->mutable_header()->set_frame("map");
  if (message->header().taken_ns() == 0) {
    message->mutable_header()->set_taken_ns(now().time_since_epoch().count());
  }
  hazards_.publish(std::move(message));
}

void Connectivity::send_report() {
  const auto ego = ego_.get();
  if (!ego) {
    return;
  }
  auto report = reports_.loan();
  report->mutable_header()->CopyFrom(ego->header());
  report->set_x_m(ego->x_m());
  report->set_y_m(ego->y_m());
  report->set_heading_rad(ego->heading_rad());
  report->set_speed_mps(ego->speed_mps());
  if (const auto state = state_.get()) {
    report->set_is_autonomous(state->state() == supervision::ENGAGED ||
                              state->state() == supervision::ENGAGED_DEGRADED ||
                              state->state() == supervision::MINIMAL_RISK_STOP);
    report->set_state(supervision::DrivingState_Name(state->state()));
  }
  if (link_ != nullptr) {
    link_->send(*report);
  }
  reports_.publish(std::move(report));
}

void Connectivity::stop() {
  report("hazards_passed_on", hazards_passed_on_);
  report("hazards_refused", hazards_refused_);
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Connectivity)
