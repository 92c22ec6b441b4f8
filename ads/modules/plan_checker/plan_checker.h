#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include <fastcycle/fastcycle.h>

#include "hd_map/map.pb.h"
#include "localization/ego.pb.h"
#include "planning/plan.pb.h"
#include "planning/plan_verdict.pb.h"
#include "prediction/prediction.pb.h"
#include "rules.h"

namespace plan_checker {

/// An independent check of each plan; see `Rules`. Only plans that pass are forwarded to control.
///
/// In:    `planning/plan`; the newest of `prediction/objects`, `localization/ego`, `map/tile`
/// Out:   `planning/verdict` for each plan; `planning/checked_plan`, the accepted plans, forwarded
///         without a copy
/// Keeps: `plan_checker`, the last accepted plan, and the counters
class PlanChecker final : public fastcycle::Component {
 public:
  explicit PlanChecker(fastcycle::Context& context);
  void stop() override;

 private:
  void on_plan(const fastcycle::Sample<planning::Plan>& plan);
  void update_road();
  [[nodiscard]] std::optional<Motion> ego_now() const;
  void count(const planning::PlanVerdict& verdict);
  void save(planning::PlanCheckerState& state) const;
  void load(const planning::PlanCheckerState& state);

  Limits limits_;
  Rules rules_;
  fastcycle::Latest<prediction::Predictions> predictions_;
  fastcycle::Latest<localization::Ego> egos_;
  fastcycle::Latest<hd_map::Tile> tiles_;
  fastcycle::Publisher<planning::Plan> checked_plans_;
  fastcycle::Publisher<planning::PlanVerdict> verdicts_;
  fastcycle::State<planning::PlanCheckerState> state_;

  std::uint64_t tile_sequence_ = 0;
  std::optional<RoadArea> road_;
  planning::Plan accepted_;
  std::uint32_t rejected_in_a_row_ = 0;
  std::int64_t plans_ = 0;
  std::int64_t plans_rejected_ = 0;
  std::int64_t plans_noted_ = 0;
  // Violations of each rule in this run: "collision rejected", "jerk noted".
  std::map<std::string, std::int64_t> breaches_;
};

}  // namespace plan_checker
