#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/commonroad.h"
#include "common/plane.h"

namespace ads {

/// A standing or moving object in the world other than the ego vehicle.
struct Body {
  std::int64_t id = 0;
  Box box;
  double height_m = 0.0;
  double speed_mps = 0.0;
  double yaw_rate_radps = 0.0;
};

/// The recorded motion of one obstacle, interpolated linearly in time between its states, headings
/// along the shorter arc.
///
/// @threads  Compatible.
class Recording {
 public:
  struct Pose {
    Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
    double heading_rad = 0.0;
    double speed_mps = 0.0;
    double yaw_rate_radps = 0.0;
  };

  /// Before `start_s` an obstacle present at that time approaches from behind at constant speed.
  Recording(const Obstacle& obstacle, double step_s, double start_s);

  /// Whether the obstacle is present: from its first to its last state, but for a jump, where steps
  /// are missing and the places before and after are farther apart than its speed allows; a static
  /// one always.
  [[nodiscard]] bool is_present(double time_s) const;
  /// @pre  `is_present(time_s)`
  [[nodiscard]] Pose at(double time_s) const;

  /// Its distance along its way at `time_s`, from its first state.
  [[nodiscard]] double progress_m(double time_s) const;
  /// The pose at distance `progress_m`; beyond its end the way is extended straight. Speed and yaw
  /// rate are those recorded there.
  [[nodiscard]] Pose at_progress(double progress_m) const;
  /// Its way; none if it is stationary.
  [[nodiscard]] const std::optional<Polyline>& way() const { return way_; }
  [[nodiscard]] double speed_max_mps() const { return speed_max_mps_; }

 private:
  // Between the states `index` and `index + 1`.
  [[nodiscard]] Pose between(std::size_t index, double share) const;
  [[nodiscard]] std::size_t index_at(const std::vector<double>& values, double value) const;

  bool is_static_;
  bool is_there_before_;
  std::vector<ScenarioState> states_;
  std::vector<double> times_s_;
  std::vector<bool> jumps_;  // Whether it jumps from a state to the next one.
  std::vector<double> progress_m_;
  std::optional<Polyline> way_;
  double speed_max_mps_ = 0.0;
};

enum class TrafficMode : std::uint8_t { kReplay, kReactive };

/// All obstacles of a scenario, as recorded; times are those of the scenario.
///
/// In the mode `kReactive` a recorded car that would hit the ego vehicle from behind follows it
/// instead, and cars behind that one follow in turn: on their recorded way, by the Intelligent
/// Driver Model (M. Treiber, A. Hennecke, D. Helbing, "Congested traffic states in empirical
/// observations and microscopic simulations", Physical Review E 62, 2000). Such a car follows the
/// model from then on, and disappears when its recording ends.
///
/// @threads  Confined to its component.
class Traffic {
 public:
  Traffic(const Scenario& scenario, double start_s, TrafficMode mode);

  /// Advances all obstacles to `time_s`, later than before; `ego` and its speed are those at the
  /// previous time.
  void move_to(double time_s, const Box& ego, double ego_speed_mps);

  /// Those present, in the order of the scenario.
  [[nodiscard]] std::span<const Body> bodies() const { return bodies_; }
  /// The number of cars that no longer follow their recording.
  [[nodiscard]] std::size_t reacting() const;
  /// When the last recording ends; static obstacles are ignored.
  [[nodiscard]] double end_s() const { return end_s_; }

 private:
  // The position on its way of a car that has left its recording.
  struct Following {
    double progress_m = 0.0;
    double speed_mps = 0.0;
  };
  struct Vehicle {
    Body body;  // Its last state.
    bool is_static = false;
    Recording recording;
    std::optional<Following> following = {};
  };
  // The object ahead on the way of a vehicle, and its speed along the way.
  struct Leader {
    double gap_m = 0.0;
    double speed_mps = 0.0;
  };

  void follow(Vehicle& vehicle, double seconds, const Box& ego, double ego_speed_mps) const;
  void react(Vehicle& vehicle, double time_s, const Box& ego, double ego_speed_mps) const;
  [[nodiscard]] std::optional<Leader> leader_of(const Vehicle& vehicle, double progress_m,
                                                const Box& ego, double ego_speed_mps) const;

  double start_s_;
  TrafficMode mode_;
  double time_s_;
  double end_s_;
  std::vector<Vehicle> vehicles_;
  std::vector<Body> bodies_;
};

}  // namespace ads
