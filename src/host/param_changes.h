#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/priority_mutex.h"
#include "config/problem.h"
#include "fastcycle/param_list.h"
#include "fastcycle/params.h"
#include "params/param_info.h"
#include "params/param_table.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class ApplicationHost;
struct Notice;

/// Changes parameters of an application's components while they run: owns the order of the changes.
///
/// A transaction is checked and committed atomically, under a lock, and passed to the components
/// concerned in the order of the commits. Each applies it in an activation of its own.
///
/// In an application of several processes, each checks a transaction for its components, and
/// commits it when all have accepted it; transactions are processed one after the other.
///
/// @threads  Safe.
class ParamChanges {
 public:
  explicit ParamChanges(ApplicationHost& application) : application_(application) {}

  /// Makes all `changes`, or none. `asked_by` is the name of a component; empty: from outside.
  ParamsResult make(const std::vector<ParamChange>& changes, std::string_view asked_by);

  /// As `make`, in an activation of `component`; `done` is called in another one. In simulated time
  /// the change is made at the end of the present round.
  void make_later(detail::ComponentCore& component, std::vector<ParamChange> changes,
                  std::function<void(const ParamsResult&)> done);

  /// Descriptions of the params of all components, with the values of the last transaction.
  [[nodiscard]] std::vector<ParamInfo> list() const;
  /// Those of a component in another process, if received. @pre The mutex is held.
  [[nodiscard]] std::vector<RemoteParam> list_elsewhere(std::uint32_t component) const;

  // For several processes; called as documented in `Peers`.
  /// Before the start: sends the params of this process to the others.
  void send_all();
  void take(const Notice& notice);
  /// In simulated time: no further answers will be received.
  void all_have_answered();
  [[nodiscard]] std::string make_snapshot() const;
  void take_snapshot(const std::string& text);

  /// In a replay: `component` applies the recorded values when the control cause for them is
  /// served.
  ///
  /// @errors  Values that do not fit go to `problems`, and are left out.
  void take_recorded(detail::ComponentCore& component, std::uint64_t transaction,
                     const std::string& text, config::Problems& problems);
  /// The same, without that activation: the component's next object begins with it. `text` is the
  /// result of `ParamTable::begun_with`.
  void commit_recorded(detail::ComponentCore& component, const std::string& text,
                       config::Problems& problems);

  /// Rejects further changes. Does not wait for running ones.
  void end() { is_ended_ = true; }

  /// The changes, for the log of the run: by key, "params.1" and so on.
  [[nodiscard]] std::map<std::string, std::string> facts() const;

  [[nodiscard]] ParamMutex& mutex() const { return mutex_; }

 private:
  /// The part of a transaction for one component.
  struct Planned {
    detail::ComponentCore* component = nullptr;
    ParamValues values = {};
    std::vector<std::string> names = {};  ///< Of the values, as given in the change.
    std::vector<bool> is_own = {};        ///< Whether each value is not of a shared one.
    bool is_wrong = false;
  };
  /// By the component's index in the application file.
  using Plan = std::map<std::uint32_t, Planned>;

  /// A changed value, for the log of the run.
  struct Noted {
    std::uint32_t component = 0;
    std::string name;
    std::string text;  ///< "limiter.limit_mps: 10 → 20"
    std::string json;  ///< The new value.
  };
  /// A transaction that was sent to all processes.
  struct Asked {
    std::uint32_t process = 0;
    std::uint64_t number = 0;  ///< Its number within this process.
    std::string by;
    std::vector<ParamChange> changes;
  };
  /// The answers received so far.
  struct Verdict {
    std::set<std::uint32_t> awaited;                 ///< Processes that have not answered.
    std::multimap<std::size_t, std::string> errors;  ///< By the index of the change.
    std::set<std::size_t> found;                     ///< The changes with a match in some process.
    std::multimap<std::uint32_t, Noted> noted;       ///< By component.
  };
  using Done = std::function<void(const ParamsResult&)>;
  /// One that was requested here, and is applied in some processes, but not in all.
  struct Settling {
    std::uint64_t number = 0;
    Done done;
    std::set<std::uint32_t> awaited;
  };

  [[nodiscard]] bool speaks_for_all() const;
  bool plan_change(const ParamChange& change, Plan& plan, config::Problems& problems) const;
  bool plan_shared(const ParamChange& change, std::string_view name, Plan& plan,
                   config::Problems& problems) const;
  static void plan_value(const ParamChange& change, bool is_own, detail::ComponentCore& component,
                         const DeclaredParam& param, Plan& plan, config::Problems& problems);
  static void check_together(Plan& plan, config::Problems& problems);
  void commit(const Plan& plan);
  [[nodiscard]] static std::string text_of(const Planned& planned);
  [[nodiscard]] static std::vector<Noted> noted_of(const Plan& plan);
  void note(const std::vector<Noted>& noted, std::string_view asked_by);

  /// Returns its number.
  std::uint64_t ask_all(std::uint32_t component, std::string_view by,
                        const std::vector<ParamChange>& changes, Done done);
  [[nodiscard]] ParamsResult ask_all_and_wait(const std::vector<ParamChange>& changes);
  void drop(std::uint32_t process, std::uint64_t number);
  [[nodiscard]] std::string names_of_awaited() const;
  [[nodiscard]] bool is_of(const Notice& notice) const;
  void check_next();
  void take_verdict(const Notice& notice);
  void decide();
  void answer(std::uint64_t number, const ParamsResult& result);
  void settle(std::uint32_t process, std::optional<std::uint64_t> number);

  ApplicationHost& application_;
  mutable ParamMutex mutex_;
  std::uint64_t transactions_ = 0;
  std::atomic<bool> is_ended_{false};
  mutable base::PriorityMutex facts_mutex_;
  std::map<std::string, std::string> facts_;

  // Several processes; used by the thread that handles notices.
  std::deque<Asked> asked_;  ///< The first one is being checked.
  Plan plan_;                ///< Of it, for the components here.
  Verdict verdict_;
  std::vector<Settling> settling_;
  // Under the mutex.
  std::map<std::uint32_t, std::vector<RemoteParam>> elsewhere_;  ///< By component.
  std::map<std::string, std::string> changed_;  ///< JSON by name, of all processes.
  // Callbacks for the requests of this process, by number.
  std::mutex waiting_mutex_;
  std::uint64_t numbers_ = 0;
  std::map<std::uint64_t, Done> waiting_;
};

}  // namespace fastcycle::host
