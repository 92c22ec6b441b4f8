#pragma once

#include <deque>

#include "ego_model.h"

namespace ads {

/// Simulates the ego vehicle's actuators, driven by the commands on its bus.
///
/// A command takes effect `delay_s` after its arrival, and is obeyed while its flag is set.
/// Otherwise a driver drives, who holds the speed and straightens the wheels. If commands stop
/// arriving while they are obeyed, the vehicle brakes by itself with the wheels unchanged, until
/// the next one arrives.
///
/// @threads  Confined to its component.
class Actuators {
 public:
  struct Options {
    double delay_s = 0.1;
    double timeout_s = 0.5;  ///< A command older than this is not obeyed.
    double timeout_braking_mps2 = 4.0;
  };
  struct Command {
    EgoDemand demand;
    bool is_autonomous = false;
  };

  explicit Actuators(const Options& options) : options_(options) {}

  /// A command that arrived at `time_s`, not before the previous one.
  void take(double time_s, const Command& command);

  /// The demand from `time_s` on, which must not be before that of the last call.
  [[nodiscard]] EgoDemand demand_at(double time_s, const EgoState& state);

  /// Whether the last demand was a command's, or the vehicle's own braking for lack of commands.
  [[nodiscard]] bool is_autonomous() const { return current_.is_autonomous; }
  /// Whether obeyed commands have stopped arriving.
  [[nodiscard]] bool is_timed_out() const { return is_timed_out_; }

 private:
  struct Waiting {
    double time_s = 0.0;
    Command command;
  };

  Options options_;
  std::deque<Waiting> waiting_;
  Command current_;
  double current_time_s_ = 0.0;
  bool is_timed_out_ = false;
};

}  // namespace ads
