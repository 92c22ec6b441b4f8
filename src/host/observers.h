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

/// All tools that watch an application: owns the list of them, and some of them.
///
/// @threads  Confined to the control thread, but `faulted` and `changed`, which are called in
///           activations.
class Observers {
 public:
  Observers() = default;
  Observers(const Observers&) = delete;
  Observers& operator=(const Observers&) = delete;

  /// Before `tap`; `observer` has to live longer than the run.
  void add(Observer& observer) { observers_.push_back(&observer); }
  /// The same, owned from here on.
  void add(std::unique_ptr<Observer> observer);

  /// As the functions of `Observer`, for each in the order in which they were added.
  void tap(detail::Topics& topics);
  void open(config::Problems& problems);
  void start(const Application& application, TimeDriver& time,
             std::vector<const detail::ReadRing*> reads,
             std::vector<const detail::PeerActivity*> peers, std::vector<base::Refusal>& refusals);
  /// Whether one of them wants what activations learn.
  [[nodiscard]] bool want_reads() const;
  void faulted(std::string_view component, std::string_view what) noexcept;
  [[nodiscard]] bool wants_changes() const noexcept { return !hearing_.empty(); }
  void changed(const ComponentNews& news) noexcept;
  /// After this none is called any more, whatever still happens.
  void stop(const Application& application);

 private:
  std::vector<std::unique_ptr<Observer>> owned_;
  std::vector<Observer*> observers_;
  std::vector<Observer*> hearing_;  ///< Of these, who wants changes of components.
  std::unique_ptr<detail::OverflowWatch> overflow_watch_;  ///< If one wants to know.
  std::atomic<bool> is_over_{false};
};

}  // namespace fastcycle::host
