#include "planner_state.h"

#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace motion_planning {
namespace {

using StateMessages = google::protobuf::RepeatedPtrField<planning::PlannedState>;

void write(const std::vector<State>& states, StateMessages& messages) {
  for (const State& state : states) {
    planning::PlannedState& its = *messages.Add();
    its.set_x_m(state.x_m);
    its.set_y_m(state.y_m);
    its.set_heading_rad(state.heading_rad);
    its.set_speed_mps(state.speed_mps);
    its.set_acceleration_mps2(state.acceleration_mps2);
    its.set_steering_rad(state.steering_rad);
  }
}

std::vector<State> read(const StateMessages& messages) {
  std::vector<State> states;
  for (const planning::PlannedState& state : messages) {
    states.push_back({.x_m = state.x_m(),
                      .y_m = state.y_m(),
                      .heading_rad = state.heading_rad(),
                      .speed_mps = state.speed_mps(),
                      .acceleration_mps2 = state.acceleration_mps2(),
                      .steering_rad = state.steering_rad()});
  }
  return states;
}

}  // namespace

void write(const Planner::Memory& memory, planning::PlannerState& message) {
  if (memory.begun_mps) {
    message.set_begun_mps(*memory.begun_mps);
  }
  if (memory.stood_at_lane) {
    message.set_stood_at_lane(*memory.stood_at_lane);
  }
  if (!memory.last) {
    return;  // It has not planned yet.
  }
  planning::PlannedWay& way = *message.mutable_way();
  way.set_start_s(memory.last_s);
  write(memory.last->states, *way.mutable_states());
  for (const Input& input : memory.last->inputs) {
    planning::PlannedInput& its = *way.add_inputs();
    its.set_jerk_mps3(input.jerk_mps3);
    its.set_steering_rate_radps(input.steering_rate_radps);
  }
  way.set_cost(memory.last->cost);
  planning::PlannedTrajectory& trajectory = *message.mutable_trajectory();
  trajectory.set_start_s(memory.last_trajectory.start_s);
  trajectory.set_step_s(memory.last_trajectory.step_s);
  write(memory.last_trajectory.states, *trajectory.mutable_states());
}

Planner::Memory read(const planning::PlannerState& message) {
  const std::optional<double> begun_mps =
      message.has_begun_mps() ? std::optional(message.begun_mps()) : std::nullopt;
  const std::optional<std::int64_t> stood_at_lane =
      message.has_stood_at_lane() ? std::optional(message.stood_at_lane()) : std::nullopt;
  if (!message.has_way()) {
    return {.begun_mps = begun_mps, .stood_at_lane = stood_at_lane};
  }
  const planning::PlannedTrajectory& trajectory = message.trajectory();
  if (trajectory.states().empty() || !(trajectory.step_s() > 0.0)) {
    throw std::invalid_argument("the state has a trajectory that cannot be driven");
  }
  Way way{.states = read(message.way().states()), .cost = message.way().cost()};
  for (const planning::PlannedInput& input : message.way().inputs()) {
    way.inputs.push_back(
        {.jerk_mps3 = input.jerk_mps3(), .steering_rate_radps = input.steering_rate_radps()});
  }
  return {.last = std::move(way),
          .last_s = message.way().start_s(),
          .last_trajectory = {.start_s = trajectory.start_s(),
                              .step_s = trajectory.step_s(),
                              .states = read(trajectory.states())},
          .begun_mps = begun_mps,
          .stood_at_lane = stood_at_lane};
}

}  // namespace motion_planning
