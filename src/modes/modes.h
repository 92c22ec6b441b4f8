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

/// A switch of the application from one mode to another.
struct ModeSwitch {
  Time stamp{};  ///< What leaving components publish later than this is not delivered.
  std::string from;
  std::string to;
  std::string why;
  std::string by;  ///< The requesting component; empty: external.
};

/// Adds `switches` to the facts of a log at the end of a run, for later runs to read. Only the
/// first 1000.
void explain(const std::vector<ModeSwitch>& switches, std::map<std::string, std::string>& facts);
[[nodiscard]] std::vector<ModeSwitch> switches_in(const std::map<std::string, std::string>& facts);

/// The modes of an application: which components are active in which mode, and the switches between
/// modes.
///
/// Live, a switch proceeds in steps, and no thread waits for it: components that leave are
/// deactivated, each by its own worker; the last of them sets the stamp; then those that join are
/// activated. So there is no moment at which one that leaves and one that joins are both active. In
/// simulated time both belong to the next round; those that leave are served first.
///
/// In an application of several processes each has modes, and all take the same steps: every
/// request and every completed step is sent to all. Live, the main process sets the stamp.
///
/// @threads  `ask`, `current`, `switches`, `refused` are Safe; `resolve`, `begin`, `end` are
///           confined to the control thread.
class Modes {
 public:
  explicit Modes(ApplicationHost& application);
  Modes(const Modes&) = delete;
  Modes& operator=(const Modes&) = delete;

  /// Resolves which components are active in which mode; before any component is constructed. Names
  /// and patterns that match nothing are errors.
  void resolve(config::Problems& problems);

  [[nodiscard]] bool is_empty() const noexcept { return modes_.empty(); }
  /// Whether `component` is active in the initial mode of its process.
  [[nodiscard]] bool is_active_at_first(std::uint32_t component) const;
  /// Whether any mode names `component`.
  [[nodiscard]] bool is_switched(std::uint32_t component) const;

  /// Call when all components have started: switches are made from now on.
  void begin();
  /// No further switch begins; live, waits up to one second for the one in progress.
  void end();

  /// Requests `mode`. `by` is the requesting component, in one of its activations; null: external.
  ///
  /// @errors  std::invalid_argument if there is no such mode.
  void ask(std::string_view mode, std::string_view why, detail::ComponentCore* by);
  /// As `ask`, by the worker that serves `by`, also outside of an activation.
  void ask_in_turn(std::string_view mode, std::string_view why, detail::ComponentCore& by);
  /// Whether all pending requests lead to `mode`. Lock-free.
  [[nodiscard]] bool is_asked(std::string_view mode) const noexcept;

  /// The mode as of the last stamp; empty if there are none.
  [[nodiscard]] std::string current() const;
  [[nodiscard]] std::vector<ModeSwitch> switches() const;
  /// Number of requests refused because 64 others were waiting.
  [[nodiscard]] std::uint64_t refused() const;
  /// Whether a switch is in progress or waiting.
  [[nodiscard]] bool is_switching() const;

  // For applications of several processes; called as `Peers` specifies.
  void take(const Notice& notice);
  /// Whether components here have a step to do, of the switch in progress.
  [[nodiscard]] bool is_busy() const noexcept { return awaited_.load() != 0; }
  void round_is_over(bool is_anyone_busy);
  [[nodiscard]] std::string make_snapshot() const;
  /// Before the start, or to replace notices that were lost.
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
  /// Requests it here, or in all processes.
  void put(Request request);
  void put_in_order(Request request);
  void begin_in_order();
  [[nodiscard]] static nlohmann::json to_json(const Request& request);
  [[nodiscard]] std::optional<Request> request_from(const nlohmann::json& json) const;
  void begin_next();
  void switch_at_once();
  void enter(Time stamp);
  void arrive();
  void report_done();
  void go_on_if_all_have_done();
  void set_mode(Time stamp);
  [[nodiscard]] bool leaves(std::uint32_t component) const;
  [[nodiscard]] bool joins(std::uint32_t component) const;
  [[nodiscard]] bool is_anyone_concerned() const;

  ApplicationHost& application_;
  std::vector<Mode> modes_;
  std::vector<bool> is_switched_;  ///< By component: a mode names it.

  mutable base::PriorityMutex mutex_;
  std::deque<Request> waiting_;
  std::vector<ModeSwitch> switches_;
  std::size_t current_ = 0;
  /// Target of the last request. Written under the mutex.
  std::atomic<std::size_t> last_asked_{0};
  std::uint64_t refused_ = 0;
  bool has_begun_ = false;
  bool is_over_ = false;
  bool is_switching_ = false;

  // State of the switch in progress: of the thread that does its next step.
  enum class Step : std::uint8_t { kLeaving, kJoining };
  Request request_;
  std::size_t from_ = 0;
  Step step_ = Step::kLeaving;
  std::atomic<std::size_t> awaited_{0};
  /// The processes that have not reported their components' step as done. Of the thread that takes
  /// notices.
  std::set<std::uint32_t> awaited_processes_;
  bool is_entering_ = false;  ///< In the main process: it has notified all to enter the mode.
};

}  // namespace fastcycle::host
