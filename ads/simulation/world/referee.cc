#include "referee.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

namespace ads {
namespace {

// Maps draw lanes that lie side by side with seams of some centimetres between them.
constexpr double kSeam_m = 0.05;

double distance_from_polygon_m(std::span<const Eigen::Vector2d> polygon_m,
                               const Eigen::Vector2d& point_m) {
  if (contains(polygon_m, point_m)) {
    return 0.0;
  }
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t index = 0; index < polygon_m.size(); ++index) {
    least_m = std::min(
        least_m, distance_m(point_m, polygon_m[index], polygon_m[(index + 1) % polygon_m.size()]));
  }
  return least_m;
}

// How far `heading_rad` is from the interval: negative before it, 0 within.
double heading_miss(const Interval& interval, double heading_rad) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double from_low = heading_rad - interval.low;
  const double into = from_low - std::floor(from_low / kTurn) * kTurn;
  const double width = interval.high - interval.low;
  if (into <= width) {
    return 0.0;
  }
  return into - width < kTurn - into ? into - width : into - kTurn;
}

double interval_miss(const Interval& interval, double value) {
  return value < interval.low ? value - interval.low : std::max(0.0, value - interval.high);
}

}  // namespace

Referee::Referee(const Scenario& scenario) : scenario_(scenario), problem_(scenario.problem()) {
  for (const auto& [id, lanelet] : scenario.lanelets) {
    Lane lane{.polygon_m = lanelet.polygon_m(), .least_m = {}, .most_m = {}};
    lane.least_m = lane.polygon_m.front();
    lane.most_m = lane.polygon_m.front();
    for (const Eigen::Vector2d& point : lane.polygon_m) {
      lane.least_m = lane.least_m.cwiseMin(point);
      lane.most_m = lane.most_m.cwiseMax(point);
    }
    lanes_.push_back(std::move(lane));
  }
}

void Referee::watch(double time_s, double seconds, const EgoState& ego, const Box& box,
                    std::span<const Body> bodies) {
  for (const Body& body : bodies) {
    if (!smallest_gap_) {
      smallest_gap_ = Gap();
    }
    // Boxes whose circles are farther apart need no closer look.
    const double reach_m =
        (std::hypot(box.length_m, box.width_m) + std::hypot(body.box.length_m, body.box.width_m)) /
        2.0;
    if ((body.box.center_m - box.center_m).norm() - reach_m > smallest_gap_->gap_m) {
      continue;
    }
    const double gap_m = distance_m(box, body.box);
    if (gap_m < smallest_gap_->gap_m) {
      smallest_gap_ = Gap{.gap_m = gap_m, .id = body.id, .time_s = time_s};
    }
    if (gap_m <= 0.0 && touched_.insert(body.id).second) {
      contacts_.push_back({.id = body.id, .time_s = time_s, .ego_m = ego.center_m});
    }
  }
  if (!is_on_road(ego.center_m)) {
    off_road_s_ += seconds;
    off_road_since_s_ = off_road_since_s_.value_or(time_s);
  }
  extremes_.acceleration_max_mps2 =
      std::max(extremes_.acceleration_max_mps2, ego.acceleration_mps2);
  extremes_.acceleration_min_mps2 =
      std::min(extremes_.acceleration_min_mps2, ego.acceleration_mps2);
  extremes_.lateral_acceleration_max_mps2 = std::max(extremes_.lateral_acceleration_max_mps2,
                                                     std::abs(ego.speed_mps * ego.yaw_rate_radps));
}

void Referee::judge_step(std::int64_t step, const EgoState& ego) {
  const std::int64_t scenario_step = problem_.initial.step + step;
  for (const GoalState& goal : problem_.goals) {
    if (is_goal_reached() || scenario_step < goal.first_step || scenario_step > goal.last_step) {
      continue;
    }
    Miss miss = miss_of(goal, ego);
    miss.time_s = static_cast<double>(step) * scenario_.step_s;
    if (miss.conditions == 0) {
      goal_step_ = step;
    } else if (!nearest_miss_ ||
               std::pair(miss.conditions, miss.outside_m) <
                   std::pair(nearest_miss_->conditions, nearest_miss_->outside_m)) {
      nearest_miss_ = std::move(miss);
    }
  }
}

