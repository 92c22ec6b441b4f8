#pragma once

#include <deque>

#include "ego_model.h"

namespace ads {

/// What the ego vehicle's actuators make of the commands that come over its bus.
///
/// A command takes effect `delay_s` after it came, and is obeyed while its flag says so. Otherwise
/// a driver drives, who holds the speed and straightens the wheels. If commands cease to come while
/// they are obeyed, the vehicle brakes by itself with the wheels as they are, until another one
/// comes.
///
/// @threads  Confined to its component.
class Actuators {
 public:
  struct Options {
    double delay_s = 0.1;
    double timeout_s = 0.5;  ///< The newest command is not obeyed when it is older.
    double timeout_braking_mps2 = 4.0;
  };
  struct Command {
    EgoDemand demand;
    bool is_autonomous = false;
  };

  explicit Actuators(const Options& options) : options_(options) {}

  /// A command that came at `time_s`, not before the one that came last.
  void take(double time_s, const Command& command);

  /// What is to be done from `time_s` on, which must not be before that of the last call.
  [[nodiscard]] EgoDemand demand_at(double time_s, const EgoState& state);

  /// Whether the last demand was the commands', or the vehicle's own braking for the lack of them.
  [[nodiscard]] bool is_autonomous() const { return current_.is_autonomous; }
  /// Whether commands that were obeyed have ceased to come.
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
