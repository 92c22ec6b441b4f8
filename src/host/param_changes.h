#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "base/priority_mutex.h"
#include "config/problem.h"
#include "fastcycle/param_list.h"
#include "fastcycle/params.h"
#include "params/param_table.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class ApplicationHost;

/// Changes parameters of an application's components while they run: owns the order of the changes.
///
/// A transaction is checked and committed as a whole while everybody else waits, and handed to the
/// components that it concerns in the order of the commits. Each puts it in place in an activation
/// of its own.
///
/// @threads  Safe.
class ParamChanges {
 public:
  explicit ParamChanges(ApplicationHost& application) : application_(application) {}

  /// Makes all `changes`, or none. `asked_by` is the name of a component; empty: somebody outside.
  ParamsResult make(const std::vector<ParamChange>& changes, std::string_view asked_by);

  /// As `make`, in an activation of `component`, which asks; `done` is called in another one. In
  /// simulated time the change is made when the present round is over.
  void make_later(detail::ComponentCore& component, std::vector<ParamChange> changes,
                  std::function<void(const ParamsResult&)> done);

  /// What others see of the params of all components: what the last transaction made of them.
  [[nodiscard]] std::vector<ParamInfo> list() const;

  /// Where a recorded run is executed again: `component` puts in place what it did then, when it is
  /// given the control cause for it.
  ///
  /// @errors  Values that do not fit go to `problems`, and are left out.
  void take_recorded(detail::ComponentCore& component, std::uint64_t transaction,
                     const std::string& text, config::Problems& problems);
  /// The same, without that activation: the component's next object begins with it. `text` is what
  /// `ParamTable::begun_with` said.
  void commit_recorded(detail::ComponentCore& component, const std::string& text,
                       config::Problems& problems);

  /// From now on nothing is changed any more, but what is being changed. Waits for nobody.
  void end() { is_ended_ = true; }

  /// What was changed, for the log of the run: by key, "params.1" and so on.
  [[nodiscard]] std::map<std::string, std::string> facts() const;

  [[nodiscard]] ParamMutex& mutex() const { return mutex_; }

 private:
  /// What a transaction means to one component.
  struct Planned {
    detail::ComponentCore* component = nullptr;
    ParamValues values = {};
    std::vector<std::string> names = {};  ///< Of the values, as the change named them.
    std::vector<bool> is_own = {};        ///< Of the values: not that of a shared one.
    bool is_wrong = false;
  };
  /// By the component's place in the application file.
  using Plan = std::map<std::uint32_t, Planned>;

  void plan_change(const ParamChange& change, Plan& plan, config::Problems& problems) const;
  void plan_shared(const ParamChange& change, std::string_view name, Plan& plan,
                   config::Problems& problems) const;
  static void plan_value(const ParamChange& change, bool is_own, detail::ComponentCore& component,
                         const DeclaredParam& param, Plan& plan, config::Problems& problems);
  static void check_together(Plan& plan, config::Problems& problems);
  void commit(const Plan& plan, std::string_view asked_by);
  [[nodiscard]] static std::string text_of(const Planned& planned);
  void note(const Plan& plan, std::string_view asked_by);

  ApplicationHost& application_;
  mutable ParamMutex mutex_;
  std::uint64_t transactions_ = 0;
  std::atomic<bool> is_ended_{false};
  mutable base::PriorityMutex facts_mutex_;
  std::map<std::string, std::string> facts_;
};

}  // namespace fastcycle::host
