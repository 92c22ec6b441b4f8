#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "control/command.pb.h"
#include "driving_states.h"
#include "localization/ego.pb.h"
#include "mission/goal.pb.h"
#include "perception/objects.pb.h"
#include "planning/plan.pb.h"
#include "planning/plan_verdict.pb.h"
#include "status/status.pb.h"
#include "supervision/state.pb.h"
#include "supervision/supervisor_state.pb.h"
#include "takeover.h"
#include "vehicle/driver.pb.h"
#include "vehicle/state.pb.h"

namespace ads {

/// Enables autonomous driving when all inputs are available, and ends it safely when one is
/// missing, has failed, or is late.
///
/// In:   `fastcycle/status`, `localization/ego`, `perception/objects`,
///       `planning/checked_plan`, `planning/verdict`, `control/command`, `vehicle/state`,
///       `vehicle/driver`, `mission/goal`
/// Out:  `supervision/state`, with every tick of the Serve Timer, and immediately when the driver
///       takes over
/// Keeps: `supervisor`, its complete state
class Supervision final : public fastcycle::Component {
 public:
  explicit Supervision(fastcycle::Context& context);
  void serve() override;
  void stop() override;

 private:
  /// When a message was last received, and its maximum age.
  struct Input {
    std::string_view what;
    fastcycle::Param<double> limit_s;
    std::optional<fastcycle::Time> taken;
  };

  fastcycle::Param<double> limit(std::string_view name, double fallback_s);
  [[nodiscard]] double seconds(fastcycle::Time time) const;
  [[nodiscard]] Observation observe_now() const;
  void save(supervision::SupervisorState& state) const;
  void load(const supervision::SupervisorState& state);
  void on_status(const fastcycle::status::Status& status);
  void on_ego(const localization::Ego& ego);
  void on_objects(const perception::Objects& objects);
  void on_plan(const planning::Plan& plan);
  void on_driver(const vehicle::DriverInput& input);
  void on_verdict(const planning::PlanVerdict& verdict);
  void on_goal(const mission::Goal& goal);
  void note_gap(const perception::Objects& objects);
  void publish();
  void report_change(DrivingState before);
  void count_time(DrivingState before);

  fastcycle::Param<std::vector<std::string>> essential_;
  fastcycle::Param<double> ego_length_m_;
  fastcycle::Param<double> ego_width_m_;
  fastcycle::Param<double> invalid_sweeps_s_;
  fastcycle::Param<double> no_plan_s_;
  fastcycle::Param<int> rejected_plans_max_;
  fastcycle::Publisher<supervision::State> states_;
  fastcycle::State<supervision::SupervisorState> state_;

  Input ego_input_;
  Input objects_input_;
  Input plan_input_;
  Input command_input_;
  Input vehicle_input_;
  fastcycle::Param<double> driver_age_s_;  // 0: not monitored.
  std::optional<fastcycle::Time> driver_taken_;

  DrivingStates driving_{{}};
  Takeover takeover_;
  std::optional<fastcycle::Time> taken_over_;
  std::int64_t takeovers_ = 0;
  localization::Ego ego_;
  std::optional<fastcycle::Time> engage_at_;
  std::optional<fastcycle::Time> sweeps_invalid_since_;
  std::optional<fastcycle::Time> plan_missing_since_;
  std::string sweep_reason_;
  std::string plan_reason_;
  std::uint32_t rejected_in_a_row_ = 0;
  std::string rejection_;
  planning::PlanKind plan_kind_ = planning::NOMINAL;
  std::vector<std::string> failures_;
  std::string breach_;
  std::map<std::string, std::uint64_t, std::less<>> breaches_;
  std::map<DrivingState, double> seconds_in_;
  std::optional<fastcycle::Time> last_look_;
  double smallest_gap_m_ = std::numeric_limits<double>::infinity();
};

}  // namespace ads
