#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "supervision/state.pb.h"
#include "supervision/supervisor_state.pb.h"

namespace ads {

/// The state of autonomous driving; as in `supervision.DrivingState`.
enum class DrivingState : std::uint8_t {
  kOff,
  kAvailable,
  kEngaged,
  kEngagedDegraded,
  kMinimalRiskStop,
  kStopped,
};

std::string_view to_string(DrivingState state);
supervision::DrivingState message_of(DrivingState state);
DrivingState driving_state_of(supervision::DrivingState state);

/// Whether the vehicle is moved, or kept at rest, by the system.
bool is_autonomous(DrivingState state);

/// A periodic input.
struct Watched {
  std::string_view what;  ///< For display: "the ego pose".
  double age_s = 0.0;     ///< Of the newest one; infinite if there was none.
  double limit_s = 0.0;   ///< If older, it counts as missing.
};

/// The inputs of the state machine at one moment.
struct Observation {
  double time_s = 0.0;                  ///< Of the application's clock.
  std::optional<double> engage_at_s;    ///< None: autonomous driving was not requested.
  std::vector<Watched> inputs;          ///< All inputs that autonomous driving needs.
  std::vector<std::string> failures;    ///< As text: reasons to end autonomous driving immediately.
  std::vector<std::string> weaknesses;  ///< As text: reasons to continue with degraded performance.
  double speed_mps = 0.0;
};

/// The state machine that enables autonomous driving, and ends it safely.
///
/// Off until all inputs are available; engaged on request; degraded while there is a weakness; and
/// a minimal-risk stop, which is final, as soon as an input is missing or something has failed. The
/// driver may take over at any time: then it is off until autonomous driving is requested again.
///
/// @threads  Confined.
class DrivingStates {
 public:
  struct Limits {
    double recovery_s = 1.0;    ///< The time without weaknesses before it is engaged again.
    double standing_mps = 0.1;  ///< Below this speed the vehicle counts as stopped,
    double standing_s = 0.5;    ///< after this time.
  };

  explicit DrivingStates(const Limits& limits) : limits_(limits) {}

  /// Processes `observation`; returns whether the state has changed.
  bool look_at(const Observation& observation);

  /// The driver takes over at `time_s`; returns whether the vehicle drove autonomously before. The
  /// state stays off until `ask_again`.
  bool take_over(supervision::TakeoverCause cause, std::string reason, double time_s);
  /// Autonomous driving is requested again.
  void ask_again() { takeover_ = supervision::TAKEOVER_NONE; }

  [[nodiscard]] DrivingState state() const { return state_; }
  /// The cause of the last takeover; none if there was none, or if autonomous driving was requested
  /// since.
  [[nodiscard]] supervision::TakeoverCause takeover() const { return takeover_; }
  /// Why it is not engaged, or degraded; empty otherwise.
  [[nodiscard]] const std::string& reason() const { return reason_; }
  [[nodiscard]] double since_s() const { return since_s_; }

  /// Saves the complete state into `memory`, which must be empty.
  void save(supervision::DrivingMemory& memory) const;
  /// Restores a saved state.
  void load(const supervision::DrivingMemory& memory);

 private:
  [[nodiscard]] static std::string find_missing(const Observation& observation);
  bool go_to(DrivingState state, std::string reason, double time_s);
  bool look_while_off(const Observation& observation, const std::string& missing);
  bool look_while_engaged(const Observation& observation, const std::string& missing);

  Limits limits_;
  DrivingState state_ = DrivingState::kOff;
  std::string reason_ = "nothing has been seen yet";
  double since_s_ = 0.0;
  supervision::TakeoverCause takeover_ = supervision::TAKEOVER_NONE;
  double weak_until_s_ = 0.0;
  std::optional<double> standing_since_s_;
};

}  // namespace ads
