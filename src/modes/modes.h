#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/priority_mutex.h"
#include "config/description.h"
#include "config/problem.h"
#include "fastcycle/time.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class ApplicationHost;
struct Notice;

/// One switch of the application from a mode to another.
struct ModeSwitch {
  Time stamp{};  ///< Nothing that leaving components publish later than this reaches anybody.
  std::string from;
  std::string to;
  std::string why;
  std::string by;  ///< The component that asked for it; empty: somebody outside.
};

/// What a log says of `switches` when the run has ended, and what a later run reads there. Only the
/// first 1000.
void explain(const std::vector<ModeSwitch>& switches, std::map<std::string, std::string>& facts);
[[nodiscard]] std::vector<ModeSwitch> switches_in(const std::map<std::string, std::string>& facts);

/// The modes of an application: owns which of its components are active in which, and the switches
/// from one to another.
///
/// Live, a switch goes step by step, and no thread waits for it: components that leave are
/// deactivated, each by its own worker; the last of them sets the stamp; then those that join are
/// activated. So there is no moment at which one that leaves and one that joins are both active. In
/// simulated time both belong to one round, the next one; those that leave are served first.
///
/// Where the application has several processes, each has modes, and all take the same steps: what
/// is asked for anywhere is told to all, and so is what each has done. Live, the main process sets
/// the stamp.
///
/// @threads  `ask`, `current`, `switches`, `refused` are Safe; `resolve`, `begin`, `end` are
///           confined to the control thread.
class Modes {
 public:
  explicit Modes(ApplicationHost& application);
  Modes(const Modes&) = delete;
  Modes& operator=(const Modes&) = delete;

  /// Finds who is active in which mode; before any component is constructed. Names and patterns
  /// that mean nothing are mistakes.
  void resolve(config::Problems& problems);

  [[nodiscard]] bool is_empty() const noexcept { return modes_.empty(); }
  /// Whether `component` is active in the mode that its process begins with.
  [[nodiscard]] bool is_active_at_first(std::uint32_t component) const;
  /// Whether some mode names `component`.
  [[nodiscard]] bool is_switched(std::uint32_t component) const;

  /// All components have started: from now on switches are made.
  void begin();
  /// No further switch begins; live, waits up to a second for the one that is under way.
  void end();

  /// Asks for `mode`. `by` is the component that asks, in one of its activations; null: somebody
  /// outside.
  ///
  /// @errors  std::invalid_argument if there is no such mode.
  void ask(std::string_view mode, std::string_view why, detail::ComponentCore* by);
  /// As `ask`, by the worker that serves `by`, also where that is in no activation.
  void ask_in_turn(std::string_view mode, std::string_view why, detail::ComponentCore& by);
  /// Whether all that was asked for leads to `mode`. No lock.
  [[nodiscard]] bool is_asked(std::string_view mode) const noexcept;

  /// The mode as of the last stamp; empty if there are none.
  [[nodiscard]] std::string current() const;
  [[nodiscard]] std::vector<ModeSwitch> switches() const;
  /// How many switches were asked for while 64 others waited.
  [[nodiscard]] std::uint64_t refused() const;
  /// Whether one is under way, or waits.
  [[nodiscard]] bool is_switching() const;

  // Where the application has several processes; called as `Peers` says.
  void take(const Notice& notice);
  /// Whether components here have a step to do, of the switch that is under way.
  [[nodiscard]] bool is_busy() const noexcept { return awaited_.load() != 0; }
  void round_is_over(bool is_anyone_busy);
  [[nodiscard]] std::string make_snapshot() const;
  /// Before the start, or instead of what was told and is lost.
  void take_snapshot(const std::string& text);

 private:
  struct Request {
    std::size_t to = 0;
    std::string why;
    std::string by;
  };
  struct Mode {
    std::string name;
    std::vector<bool> is_active;  ///< By component.
  };

  [[nodiscard]] std::size_t find(std::string_view mode) const;
  [[nodiscard]] Request request(std::string_view mode, std::string_view why,
                                const detail::ComponentCore* by) const;
  /// Asks for it here, or in all processes.
  void put(Request request);
  void put_in_order(Request request);
  void begin_in_order();
  [[nodiscard]] static nlohmann::json to_json(const Request& request);
  [[nodiscard]] std::optional<Request> request_from(const nlohmann::json& json) const;
  void begin_next();
  void switch_at_once();
  void enter(Time stamp);
  void arrive();
  void tell_done();
  void go_on_if_all_have_done();
  void set_mode(Time stamp);
  [[nodiscard]] bool leaves(std::uint32_t component) const;
  [[nodiscard]] bool joins(std::uint32_t component) const;
  [[nodiscard]] bool is_anyone_concerned() const;

  ApplicationHost& application_;
  std::vector<Mode> modes_;
  std::vector<bool> is_switched_;  ///< By component: some mode names it.

  mutable base::PriorityMutex mutex_;
  std::deque<Request> waiting_;
  std::vector<ModeSwitch> switches_;
  std::size_t current_ = 0;
  /// Where the last of those that were asked for leads to. Written under the mutex.
  std::atomic<std::size_t> last_asked_{0};
  std::uint64_t refused_ = 0;
  bool has_begun_ = false;
  bool is_over_ = false;
  bool is_switching_ = false;

  // Of the switch that is under way: of whoever does its next step.
  enum class Step : std::uint8_t { kLeaving, kJoining };
  Request request_;
  std::size_t from_ = 0;
  Step step_ = Step::kLeaving;
  std::atomic<std::size_t> awaited_{0};
  /// The processes that have not told that their components have done the step. Of the thread that
  /// takes notices.
  std::set<std::uint32_t> awaited_processes_;
  bool is_entering_ = false;  ///< In the main process: it has told that all enter the mode.
};

}  // namespace fastcycle::host
