#include "rules.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "common/plane.h"
#include "common/scalar.h"
#include "plan_checker_tuning.h"

namespace plan_checker {
namespace {

using ads::kInfinity;
using ads::seconds_of;

using planning::Trajectory;
using planning::TrajectoryPoint;

bool is_finite(const TrajectoryPoint& point) {
  return std::isfinite(point.time_s()) && std::isfinite(point.x_m()) &&
         std::isfinite(point.y_m()) && std::isfinite(point.heading_rad()) &&
         std::isfinite(point.curvature_per_m()) && std::isfinite(point.speed_mps()) &&
         std::isfinite(point.acceleration_mps2());
}

Eigen::Vector2d place_of(const TrajectoryPoint& point) {
  return {point.x_m(), point.y_m()};
}

// Between the points; the first or the last beyond the ends.
Motion motion_at(const Trajectory& trajectory, double time_s) {
  const auto& points = trajectory.points();
  const auto after = std::ranges::lower_bound(points, time_s, {}, &TrajectoryPoint::time_s);
  const TrajectoryPoint& to = after == points.end() ? points[points.size() - 1] : *after;
  const TrajectoryPoint& from =
      after == points.begin() || after == points.end() ? to : *(after - 1);
  const double span_s = to.time_s() - from.time_s();
  const double share = span_s > 0.0 ? (time_s - from.time_s()) / span_s : 0.0;
  const double turn = ads::normalize_angle(to.heading_rad() - from.heading_rad());
  return {.x_m = std::lerp(from.x_m(), to.x_m(), share),
          .y_m = std::lerp(from.y_m(), to.y_m(), share),
          .heading_rad = from.heading_rad() + share * turn,
          .speed_mps = std::lerp(from.speed_mps(), to.speed_mps(), share)};
}

ads::Box box_of(const Motion& motion, double length_m, double width_m) {
  return {.center_m = {motion.x_m, motion.y_m},
          .heading_rad = motion.heading_rad,
          .length_m = length_m,
          .width_m = width_m};
}

// The most that any part of the body is beyond the road.
double beyond_m(const RoadArea& road, const ads::Box& body) {
  const Eigen::Vector2d forward = ads::direction(body.heading_rad) * (body.length_m / 2.0);
  const Eigen::Vector2d left =
      ads::left_of(ads::direction(body.heading_rad)) * (body.width_m / 2.0);
  double most_m = 0.0;
  for (const double ahead : {-1.0, 0.0, 1.0}) {
    for (const double aside : {-1.0, 1.0}) {
      const Eigen::Vector2d place = body.center_m + ahead * forward + aside * left;
      most_m = std::max(most_m, road.covers(place) ? road.beyond_m(place) : 0.0);
    }
  }
  return most_m;
}

// Where an object is on a way; beyond its ends it goes straight on.
std::optional<Motion> object_at(const prediction::Hypothesis& way, double time_s) {
  if (way.points().empty()) {
    return std::nullopt;
  }
  const auto& points = way.points();
  const auto after = std::ranges::lower_bound(points, time_s, {}, &prediction::Point::time_s);
  const prediction::Point& to = after == points.end() ? points[points.size() - 1] : *after;
  const prediction::Point& from =
      after == points.begin() || after == points.end() ? to : *(after - 1);
  const double span_s = to.time_s() - from.time_s();
  const double share = span_s > 0.0 ? (time_s - from.time_s()) / span_s : 0.0;
  const double turn = to.heading_rad() - from.heading_rad();
  Motion motion{
      .x_m = std::lerp(from.x_m(), to.x_m(), share),
      .y_m = std::lerp(from.y_m(), to.y_m(), share),
      .heading_rad = from.heading_rad() + share * std::remainder(turn, 2.0 * std::numbers::pi),
      .speed_mps = std::lerp(from.speed_mps(), to.speed_mps(), share)};
  const double beyond_s = &from == &to ? time_s - to.time_s() : 0.0;
  motion.x_m += beyond_s * motion.speed_mps * std::cos(motion.heading_rad);
  motion.y_m += beyond_s * motion.speed_mps * std::sin(motion.heading_rad);
  const bool is_finite =
      std::isfinite(motion.x_m + motion.y_m + motion.heading_rad + motion.speed_mps);
  return is_finite ? std::optional(motion) : std::nullopt;
}

// Objects that approach from behind must keep their distance, as must those that drive into a
// standing vehicle.
bool is_others_to_avoid(const Motion& body, double length_m, const Motion& object) {
  if (body.speed_mps < kRules.standing_mps) {
    return true;
  }
  const Eigen::Vector2d forward = ads::direction(body.heading_rad);
  const double ahead_m =
      (Eigen::Vector2d(object.x_m, object.y_m) - Eigen::Vector2d(body.x_m, body.y_m)).dot(forward);
  const double closing_mps =
      object.speed_mps * std::cos(object.heading_rad - body.heading_rad) - body.speed_mps;
  return ahead_m < -length_m / 2.0 && closing_mps > 0.0;
}

// Collects the breaches of one plan: of each rule and trajectory the first hard one, else the first
// soft one.
class Breaches {
 public:
  explicit Breaches(planning::PlanVerdict& verdict) : verdict_(verdict) {}

