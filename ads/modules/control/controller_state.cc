#include "controller_state.h"

#include <stdexcept>

namespace ads {

void write(const Path& path, control::Path& message) {
  message.set_start_s(path.start_s);
  message.set_step_s(path.step_s);
  for (const Reference& point : path.points) {
    control::Reference& its = *message.add_points();
    its.set_x_m(point.x_m);
    its.set_y_m(point.y_m);
    its.set_heading_rad(point.heading_rad);
    its.set_curvature_per_m(point.curvature_per_m);
    its.set_speed_mps(point.speed_mps);
    its.set_acceleration_mps2(point.acceleration_mps2);
  }
}

Path read(const control::Path& message) {
  if (message.points().empty() || !(message.step_s() > 0.0)) {
    throw std::invalid_argument("the state has a path that cannot be followed");
  }
  Path path{.start_s = message.start_s(), .step_s = message.step_s()};
  for (const control::Reference& point : message.points()) {
    path.points.push_back({.x_m = point.x_m(),
                           .y_m = point.y_m(),
                           .heading_rad = point.heading_rad(),
                           .curvature_per_m = point.curvature_per_m(),
                           .speed_mps = point.speed_mps(),
                           .acceleration_mps2 = point.acceleration_mps2()});
  }
  return path;
}

void write(const Motion& place, control::Place& message) {
  message.set_x_m(place.x_m);
  message.set_y_m(place.y_m);
  message.set_heading_rad(place.heading_rad);
  message.set_speed_mps(place.speed_mps);
}

Motion read(const control::Place& message) {
  return {.x_m = message.x_m(),
          .y_m = message.y_m(),
          .heading_rad = message.heading_rad(),
          .speed_mps = message.speed_mps()};
}

void write(const Tracker::Memory& memory, control::TrackerMemory& message) {
  for (const Tracker::Past& past : memory.past) {
    control::PastCommand& its = *message.add_past();
    its.set_time_s(past.time_s);
    its.set_steering_rad(past.command.steering_rad);
    its.set_acceleration_mps2(past.command.acceleration_mps2);
  }
  message.set_lateral_error_m(memory.error.lateral_m);
  message.set_heading_error_rad(memory.error.heading_rad);
  message.set_speed_error_mps(memory.error.speed_mps);
  message.set_along_error_m(memory.error.along_m);
  message.set_curvature_per_m(memory.curvature_per_m);
  message.set_acceleration_mps2(memory.acceleration_mps2);
}

Tracker::Memory read(const control::TrackerMemory& message) {
  Tracker::Memory memory{.error = {.lateral_m = message.lateral_error_m(),
                                   .heading_rad = message.heading_error_rad(),
                                   .speed_mps = message.speed_error_mps(),
                                   .along_m = message.along_error_m()},
                         .curvature_per_m = message.curvature_per_m(),
                         .acceleration_mps2 = message.acceleration_mps2()};
  for (const control::PastCommand& past : message.past()) {
    memory.past.push_back({.time_s = past.time_s(),
                           .command = {.steering_rad = past.steering_rad(),
                                       .acceleration_mps2 = past.acceleration_mps2()}});
  }
  return memory;
}

}  // namespace ads
