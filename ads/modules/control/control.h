#pragma once

#include <cstdint>
#include <optional>

#include <fastcycle/fastcycle.h>

#include "control/command.pb.h"
#include "control/controller_state.pb.h"
#include "localization/ego.pb.h"
#include "planning/plan.pb.h"
#include "supervision/state.pb.h"
#include "tracker.h"
#include "vehicle/state.pb.h"

namespace ads {

/// Makes the vehicle follow the plan; see `Tracker`.
///
/// In:   the newest of `planning/checked_plan`, `localization/ego`, `vehicle/state`,
///       `supervision/state`
/// Out:  `control/command`, with each tick of the Serve Timer, from the first plan and pose on
class Control final : public fastcycle::Component {
 public:
  explicit Control(fastcycle::Context& context);
  void serve() override;
  void stop() override;

 private:
  [[nodiscard]] double seconds(std::int64_t ns) const;
  void locate();
  [[nodiscard]] std::optional<Motion> motion() const;
  void take_plan(const Motion& motion, double now_s);
  [[nodiscard]] bool is_better_stop(const Motion& motion, double now_s) const;
  [[nodiscard]] Actuation act(supervision::DrivingState state, const Motion& motion,
                              double motion_s, double now_s);
  [[nodiscard]] bool is_supervision_silent() const;
  void publish(const Actuation& actuation, bool is_autonomous, bool is_alone = false);
  void save(control::ControllerState& state) const;
  void load(const control::ControllerState& state);

  fastcycle::Param<double> plan_age_s_;
  fastcycle::Param<double> stale_braking_mps2_;
  fastcycle::Param<double> supervision_age_s_;
  Tracker tracker_;
  fastcycle::Latest<planning::Plan> plans_;
  fastcycle::Latest<localization::Ego> egos_;
  fastcycle::Latest<vehicle::State> vehicle_states_;
  fastcycle::Latest<supervision::State> states_;
  fastcycle::Publisher<control::Command> commands_;
  fastcycle::State<control::ControllerState> state_;

  std::optional<std::int64_t> first_ns_;  // The begin of the controller's clock.
  std::uint64_t plan_sequence_ = 0;       // Of the last plan taken.
  double plan_s_ = 0.0;                   // When it was taken.
  // The newest estimate of localization; once none comes any more, where speed and steering have
  // led the vehicle since.
  std::optional<Motion> place_;
  std::int64_t place_ns_ = 0;
  std::int64_t ego_ns_ = 0;  // Of the newest estimate.
  Path nominal_;
  Path minimal_risk_;
  std::optional<Path> stop_;  // The path of a minimal-risk stop, during one.
  double lateral_error_max_m_ = 0.0;
  double along_error_max_m_ = 0.0;
  std::int64_t commands_stale_ = 0;
};

}  // namespace ads