  void of(const Trajectory& trajectory, bool is_minimal_risk) {
    trajectory_ = &trajectory;
    is_minimal_risk_ = is_minimal_risk;
  }

  void add(planning::Rule rule, bool is_hard, double time_s, double value, double limit,
           const std::string& what) {
    auto* known = find(rule);
    if (known != nullptr && (known->is_hard() || !is_hard)) {
      return;
    }
    planning::RuleBreach& breach = known != nullptr ? *known : *verdict_.add_breaches();
    breach.set_rule(rule);
    breach.set_is_hard(is_hard);
    breach.set_is_minimal_risk(is_minimal_risk_);
    breach.set_time_s(time_s);
    breach.set_value(value);
    breach.set_limit(limit);
    breach.set_text(is_minimal_risk_ ? "minimal-risk trajectory: " + what : what);
  }

  // Beyond `hard` it is a hard breach, beyond `soft` a note. `what` has {0} for the value, {1} for
  // the time and {2} for the limit.
  void above(planning::Rule rule, double value, double soft, double hard, double time_s,
             fmt::string_view what) {
    if (!(value <= std::min(soft, hard))) {
      const bool is_hard = !(value <= hard);
      const double limit = is_hard ? hard : soft;
      add(rule, is_hard, time_s, value, limit,
          fmt::format(fmt::runtime(what), value, time_s, limit));
    }
  }

 private:
  planning::RuleBreach* find(planning::Rule rule) {
    for (planning::RuleBreach& breach : *verdict_.mutable_breaches()) {
      if (breach.rule() == rule && breach.is_minimal_risk() == is_minimal_risk_) {
        return &breach;
      }
    }
    return nullptr;
  }

  planning::PlanVerdict& verdict_;
  const Trajectory* trajectory_ = nullptr;
  bool is_minimal_risk_ = false;
};

// The checks of one trajectory of a plan.
class TrajectoryCheck {
 public:
  TrajectoryCheck(const Limits& limits, const Rules& rules, const Surroundings& around,
                  const Trajectory& trajectory, bool is_minimal_risk, Breaches& breaches)
      : limits_(limits),
        rules_(rules),
        around_(around),
        trajectory_(trajectory),
        is_minimal_risk_(is_minimal_risk),
        breaches_(breaches) {
    breaches_.of(trajectory, is_minimal_risk);
  }

  void run() {
    if (!check_numbers() || !check_times()) {
      return;  // No further rule can be checked.
    }
    check_age();
    check_start();
    check_motion();
    check_forces();
    check_speeds();
    check_road();
    check_objects();
  }

 private:
  // Whether what is planned there will be driven, and not replaced by another plan before.
  [[nodiscard]] bool is_near(const TrajectoryPoint& at) const {
    return !is_minimal_risk_ && at.time_s() <= limits_.certain_s;
  }
  // The hard limit there: no limit where a breach is a note. A plan begins with what the vehicle
  // does already.
  [[nodiscard]] double hard(const TrajectoryPoint& at, double limit, double at_begin = 0.0) const {
    return is_near(at) ? std::max(limit, at_begin) : kInfinity;
  }
  [[nodiscard]] static double lateral_mps2(const TrajectoryPoint& at) {
    return std::abs(at.curvature_per_m()) * at.speed_mps() * at.speed_mps();
  }

