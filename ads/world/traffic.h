#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/commonroad.h"
#include "common/plane.h"

namespace ads {

/// Something that stands or moves in the world, beside the ego vehicle.
struct Body {
  std::int64_t id = 0;
  Box box;
  double height_m = 0.0;
  double speed_mps = 0.0;
  double yaw_rate_radps = 0.0;
};

/// The recorded motion of one obstacle: between its states linear in time, headings the shorter way
/// round.
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

  /// Before `start_s` an obstacle that is there at this time comes from behind with constant speed.
  Recording(const Obstacle& obstacle, double step_s, double start_s);

  /// Whether the obstacle is there: from its first state to its last one; one that is static stays.
  [[nodiscard]] bool is_present(double time_s) const;
  /// @pre  `is_present(time_s)`
  [[nodiscard]] Pose at(double time_s) const;

  /// How far it has come at `time_s` on its way, which begins at its first state.
  [[nodiscard]] double progress_m(double time_s) const;
  /// Where it is when it has come `progress_m` far; beyond its end the way goes on straight. Speed
  /// and yaw rate are those that were recorded there.
  [[nodiscard]] Pose at_progress(double progress_m) const;
  /// Its way; none if it stands.
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
  std::vector<double> progress_m_;
  std::optional<Polyline> way_;
  double speed_max_mps_ = 0.0;
};

enum class TrafficMode : std::uint8_t { kReplay, kReactive };

/// All obstacles of a scenario, as they were recorded; times are those of the scenario.
///
/// In the mode `kReactive` a recorded car that would run into the ego vehicle from behind follows
/// it instead, and those behind that car follow in turn: on its recorded way, by the Intelligent
/// Driver Model (M. Treiber, A. Hennecke, D. Helbing, "Congested traffic states in empirical
/// observations and microscopic simulations", Physical Review E 62, 2000). It keeps to the model
/// from then on, and is gone when its recording ends.
///
/// @threads  Confined to its component.
class Traffic {
 public:
  Traffic(const Scenario& scenario, double start_s, TrafficMode mode);

  /// Moves all obstacles on to `time_s`, later than before; `ego` and its speed are those of the
  /// time before.
  void move_to(double time_s, const Box& ego, double ego_speed_mps);

  /// Those that are there, in the order of the scenario.
  [[nodiscard]] std::span<const Body> bodies() const { return bodies_; }
  /// How many do not follow their recording any more.
  [[nodiscard]] std::size_t reacting() const;
  /// When the last recording ends; static obstacles do not count.
  [[nodiscard]] double end_s() const { return end_s_; }

 private:
  // What has left its recording: where it is on its way.
  struct Following {
    double progress_m = 0.0;
    double speed_mps = 0.0;
  };
  struct Vehicle {
    Body body;  // Where it was last.
    bool is_static = false;
    Recording recording;
    std::optional<Following> following = {};
  };
  // What is ahead on the way of a vehicle, and how fast it moves along it.
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
