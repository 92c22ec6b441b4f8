#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "hd_map/map.pb.h"
#include "planning/plan.pb.h"
#include "prediction/prediction.pb.h"

namespace plan_checker {

/// For tests: a straight road along x, two lanes of 3.5 m, y from -1.75 m to 5.25 m.

constexpr double kStep_s = 0.1;

/// Along x at `y_m`, starting at x = 0.
inline void write_straight(planning::Trajectory& trajectory, std::int64_t start_ns,
                           double speed_mps, double acceleration_mps2, double y_m = 0.0,
                           int points = 61) {
  trajectory.set_start_ns(start_ns);
  const double stop_s = acceleration_mps2 < 0.0 ? -speed_mps / acceleration_mps2
                                                : std::numeric_limits<double>::infinity();
  for (int index = 0; index < points; ++index) {
    const double time_s = kStep_s * index;
    const double moved_s = std::fmin(time_s, stop_s);
    planning::TrajectoryPoint& point = *trajectory.add_points();
    point.set_time_s(time_s);
    point.set_x_m(moved_s * (speed_mps + 0.5 * acceleration_mps2 * moved_s));
    point.set_y_m(y_m);
    point.set_speed_mps(speed_mps + acceleration_mps2 * moved_s);
    point.set_acceleration_mps2(time_s < stop_s ? acceleration_mps2 : 0.0);
  }
}

/// At a constant speed around a circle that begins at x = 0, y = 0; turns left.
inline void write_circle(planning::Trajectory& trajectory, std::int64_t start_ns, double speed_mps,
                         double curvature_per_m, double centre_to_rear_axle_m) {
  trajectory.set_start_ns(start_ns);
  for (int index = 0; index <= 60; ++index) {
    const double time_s = kStep_s * index;
    const double heading = curvature_per_m * speed_mps * time_s;
    planning::TrajectoryPoint& point = *trajectory.add_points();
    point.set_time_s(time_s);
    const double lever = centre_to_rear_axle_m;
    point.set_x_m(std::sin(heading) / curvature_per_m + lever * std::cos(heading) - lever);
    point.set_y_m((1.0 - std::cos(heading)) / curvature_per_m + lever * std::sin(heading));
    point.set_heading_rad(std::remainder(heading, 2.0 * std::numbers::pi));
    point.set_curvature_per_m(curvature_per_m);
    point.set_speed_mps(speed_mps);
  }
}

inline planning::Plan straight_plan(std::int64_t now_ns, double speed_mps = 10.0,
                                    double y_m = 0.0) {
  planning::Plan plan;
  plan.mutable_header()->set_taken_ns(now_ns - 80'000'000);
  write_straight(*plan.mutable_nominal(), now_ns, speed_mps, 0.0, y_m);
  write_straight(*plan.mutable_minimal_risk(), now_ns, speed_mps, -3.0, y_m);
  return plan;
}

inline void add_lane(hd_map::Tile& tile, std::int64_t id, double right_m, double left_m,
                     double speed_limit_mps, double from_m = -200.0, double to_m = 400.0) {
  hd_map::Lane& lane = *tile.add_lanes();
  lane.set_id(id);
  lane.set_speed_limit_mps(speed_limit_mps);
  for (const double x : {from_m, to_m}) {
    lane.mutable_left()->add_x_m(x);
    lane.mutable_left()->add_y_m(left_m);
    lane.mutable_right()->add_x_m(x);
    lane.mutable_right()->add_y_m(right_m);
  }
}

inline hd_map::Tile two_lanes(double speed_limit_mps = 0.0) {
  hd_map::Tile tile;
  tile.set_radius_m(1000.0);
  add_lane(tile, 1, -1.75, 1.75, speed_limit_mps);
  add_lane(tile, 2, 1.75, 5.25, speed_limit_mps);
  return tile;
}

/// A car of 4.5 m by 1.8 m that keeps its speed along x.
inline void add_car(prediction::Predictions& predictions, double x_m, double y_m, double speed_mps,
                    double probability = 1.0) {
  prediction::PredictedObject& car = *predictions.add_objects();
  perception::Object& object = *car.mutable_object()->mutable_object();
  object.set_id(7);
  object.set_length_m(4.5);
  object.set_width_m(1.8);
  prediction::Hypothesis& way = *car.add_hypotheses();
  way.set_probability(probability);
  for (int index = 0; index <= 60; ++index) {
    prediction::Point& point = *way.add_points();
    point.set_time_s(kStep_s * index);
    point.set_x_m(x_m + speed_mps * kStep_s * index);
    point.set_y_m(y_m);
    point.set_speed_mps(speed_mps);
  }
}

}  // namespace plan_checker
