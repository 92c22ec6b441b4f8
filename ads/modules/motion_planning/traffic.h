#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "motion_planning_tuning.h"
#include "road.h"
#include "vehicle.h"

namespace motion_planning {

/// The predicted state of an object, and its standard deviations along and across.
struct PredictedState {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;
  double speed_mps = 0.0;
  double along_stddev_m = 0.0;
  double across_stddev_m = 0.0;
};

/// One hypothetical way of an object: states at equal time intervals, the first at `first_s` since
/// the plan's start (usually before it).
struct PredictedWay {
  double probability = 1.0;
  double first_s = 0.0;
  double step_s = 0.1;
  std::vector<PredictedState> states = {};
};

struct TrafficObject {
  std::uint64_t id = 0;
  double length_m = 0.0;
  double width_m = 0.0;
  bool goes_first = false;  ///< It has right of way: more space is left before it.
  std::vector<PredictedWay> ways = {};
};

/// A box at one time, and the space to keep free around it.
struct Occupant {
  struct Space {
    double along_m = 0.0;   ///< Before and behind it.
    double beside_m = 0.0;  ///< To its left and right.
    double weight = 0.0;
  };

  std::size_t object = 0;
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;
  double cosine = 1.0;
  double sine = 0.0;
  double half_length_m = 0.0;
  double half_width_m = 0.0;
  double speed_mps = 0.0;
  double probability = 1.0;
  /// From the widest, which is preferably kept free, to the narrowest, which must not be entered.
  std::array<Space, 3> spaces = {};
};

inline constexpr double kStep_s = kTraffic.step_s;  ///< Between two planning times.

/// All predicted objects at the planning times: every `kStep_s` from the start.
///
/// @threads  Compatible.
class Traffic {
 public:
  Traffic() = default;
  /// `steps` steps follow the start. Beyond the end of a prediction its object drives straight on.
  Traffic(const std::vector<TrafficObject>& objects, std::size_t steps);

  /// @pre  `step <= steps()`
  [[nodiscard]] const std::vector<Occupant>& at(std::size_t step) const { return at_[step]; }
  [[nodiscard]] std::size_t steps() const { return at_.size() - 1; }

 private:
  std::vector<std::vector<Occupant>> at_ = std::vector<std::vector<Occupant>>(1);
};

/// The same objects, with distances kept between those that follow each other along the road.
///
/// A prediction considers each object alone, so that a faster one would drive through the one
/// before it. Here the one behind brakes as a driver would (the braking part of Treiber, Hennecke,
/// Helbing, "Congested traffic states in empirical observations and microscopic simulations", Phys.
/// Rev. E 62, 2000). An object behind the vehicle leaves space for it behind the one ahead of it;
/// to the vehicle itself, which drives along `ego` (a state for each step of `Traffic`), it reacts
/// late.
std::vector<TrafficObject> in_queues(const std::vector<TrafficObject>& objects, const Road& road,
                                     const Vehicle& vehicle, const std::vector<State>& ego,
                                     double horizon_s);

/// The state of an object on its way at `time_s`; extrapolated straight beyond the ends.
PredictedState state_at(const PredictedWay& way, double time_s);

}  // namespace motion_planning
