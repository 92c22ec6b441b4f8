#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "common/commonroad.h"
#include "ego_model.h"
#include "traffic.h"

namespace ads {

/// Judges a drive by ground truth: whether the goal was reached, and collisions on the way.
///
/// Times are seconds since the drive began, which is at the step of the initial state.
///
/// @threads  Confined to its component.
class Referee {
 public:
  struct Contact {
    std::int64_t id = 0;
    double time_s = 0.0;
    Eigen::Vector2d ego_m = Eigen::Vector2d::Zero();
  };
  struct Gap {
    double gap_m = std::numeric_limits<double>::infinity();
    std::int64_t id = 0;
    double time_s = 0.0;
  };
  struct Extremes {
    double acceleration_max_mps2 = 0.0;
    double acceleration_min_mps2 = 0.0;
    double lateral_acceleration_max_mps2 = 0.0;  ///< To either side: speed times yaw rate.
  };

  /// Judges by the scenario's first planning problem.
  explicit Referee(const Scenario& scenario);

  /// Evaluates the world at `time_s`, `seconds` after the previous call.
  void watch(double time_s, double seconds, const EgoState& ego, const Box& box,
             std::span<const Body> bodies);
  /// Checks whether the goal is reached at a step of the scenario, counted from the drive's begin.
  void judge_step(std::int64_t step, const EgoState& ego);

  [[nodiscard]] bool is_goal_reached() const { return goal_step_.has_value(); }
  [[nodiscard]] std::optional<double> goal_time_s() const;
  /// The end of the last window in which a goal can be reached.
  [[nodiscard]] double window_end_s() const;

  /// One for each body touched, in the order of time.
  [[nodiscard]] const std::vector<Contact>& contacts() const { return contacts_; }
  /// None if there was no other body at all.
  [[nodiscard]] const std::optional<Gap>& smallest_gap() const { return smallest_gap_; }
  [[nodiscard]] double off_road_s() const { return off_road_s_; }
  [[nodiscard]] const Extremes& extremes() const { return extremes_; }

  /// The result as text: that the goal was reached, or all that went wrong.
  [[nodiscard]] std::string verdict() const;

 private:
  // A lanelet's edge, and its bounding box.
  struct Lane {
    std::vector<Eigen::Vector2d> polygon_m;
    Eigen::Vector2d least_m;
    Eigen::Vector2d most_m;
  };
  // The deviation of a state from the goal: the number of unmet conditions, and a text.
  struct Miss {
    std::size_t conditions = 0;
    double outside_m = 0.0;
    double time_s = 0.0;
    std::string words;
  };

  [[nodiscard]] bool is_on_road(const Eigen::Vector2d& point_m) const;
  [[nodiscard]] double outside_m(const GoalState& goal, const Eigen::Vector2d& point_m) const;
  [[nodiscard]] Miss miss_of(const GoalState& goal, const EgoState& ego) const;

  const Scenario& scenario_;
  const PlanningProblem& problem_;
  std::vector<Lane> lanes_;

  std::vector<Contact> contacts_;
  std::set<std::int64_t> touched_;
  std::optional<Gap> smallest_gap_;
  double off_road_s_ = 0.0;
  std::optional<double> off_road_since_s_;
  Extremes extremes_;
  std::optional<std::int64_t> goal_step_;
  std::optional<Miss> nearest_miss_;
};

}  // namespace ads