std::optional<double> Referee::goal_time_s() const {
  return goal_step_ ? std::optional<double>(static_cast<double>(*goal_step_) * scenario_.step_s)
                    : std::nullopt;
}

double Referee::window_end_s() const {
  const auto last = std::ranges::max(problem_.goals, {}, &GoalState::last_step).last_step;
  return static_cast<double>(last - problem_.initial.step) * scenario_.step_s;
}

std::string Referee::verdict() const {
  std::vector<std::string> failures;
  for (const Contact& contact : contacts_) {
    failures.push_back(fmt::format("touched {} at {:.2f} s, at ({:.1f}, {:.1f})", contact.id,
                                   contact.time_s, contact.ego_m.x(), contact.ego_m.y()));
  }
  if (off_road_since_s_) {
    failures.push_back(fmt::format("was off the road for {:.2f} s, first at {:.2f} s", off_road_s_,
                                   *off_road_since_s_));
  }
  if (!goal_step_ && nearest_miss_) {
    failures.push_back(fmt::format("missed the goal, by least at {:.1f} s: {}",
                                   nearest_miss_->time_s, nearest_miss_->words));
  } else if (!goal_step_) {
    failures.emplace_back("ended before the goal's window");
  }
  return failures.empty() ? fmt::format("reached the goal at {:.1f} s", *goal_time_s())
                          : fmt::format("failed: {}", fmt::join(failures, "; "));
}

bool Referee::is_on_road(const Eigen::Vector2d& point_m) const {
  return lanes_.empty() || std::ranges::any_of(lanes_, [&](const Lane& lane) {
           return (point_m.array() >= lane.least_m.array() - kSeam_m).all() &&
                  (point_m.array() <= lane.most_m.array() + kSeam_m).all() &&
                  distance_from_polygon_m(lane.polygon_m, point_m) <= kSeam_m;
         });
}

// How far the point is from where the goal wants it; 0 if it is there.
double Referee::outside_m(const GoalState& goal, const Eigen::Vector2d& point_m) const {
  if (!goal.has_position()) {
    return 0.0;
  }
  double least_m = std::numeric_limits<double>::infinity();
  for (const Box& box : goal.boxes) {
    least_m = std::min(
        least_m, box.contains(point_m) ? 0.0 : distance_from_polygon_m(box.corners(), point_m));
  }
  for (const Circle& circle : goal.circles) {
    least_m =
        std::min(least_m, std::max(0.0, (point_m - circle.center_m).norm() - circle.radius_m));
  }
  for (const auto& polygon : goal.polygons) {
    least_m = std::min(least_m, distance_from_polygon_m(polygon, point_m));
  }
  for (const std::int64_t id : goal.lanelets) {
    if (const auto lanelet = scenario_.lanelets.find(id); lanelet != scenario_.lanelets.end()) {
      least_m = std::min(least_m, distance_from_polygon_m(lanelet->second.polygon_m(), point_m));
    }
  }
  return least_m;
}

Referee::Miss Referee::miss_of(const GoalState& goal, const EgoState& ego) const {
  std::vector<std::string> words;
  const double outside = outside_m(goal, ego.center_m);
  if (outside > 0.0) {
    words.push_back(fmt::format("{:.2f} m outside of its area", outside));
  }
  if (const double off_rad =
          goal.heading_rad ? heading_miss(*goal.heading_rad, ego.heading_rad) : 0.0;
      off_rad != 0.0) {
    words.push_back(fmt::format("heading {:.3f} rad too far to the {}", std::abs(off_rad),
                                off_rad > 0.0 ? "left" : "right"));
  }
  if (const double off_mps = goal.speed_mps ? interval_miss(*goal.speed_mps, ego.speed_mps) : 0.0;
      off_mps != 0.0) {
    words.push_back(
        fmt::format("{:.2f} m/s too {}", std::abs(off_mps), off_mps > 0.0 ? "fast" : "slow"));
  }
  return {.conditions = words.size(),
          .outside_m = outside,
          .words = fmt::format("{}", fmt::join(words, ", "))};
}

}  // namespace ads
