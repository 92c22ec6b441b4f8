#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "supervision/state.pb.h"
#include "supervision/supervisor_state.pb.h"

namespace ads {

/// Whether the vehicle drives by itself; as in `supervision.DrivingState`.
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

/// Whether the vehicle moves, or keeps itself standing, on its own.
bool is_autonomous(DrivingState state);

/// Something that has to come again and again.
struct Watched {
  std::string_view what;  ///< In words: "the ego pose".
  double age_s = 0.0;     ///< Of its newest; infinite if there was none.
  double limit_s = 0.0;   ///< Older is missing.
};

/// What supervision sees at one moment.
struct Observation {
  double time_s = 0.0;                  ///< Of the application's clock.
  std::optional<double> engage_at_s;    ///< None: nobody asked for autonomous driving.
  std::vector<Watched> inputs;          ///< All of what autonomous driving needs.
  std::vector<std::string> failures;    ///< In words: what makes it impossible at once.
  std::vector<std::string> weaknesses;  ///< In words: what asks for care.
  double speed_mps = 0.0;
};

/// The state machine that lets the vehicle drive by itself, and ends that safely.
///
/// Off, until everything is there; engaged when it was asked for; degraded while something is weak;
/// and a stop of minimal risk, which nothing takes back, as soon as something is missing or has
/// failed. The driver may take over at any time: off, until autonomous driving is asked for anew.
///
/// @threads  Confined.
class DrivingStates {
 public:
  struct Limits {
    double recovery_s = 1.0;    ///< So long nothing may be weak before it is engaged again.
    double standing_mps = 0.1;  ///< Slower counts as standing,
    double standing_s = 0.5;    ///< after so long.
  };

  explicit DrivingStates(const Limits& limits) : limits_(limits) {}

  /// Looks at `observation`; true if the state has changed.
  bool look_at(const Observation& observation);

  /// The driver drives, from `time_s` on; true if the vehicle drove by itself before. It stays off
  /// until `ask_again`.
  bool take_over(supervision::TakeoverCause cause, std::string reason, double time_s);
  /// Autonomous driving is asked for anew.
  void ask_again() { takeover_ = supervision::TAKEOVER_NONE; }

  [[nodiscard]] DrivingState state() const { return state_; }
  /// By what the driver took over; none if that was not so, or autonomous driving was asked for
  /// since.
  [[nodiscard]] supervision::TakeoverCause takeover() const { return takeover_; }
  /// Why it is not engaged, or only with care; empty otherwise.
  [[nodiscard]] const std::string& reason() const { return reason_; }
  [[nodiscard]] double since_s() const { return since_s_; }

  /// Writes all that it remembers into `memory`, which is empty.
  void save(supervision::DrivingMemory& memory) const;
  /// Goes on where the one was that saved `memory`.
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
