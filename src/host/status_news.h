#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/histogram.h"
#include "base/priority_mutex.h"
#include "broker/subscription.h"
#include "component/component_state.h"
#include "component/versions.h"
#include "fastcycle/component.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class TimeDriver;

/// How a component in another process is, beyond what it says of itself.
struct FiguresElsewhere {
  /// One that has subscribed, and what became of its messages.
  struct Subscription {
    std::string topic;
    std::string kind;  ///< As `to_word` of it.
    std::uint64_t depth = 0;
    bool drops_oldest = true;
    detail::Ledger ledger;
    base::HistogramSummary latency;  ///< Nanoseconds.
  };

  detail::ComponentState state{};
  std::uint64_t activations = 0;
  std::uint64_t overruns = 0;
  std::string hang = {};
  // Told once in a period; the rest with each news.
  base::HistogramSummary callback = {};  ///< Nanoseconds, as the next one.
  base::HistogramSummary lateness = {};
  std::vector<Subscription> subscriptions = {};
};

/// What only a component itself knows of itself, as it hands it on.
struct ComponentNews {
  std::size_t component = 0;
  Health health = Health::kOk;
  std::string health_reason = {};
  std::uint64_t faults = 0;
  std::string last_fault = {};
  std::uint64_t restarts = 0;
  detail::VersionNews version = {};
  bool ends_process = false;  ///< Its process ends for its last fault.
  bool is_urgent = false;     ///< Not only for the next period.
  /// What others see by themselves, of one that does not run in another process.
  std::optional<FiguresElsewhere> elsewhere = {};
};

/// What there is to say of `core` now; in its activation, or before the start.
[[nodiscard]] ComponentNews news_of(const detail::ComponentCore& core);

/// What components have said and the status component has not heard yet: owns of each the newest
/// only, so that one that says much fills no queue.
///
/// @threads  Safe; `set_count` before the start.
class PendingNews {
 public:
  void set_count(std::size_t components) { pending_.resize(components); }

  /// True if nothing of its component was pending: then somebody has to `take` it.
  [[nodiscard]] bool put(ComponentNews news);
  /// The newest of `component`; urgent if any was that it stands for.
  [[nodiscard]] ComponentNews take(std::size_t component);

 private:
  base::PriorityMutex mutex_;
  std::vector<std::optional<ComponentNews>> pending_;
};

/// Tells the status component, if an application has one, what its other components say: owns what
/// is on the way.
///
/// @threads  `changed` in an activation of the component; `mode_changed` and `changed_elsewhere`
///           Safe; all else before the start.
class StatusTeller {
 public:
  explicit StatusTeller(TimeDriver& time) : time_(time) {}

  /// `status` is the last of `components` components so far, and lives as long as this. What comes
  /// behind it is not told of.
  void set_status(detail::ComponentCore& status, std::size_t components);
  void changed(detail::ComponentCore& component, bool is_urgent);
  /// What a component in another process says. As `Peers::on_notice`.
  void changed_elsewhere(ComponentNews news);
  void mode_changed();
  /// Nothing is told any more.
  void end() { is_over_ = true; }

 private:
  void hear(const ComponentNews& news) const;

  TimeDriver& time_;
  detail::ComponentCore* status_ = nullptr;
  PendingNews pending_;
  std::atomic<bool> is_over_{false};
};

}  // namespace fastcycle::host