  [[nodiscard]] const TrajectoryPoint& point(int index) const { return trajectory_.points(index); }
  [[nodiscard]] int size() const { return trajectory_.points_size(); }

  bool check_numbers() {
    for (int index = 0; index < size(); ++index) {
      if (!is_finite(point(index))) {
        breaches_.add(planning::FINITE_NUMBERS, true, 0.0, index, 0.0,
                      fmt::format("point {} has a number that is not finite", index));
        return false;
      }
    }
    return true;
  }

  bool check_times() {
    if (size() < 2) {
      breaches_.add(planning::HORIZON, true, 0.0, size(), 2.0,
                    fmt::format("it has {} points, and needs 2 at least", size()));
      return false;
    }
    const double step_s = point(1).time_s() - point(0).time_s();
    if (!(step_s > kRules.time_error_s && step_s <= kRules.step_max_s)) {
      breaches_.add(planning::TIMES, true, 0.0, step_s, kRules.step_max_s,
                    fmt::format("points are {:.3f} s apart, and have to be up to {:.1f} s", step_s,
                                kRules.step_max_s));
      return false;
    }
    for (int index = 0; index < size(); ++index) {
      const double expected_s = step_s * index;
      if (!(std::abs(point(index).time_s() - expected_s) <= kRules.time_error_s)) {
        breaches_.add(planning::TIMES, true, expected_s, point(index).time_s(), expected_s,
                      fmt::format("point {} is at {:.3f} s, expected {:.3f} s", index,
                                  point(index).time_s(), expected_s));
        return false;
      }
    }
    const TrajectoryPoint& last = point(size() - 1);
    if (last.time_s() < limits_.horizon_min_s && last.speed_mps() > kRules.standing_mps) {
      breaches_.add(planning::HORIZON, true, last.time_s(), last.time_s(), limits_.horizon_min_s,
                    fmt::format("it ends after {:.1f} s at {:.1f} m/s, at least {:.1f} s, or a "
                                "stand, are needed",
                                last.time_s(), last.speed_mps(), limits_.horizon_min_s));
    }
    return true;
  }

  void check_age() {
    const double age_s = seconds_of(around_.now_ns - trajectory_.start_ns());
    breaches_.above(planning::AGE, age_s, limits_.age_max_s, limits_.age_max_s, 0.0,
                    "it began {0:.2f} s ago, at most {2:.2f} s are allowed");
    breaches_.above(planning::AGE, -age_s, kRules.ahead_s, kRules.ahead_s, 0.0,
                    "it begins {0:.2f} s from now, at most {2:.2f} s are allowed");
  }

  void check_start() {
    if (!around_.ego) {
      return;
    }
    const Motion& ego = *around_.ego;
    const double now_s = seconds_of(around_.now_ns - trajectory_.start_ns());
    const Motion planned = motion_at(trajectory_, now_s);
    const double away_m = std::hypot(planned.x_m - ego.x_m, planned.y_m - ego.y_m);
    breaches_.above(planning::START, away_m, limits_.start_distance_max_m,
                    limits_.start_distance_max_m, now_s,
                    "it begins {0:.2f} m from the vehicle, at most {2:.2f} m are allowed");
    const double turned = std::abs(ads::normalize_angle(planned.heading_rad - ego.heading_rad));
    breaches_.above(planning::START, turned, limits_.start_heading_max_rad,
                    limits_.start_heading_max_rad, now_s,
                    "it begins turned by {0:.2f} rad from the vehicle, at most {2:.2f} rad are "
                    "allowed");
    breaches_.above(planning::START, std::abs(planned.speed_mps - ego.speed_mps),
                    limits_.start_speed_max_mps, limits_.start_speed_max_mps, now_s,
                    "its speed at the begin is {0:.2f} m/s from the vehicle's, at most {2:.2f} m/s "
                    "are allowed");
  }

  [[nodiscard]] Eigen::Vector2d rear_axle(const TrajectoryPoint& at) const {
    return place_of(at) - limits_.centre_to_rear_axle_m * ads::direction(at.heading_rad());
  }

