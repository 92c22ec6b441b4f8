#pragma once

#include <atomic>
#include <memory>
#include <string_view>
#include <vector>

#include "base/thread.h"
#include "broker/topics.h"
#include "config/problem.h"
#include "host/observer.h"

namespace fastcycle::host {

class TimeDriver;

/// All observers of an application: owns the list of them, and some of them.
///
/// @threads  Confined to the control thread, except `faulted` and `changed`, which are called in
///           activations, and `changed_elsewhere`.
class Observers {
 public:
  Observers() = default;
  Observers(const Observers&) = delete;
  Observers& operator=(const Observers&) = delete;

  /// Before `tap`; `observer` outlives the run.
  void add(Observer& observer) { observers_.push_back(&observer); }
  /// The same, owned from here on.
  void add(std::unique_ptr<Observer> observer);

  /// As the functions of `Observer`, for each in the order in which they were added.
  void tap(detail::Topics& topics);
  void open(config::Problems& problems);
  void start(const Application& application, TimeDriver& time,
             std::vector<const detail::ReadRing*> reads,
             std::vector<const detail::PeerActivity*> peers, std::vector<base::Refusal>& refusals);
  /// Whether one of them wants reads.
  [[nodiscard]] bool want_reads() const;
  void faulted(std::string_view component, std::string_view what) noexcept;
  [[nodiscard]] bool wants_changes() const noexcept { return !change_observers_.empty(); }
  void changed(const ComponentNews& news) noexcept;
  void changed_elsewhere(const ComponentNews& news) noexcept;
  /// After this none is called any more.
  void stop(const Application& application);

 private:
  std::vector<std::unique_ptr<Observer>> owned_;
  std::vector<Observer*> observers_;
  std::vector<Observer*> change_observers_;  ///< Those that want changes of components.
  std::unique_ptr<detail::OverflowWatch> overflow_watch_;  ///< Null if none wants overflows.
  std::atomic<bool> is_over_{false};
};

}  // namespace fastcycle::host
