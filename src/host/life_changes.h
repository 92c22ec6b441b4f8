#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "base/priority_mutex.h"
#include "component/peers.h"
#include "executor/life_step.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class ApplicationHost;

/// Restarts, stops and starts components on behalf of a tool, in whatever process they run.
///
/// @threads  `make` is Safe; `take` as `Peers::on_notice`.
class LifeChanges {
 public:
  /// What became of it: why it was not done, or empty; and the component's state in a word.
  using Done = std::function<void(const std::string& why_not, const std::string& state)>;

  explicit LifeChanges(ApplicationHost& application) : application_(application) {}

  /// `step` is `kRenew`, `kToolStop` or `kToolStart`. `done` is called in an activation of the
  /// component, or on the thread that takes notices.
  void make(detail::ComponentCore& component, detail::LifeStep step, Done done);
  void take(const Notice& notice);

 private:
  struct Asked {
    std::uint32_t process = 0;  ///< That of the component.
    Done done;
  };

  void make_here(detail::ComponentCore& component, detail::LifeStep step, Done done);
  void answer(std::uint64_t number, const std::string& why_not, const std::string& state);
  void process_has_ended(std::uint32_t process);

  ApplicationHost& application_;
  base::PriorityMutex mutex_;
  std::uint64_t numbers_ = 0;
  std::map<std::uint64_t, Asked> asked_;  ///< By number.
};

}  // namespace fastcycle::host