  // The kinematic single-track model, rolling without slip: the rear axle moves along the heading,
  // which turns by curvature times way.
  void check_motion() {
    for (int index = 0; index + 1 < size(); ++index) {
      const TrajectoryPoint& from = point(index);
      const TrajectoryPoint& to = point(index + 1);
      const double step_s = to.time_s() - from.time_s();
      const double turn = ads::normalize_angle(to.heading_rad() - from.heading_rad());
      const Eigen::Vector2d forward = ads::direction(from.heading_rad() + 0.5 * turn);
      const double expected_m = 0.5 * (from.speed_mps() + to.speed_mps()) * step_s;
      const Eigen::Vector2d error = rear_axle(to) - rear_axle(from) - expected_m * forward;
      const double factor = is_near(to) ? 1.0 : limits_.motion_later_factor;
      const double allowed_m = factor * (limits_.motion_distance_max_m +
                                         limits_.motion_distance_max_share * std::abs(expected_m));
      breaches_.above(planning::MOTION, error.norm(), allowed_m, allowed_m, to.time_s(),
                      "place and speed are {0:.2f} m apart at {1:.1f} s, at most {2:.2f} m are "
                      "allowed");
      const double expected_turn =
          0.5 * step_s *
          (from.speed_mps() * from.curvature_per_m() + to.speed_mps() * to.curvature_per_m());
      breaches_.above(planning::MOTION, std::abs(turn - expected_turn),
                      limits_.motion_heading_max_rad, hard(to, limits_.motion_heading_max_rad),
                      to.time_s(),
                      "heading and curvature are {0:.3f} rad apart at {1:.1f} s, at most {2:.3f} "
                      "rad are allowed");
      if (std::min(from.speed_mps(), to.speed_mps()) > kRules.standing_mps) {
        const double gained = (to.speed_mps() - from.speed_mps()) / step_s;
        const double stated = 0.5 * (from.acceleration_mps2() + to.acceleration_mps2());
        breaches_.above(planning::MOTION, std::abs(gained - stated),
                        limits_.motion_acceleration_max_mps2,
                        hard(to, limits_.motion_acceleration_max_mps2), to.time_s(),
                        "speed and acceleration are {0:.1f} m/s^2 apart at {1:.1f} s, at most "
                        "{2:.1f} m/s^2 are allowed");
      }
    }
  }

  void check_forces() {
    const double curvature_max = std::tan(limits_.steering_max_rad) / limits_.wheelbase_m;
    const TrajectoryPoint& begin = point(0);
    for (int index = 0; index < size(); ++index) {
      const TrajectoryPoint& at = point(index);
      const double time_s = at.time_s();
      breaches_.above(planning::CURVATURE, std::abs(at.curvature_per_m()), curvature_max,
                      hard(at, kRules.steering_allowance * curvature_max), time_s,
                      "the curvature is {0:.2f}/m at {1:.1f} s, at most {2:.2f}/m is possible");
      breaches_.above(planning::ACCELERATION, -at.acceleration_mps2(), limits_.comfort_braking_mps2,
                      hard(at, limits_.braking_max_mps2, -begin.acceleration_mps2()), time_s,
                      "it brakes with {0:.1f} m/s^2 at {1:.1f} s, limit {2:.1f} m/s^2");
      breaches_.above(planning::ACCELERATION, at.acceleration_mps2(),
                      limits_.comfort_acceleration_mps2,
                      hard(at, limits_.acceleration_max_mps2, begin.acceleration_mps2()), time_s,
                      "it accelerates with {0:.1f} m/s^2 at {1:.1f} s, limit {2:.1f} m/s^2");
      breaches_.above(
          planning::LATERAL_ACCELERATION, lateral_mps2(at), limits_.comfort_lateral_mps2,
          hard(at, limits_.lateral_max_mps2, lateral_mps2(begin)), time_s,
          "the lateral acceleration is {0:.1f} m/s^2 at {1:.1f} s, limit {2:.1f} m/s^2");
      if (index > 0) {
        check_change(point(index - 1), at);
      }
    }
  }

