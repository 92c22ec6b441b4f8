#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "connectivity/hazard.pb.h"
#include "hd_map/map.pb.h"
#include "localization/ego.pb.h"
#include "mission/goal.pb.h"
#include "planner.h"
#include "planning/plan.pb.h"
#include "planning/planner_state.pb.h"
#include "prediction/prediction.pb.h"
#include "vehicle/state.pb.h"

namespace motion_planning {

/// Plans the vehicle's motion; see `Planner`.
///
/// In:   `prediction/objects`; the newest of `localization/ego`, `vehicle/state`, `map/route`,
///       `map/tile`, `mission/goal`
/// Out:  `planning/plan`, for each prediction once a pose and a route are known
class MotionPlanning final : public fastcycle::Component {
 public:
  explicit MotionPlanning(fastcycle::Context& context);
  void stop() override;

 private:
  void on_predictions(const prediction::Predictions& predictions);
  void update_road();
  /// On the planner's clock, which starts at the first prediction, so that its numbers are small.
  [[nodiscard]] double seconds(std::int64_t ns) const;
  [[nodiscard]] State ego_now() const;
  [[nodiscard]] std::optional<Goal> goal() const;
  [[nodiscard]] Situation situation_of(const prediction::Predictions& predictions) const;
  void publish(const prediction::Predictions& predictions, const Plan& plan);
  void save(planning::PlannerState& state) const;
  void load(const planning::PlannerState& state);

  Vehicle vehicle_;
  Planner planner_;
  fastcycle::Latest<localization::Ego> egos_;
  fastcycle::Latest<vehicle::State> vehicle_states_;
  fastcycle::Latest<hd_map::Route> routes_;
  fastcycle::Latest<hd_map::Tile> tiles_;
  fastcycle::Latest<mission::Goal> goals_;
  fastcycle::Publisher<planning::Plan> plans_;
  fastcycle::State<planning::PlannerState> state_;

  std::optional<std::int64_t> first_ns_;
  // Of the messages that the road was built from. A new component rebuilds it from them, because
  // the views still hold them.
  std::uint64_t route_sequence_ = 0;
  std::uint64_t tile_sequence_ = 0;
  Road road_;
  std::vector<Road> lanes_;
  std::vector<WaitingLine> waiting_lines_;
  std::optional<double> map_end_m_;
  std::int64_t plans_made_ = 0;
  std::int64_t plans_evasive_ = 0;
  std::int64_t plans_to_goal_ = 0;
};

}  // namespace motion_planning
