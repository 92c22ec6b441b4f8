#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/priority_mutex.h"
#include "component/peers.h"
#include "executor/life_step.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class ApplicationHost;

/// Restarts, stops, starts and reloads components on behalf of a tool, in any process.
///
/// @threads  `make` is Safe; `take` as `Peers::on_notice`.
class LifeChanges {
 public:
  /// Receives the result: why it was not done, or empty; and the component's state.
  using Done = std::function<void(const std::string& why_not, const std::string& state)>;

  explicit LifeChanges(ApplicationHost& application) : application_(application) {}

  /// `step` is `kRenew`, `kToolStop`, `kToolStart`, `kRollBack` or `kConfirm`. `done` is called in
  /// an activation of the component, or on the thread that takes notices.
  void make(detail::ComponentCore& component, detail::LifeStep step, Done done);
  /// Reloads the component by `order`, in the format of `on_reload`. `done` as above.
  void reload(detail::ComponentCore& component, const nlohmann::json& order, Done done);
  /// Reloads a component that runs here. Set before the start.
  std::function<void(detail::ComponentCore& component, const nlohmann::json& order, Done done)>
      on_reload;
  void take(const Notice& notice);

 private:
  struct Asked {
    std::uint32_t process = 0;  ///< That of the component.
    Done done;
  };

  /// Sends `what` to the process of the component, whose answer is passed to `done`.
  void ask_elsewhere(detail::ComponentCore& component, nlohmann::json what, Done done);
  void make_here(detail::ComponentCore& component, detail::LifeStep step, Done done);
  void answer(std::uint64_t number, const std::string& why_not, const std::string& state);
  void process_has_ended(std::uint32_t process);

  ApplicationHost& application_;
  base::PriorityMutex mutex_;
  std::uint64_t numbers_ = 0;
  std::map<std::uint64_t, Asked> asked_;  ///< By number.
};

}  // namespace fastcycle::host