  void check_change(const TrajectoryPoint& from, const TrajectoryPoint& to) {
    const double step_s = to.time_s() - from.time_s();
    if (std::min(from.speed_mps(), to.speed_mps()) <= kRules.standing_mps) {
      return;
    }
    const double jerk = std::abs(to.acceleration_mps2() - from.acceleration_mps2()) / step_s;
    breaches_.above(planning::JERK, jerk, limits_.comfort_jerk_mps3,
                    hard(to, limits_.jerk_max_mps3), to.time_s(),
                    "the jerk is {0:.0f} m/s^3 at {1:.1f} s, limit {2:.0f} m/s^3");
    const double steering = std::atan(limits_.wheelbase_m * to.curvature_per_m()) -
                            std::atan(limits_.wheelbase_m * from.curvature_per_m());
    breaches_.above(planning::STEERING_RATE, std::abs(steering) / step_s,
                    1.05 * limits_.steering_rate_max_radps,
                    hard(to, kRules.jump * limits_.steering_rate_max_radps), to.time_s(),
                    "the wheels turn with {0:.2f} rad/s at {1:.1f} s, limit {2:.2f} rad/s");
  }

  void check_speeds() {
    const double begin_mps = point(0).speed_mps();
    for (int index = 0; index < size(); ++index) {
      const TrajectoryPoint& at = point(index);
      const double time_s = at.time_s();
      const double speed = at.speed_mps();
      breaches_.above(planning::SPEED, -speed, kRules.backwards_mps, kRules.backwards_mps, time_s,
                      "it drives backwards with {0:.1f} m/s at {1:.1f} s, limit {2:.1f} m/s");
      breaches_.above(planning::SPEED, speed, limits_.speed_max_mps, limits_.speed_max_mps, time_s,
                      "it drives {0:.1f} m/s at {1:.1f} s, the vehicle at most {2:.1f} m/s");
      if (around_.road == nullptr || !is_looked_at(index)) {
        continue;
      }
      if (const auto limit = around_.road->speed_limit(place_of(at), at.heading_rad())) {
        check_speed_limit(*limit, at, begin_mps);
      }
    }
  }

  // A vehicle that is too fast already may slow down gently; that is only noted.
  void check_speed_limit(const RoadArea::SpeedLimit& limit, const TrajectoryPoint& at,
                         double begin_mps) {
    const double noted = limit.mps + limits_.speed_limit_excess_noted_mps;
    const double most = std::max(limit.mps, begin_mps) + limits_.speed_limit_excess_max_mps;
    breaches_.above(planning::SPEED_LIMIT, at.speed_mps(), noted, hard(at, most), at.time_s(),
                    fmt::format("it drives {{0:.1f}} m/s at {{1:.1f}} s, {:.1f} m/s is the limit "
                                "of lane {}",
                                limit.mps, limit.lane));
  }

  // Whether the point is near enough to be tested, or one of the tested ones farther away.
  [[nodiscard]] bool is_looked_at(int index) const {
    const double step_s = point(1).time_s() - point(0).time_s();
    const int every = std::max(1, static_cast<int>(kRules.far_step_s / step_s));
    return point(index).time_s() <= limits_.certain_s || index % every == 0;
  }

  void check_road() {
    if (around_.road == nullptr || around_.road->is_empty()) {
      return;
    }
    const auto body_at = [this](int index) {
      const TrajectoryPoint& at = point(index);
      return ads::Box{.center_m = place_of(at),
                      .heading_rad = at.heading_rad(),
                      .length_m = limits_.length_m,
                      .width_m = limits_.width_m};
    };
    // A vehicle that is beside the road already comes back.
    const double begin_m = beyond_m(*around_.road, body_at(0));
    for (int index = 0; index < size(); ++index) {
      if (!is_looked_at(index)) {
        continue;
      }
      const double time_s = point(index).time_s();
      const double over_m = beyond_m(*around_.road, body_at(index));
      breaches_.above(planning::ROAD, over_m, begin_m + limits_.over_edge_noted_m,
                      hard(point(index), begin_m + limits_.over_edge_max_m), time_s,
                      "the body is {0:.2f} m off the road at {1:.1f} s, limit {2:.2f} m");
    }
  }

