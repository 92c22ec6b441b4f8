#include "scenario_link.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/lead_in.h"
#include "connectivity_tuning.h"

namespace ads {
namespace {

std::int64_t nanoseconds_of(fastcycle::Time time) {
  return time.time_since_epoch().count();
}

mission::InitialPose initial_pose(const Scenario& scenario, fastcycle::Time start,
                                  const ScenarioLinkOptions& options) {
  const ScenarioState& initial = scenario.problem().initial;
  const double way_m =
      std::chrono::duration<double>(options.settle).count() * std::max(0.0, initial.speed_mps);
  const LeadIn::Pose begin =
      LeadIn(scenario, initial, options.centre_to_rear_axle_m, way_m).at(way_m);
  mission::InitialPose pose;
  pose.mutable_header()->set_taken_ns(nanoseconds_of(start));
  pose.mutable_header()->set_frame("map");
  pose.set_x_m(begin.center_m.x());
  pose.set_y_m(begin.center_m.y());
  pose.set_heading_rad(begin.heading_rad);
  pose.set_speed_mps(initial.speed_mps);
  pose.set_position_stddev_m(options.position_stddev_m);
  pose.set_heading_stddev_rad(options.heading_stddev_rad);
  pose.set_speed_stddev_mps(options.speed_stddev_mps);
  return pose;
}

std::optional<Box> box_of(const GoalState& goal) {
  const double heading_rad =
      goal.heading_rad ? (goal.heading_rad->low + goal.heading_rad->high) / 2.0 : 0.0;
  if (!goal.boxes.empty()) {
    return goal.boxes.front();
  }
  if (!goal.circles.empty()) {
    const Circle& circle = goal.circles.front();
    const double side_m = std::numbers::sqrt2 * circle.radius_m;
    return Box{circle.center_m, heading_rad, side_m, side_m};
  }
  if (!goal.polygons.empty()) {
    return square_inside(goal.polygons.front(), heading_rad);
  }
  return std::nullopt;
}

mission::Goal goal_message(const GoalState& goal, double step_s, fastcycle::Time start,
                           fastcycle::Time step_0) {
  mission::Goal message;
  message.mutable_header()->set_taken_ns(nanoseconds_of(start));
  message.mutable_header()->set_frame("map");
  if (const auto box = box_of(goal)) {
    mission::Rectangle& rectangle = *message.mutable_rectangle();
    rectangle.set_x_m(box->center_m.x());
    rectangle.set_y_m(box->center_m.y());
    rectangle.set_heading_rad(box->heading_rad);
    rectangle.set_length_m(box->length_m);
    rectangle.set_width_m(box->width_m);
  }
  for (const std::int64_t lane : goal.lanelets) {
    message.add_lanes(lane);
  }
  if (goal.heading_rad) {
    message.mutable_heading_rad()->set_low(goal.heading_rad->low);
    message.mutable_heading_rad()->set_high(goal.heading_rad->high);
  }
  if (goal.speed_mps) {
    message.mutable_speed_mps()->set_low(goal.speed_mps->low);
    message.mutable_speed_mps()->set_high(goal.speed_mps->high);
  }
  const auto at_step = [&](std::int64_t step) {
    return nanoseconds_of(step_0 + duration_of(static_cast<double>(step) * step_s));
  };
  message.set_window_begin_ns(at_step(goal.first_step));
  message.set_window_end_ns(at_step(goal.last_step));
  message.set_engage_ns(nanoseconds_of(step_0));
  return message;
}

}  // namespace

Box square_inside(const std::vector<Eigen::Vector2d>& polygon_m, double heading_rad) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : polygon_m) {
    middle += corner / static_cast<double>(polygon_m.size());
  }
  double side_m = 0.0;
  for (const Eigen::Vector2d& corner : polygon_m) {
    side_m = std::max(side_m, 2.0 * (corner - middle).norm());
  }
  const auto is_inside = [&](double side) {
    return std::ranges::all_of(
        Box{middle, heading_rad, side, side}.corners(),
        [&](const Eigen::Vector2d& corner) { return contains(polygon_m, corner); });
  };
  while (side_m > kScenarioLink.least_m && !is_inside(side_m)) {
    side_m *= kScenarioLink.shrink;
  }
  side_m = std::max(side_m, kScenarioLink.least_m);
  return {middle, heading_rad, side_m, side_m};
}

ScenarioLink::ScenarioLink(const Scenario& scenario, connectivity::HazardPlan hazards,
                           fastcycle::Time start, const ScenarioLinkOptions& options) {
  const fastcycle::Time step_0 = start + options.settle;
  const PlanningProblem& problem = scenario.problem();
  mission_.emplace(initial_pose(scenario, start, options),
                   goal_message(problem.goals.front(), scenario.step_s, start, step_0));
  for (connectivity::PlannedHazard& planned : *hazards.mutable_hazards()) {
    DueHazard due{.due = step_0 + duration_of(planned.time_s()),
                  .hazard = std::move(*planned.mutable_hazard())};
    if (planned.duration_s() > 0.0) {
      due.hazard.set_valid_until_ns(nanoseconds_of(due.due + duration_of(planned.duration_s())));
    }
    hazards_.push_back(std::move(due));
  }
  std::ranges::sort(hazards_, {},
                    [](const DueHazard& due) { return std::pair(due.due, due.hazard.id()); });
}

std::optional<Mission> ScenarioLink::receive_mission(fastcycle::Time /*now*/) {
  return std::exchange(mission_, std::nullopt);
}

std::vector<connectivity::Hazard> ScenarioLink::receive_hazards(fastcycle::Time now) {
  std::vector<connectivity::Hazard> received;
  while (next_hazard_ < hazards_.size() && hazards_[next_hazard_].due <= now) {
    received.push_back(hazards_[next_hazard_++].hazard);
  }
  return received;
}

std::optional<fastcycle::Time> ScenarioLink::next_due() const {
  return next_hazard_ < hazards_.size() ? std::optional(hazards_[next_hazard_].due) : std::nullopt;
}

void ScenarioLink::send(const connectivity::VehicleReport& /*report*/) {
  ++reports_;
}

}  // namespace ads