  void check_objects() {
    if (around_.predictions == nullptr) {
      return;
    }
    const auto add_breach = [this](const Rules::Touch& touch, bool is_hard, double limit_m) {
      breaches_.add(
          planning::COLLISION, is_hard, touch.point_s, touch.gap_m, limit_m,
          fmt::format("the gap to object {}, at {:.1f} m/s, is {:.2f} m at {:.1f} s, at least "
                      "{:.2f} m are needed",
                      touch.object, touch.object_mps, touch.gap_m, touch.point_s, limit_m));
    };
    const Rules::Touch close =
        rules_.first_touch(trajectory_, around_, limits_.gap_noted_m, kInfinity);
    if (!std::isfinite(close.time_s)) {
      return;
    }
    const Rules::Touch touch =
        rules_.first_touch(trajectory_, around_, limits_.gap_min_m, limits_.collision_certain_s);
    // The minimal-risk trajectory is driven when all else has failed: it does what it can.
    const bool is_hard = std::isfinite(touch.time_s) && !is_minimal_risk_;
    add_breach(is_hard ? touch : close, is_hard, is_hard ? limits_.gap_min_m : limits_.gap_noted_m);
  }

  const Limits& limits_;
  const Rules& rules_;
  const Surroundings& around_;
  const Trajectory& trajectory_;
  const bool is_minimal_risk_;
  Breaches& breaches_;
};

/// Both kinds stay in their order.
void put_hard_ones_first(google::protobuf::RepeatedPtrField<planning::RuleBreach>& breaches) {
  int hard = 0;
  for (int at = 0; at < breaches.size(); ++at) {
    if (breaches[at].is_hard()) {
      for (int place = at; place > hard; --place) {
        breaches.SwapElements(place, place - 1);
      }
      ++hard;
    }
  }
}

}  // namespace

Rules::Touch Rules::first_touch(const Trajectory& trajectory, const Surroundings& around,
                                double gap_m, double until_s) const {
  Touch first{
      .time_s = kInfinity, .point_s = 0.0, .gap_m = kInfinity, .object = 0, .object_mps = 0.0};
  if (around.predictions == nullptr || trajectory.points().empty()) {
    return first;
  }
  // A prediction continues through the vehicle; the duty to avoid the contact does not change then.
  std::set<const prediction::Hypothesis*> others_to_avoid;
  const double reach_m = std::hypot(limits_.length_m, limits_.width_m) / 2.0;
  const double now_s = seconds_of(around.now_ns - trajectory.start_ns());
  for (const TrajectoryPoint& point : trajectory.points()) {
    const double time_s = point.time_s() - now_s;
    if (time_s > until_s) {
      break;
    }
    if (time_s < 0.0) {
      continue;
    }
    const Motion body{.x_m = point.x_m(),
                      .y_m = point.y_m(),
                      .heading_rad = point.heading_rad(),
                      .speed_mps = point.speed_mps()};
    const double predicted_s =
        seconds_of(around.now_ns - around.predictions->header().taken_ns()) + time_s;
    for (const prediction::PredictedObject& predicted : around.predictions->objects()) {
      const perception::Object& object = predicted.object().object();
      const double radius_m = std::hypot(object.length_m(), object.width_m()) / 2.0;
      if (!std::isfinite(radius_m)) {
        continue;
      }
      for (const prediction::Hypothesis& way : predicted.hypotheses()) {
        if (!(way.probability() >= kRules.likely)) {
          continue;
        }
        const std::optional<Motion> other = object_at(way, predicted_s);
        if (!other ||
            std::hypot(other->x_m - body.x_m, other->y_m - body.y_m) > reach_m + radius_m + gap_m) {
          continue;
        }
        const double gap = ads::distance_m(box_of(body, limits_.length_m, limits_.width_m),
                                           box_of(*other, object.length_m(), object.width_m()));
        if (gap < gap_m && is_others_to_avoid(body, limits_.length_m, *other)) {
          others_to_avoid.insert(&way);
        } else if (gap < gap_m && gap < first.gap_m && !others_to_avoid.contains(&way)) {
          first = {.time_s = time_s,
                   .point_s = point.time_s(),
                   .gap_m = gap,
                   .object = object.id(),
                   .object_mps = other->speed_mps};
        }
      }
    }
    if (std::isfinite(first.time_s)) {
      break;
    }
  }
  return first;
}

namespace {

void check_inputs(const Limits& limits, const planning::Plan& plan, const Surroundings& around,
                  Breaches& breaches) {
  breaches.of(plan.nominal(), false);
  const auto missing = [&](bool is_missing, const char* what) {
    if (is_missing) {
      breaches.add(planning::INPUTS, true, 0.0, 0.0, 0.0, fmt::format("{} is not known", what));
    }
  };
  missing(!around.ego, "where the vehicle is");
  missing(around.predictions == nullptr, "what others will do");
  missing(around.road == nullptr, "the road");
  const double plan_age_s = seconds_of(around.now_ns - plan.header().taken_ns());
  breaches.above(planning::AGE, plan_age_s, limits.age_max_s, limits.age_max_s, 0.0,
                 "it was made for what was seen {0:.2f} s ago, at most {2:.2f} s are allowed");
  if (around.predictions != nullptr) {
    const double age_s = seconds_of(around.now_ns - around.predictions->header().taken_ns());
    breaches.above(planning::AGE, age_s, limits.age_max_s, limits.age_max_s, 0.0,
                   "predictions are {0:.2f} s old, at most {2:.2f} s are allowed");
  }
}

}  // namespace

bool Rules::is_apart_without(const planning::Plan& plan, const Surroundings& around) const {
  if (around.accepted == nullptr) {
    // A plan declared as the best of bad ones is better than none.
    return plan.kind() == planning::NOMINAL;
  }
  const double own_s =
      first_touch(plan.nominal(), around, limits_.gap_min_m, limits_.collision_certain_s).time_s;
  const double until_s = own_s + limits_.later_s;
  const auto touches = [&](const Trajectory& trajectory) {
    return std::isfinite(first_touch(trajectory, around, limits_.gap_min_m, until_s).time_s);
  };
  return !touches(around.accepted->nominal()) || !touches(around.accepted->minimal_risk());
}

double Rules::most_beyond_m(const Trajectory& trajectory, const Surroundings& around) const {
  const double now_s = seconds_of(around.now_ns - trajectory.start_ns());
  double most_m = 0.0;
  for (const TrajectoryPoint& point : trajectory.points()) {
    if (point.time_s() >= now_s && point.time_s() <= now_s + limits_.certain_s) {
      const ads::Box body{.center_m = place_of(point),
                          .heading_rad = point.heading_rad(),
                          .length_m = limits_.length_m,
                          .width_m = limits_.width_m};
      most_m = std::max(most_m, beyond_m(*around.road, body));
    }
  }
  return most_m;
}

bool Rules::is_on_road_without(const planning::Plan& plan, const Surroundings& around) const {
  if (around.accepted == nullptr || around.road == nullptr) {
    return plan.kind() == planning::NOMINAL;
  }
  return most_beyond_m(around.accepted->minimal_risk(), around) <
         most_beyond_m(plan.nominal(), around);
}

// Makes a hard breach of the nominal trajectory a note.
void Rules::except(planning::Rule rule, const std::string& why,
                   planning::PlanVerdict& verdict) const {
  for (planning::RuleBreach& breach : *verdict.mutable_breaches()) {
    if (breach.rule() == rule && breach.is_hard()) {
      breach.set_is_hard(false);
      verdict.set_exception(why);
    }
  }
}

void Rules::check(const planning::Plan& plan, const Surroundings& around,
                  planning::PlanVerdict& verdict) const {
  *verdict.mutable_header() = plan.header();
  verdict.set_plan_start_ns(plan.nominal().start_ns());
  verdict.set_plan_kind(plan.kind());
  Breaches breaches(verdict);
  check_inputs(limits_, plan, around, breaches);
  TrajectoryCheck(limits_, *this, around, plan.nominal(), false, breaches).run();
  TrajectoryCheck(limits_, *this, around, plan.minimal_risk(), true, breaches).run();

  if (!is_apart_without(plan, around)) {
    except(planning::COLLISION, "what would be driven without it touches something as early",
           verdict);
  }
  if (!is_on_road_without(plan, around)) {
    except(planning::ROAD, "what would be driven without it leaves the road farther", verdict);
  }
  put_hard_ones_first(*verdict.mutable_breaches());
  verdict.set_is_accepted(verdict.breaches().empty() || !verdict.breaches(0).is_hard());
  if (!verdict.is_accepted()) {
    verdict.set_reason(verdict.breaches(0).text());
  }
}

}  // namespace plan_checker
