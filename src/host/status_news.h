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
#include "modes/chains.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class TimeDriver;

/// Figures of a component in another process, beyond its `ComponentNews`.
struct FiguresElsewhere {
  /// A subscription, with its ledger.
  struct Subscription {
    std::string topic;
    std::string kind;  ///< As `to_word` of it.
    std::uint64_t depth = 0;
    bool drops_oldest = true;
    detail::Ledger ledger;
    base::HistogramSummary latency;  ///< Nanoseconds.
    base::HistogramBuckets latency_buckets;
    std::vector<std::string> unmatched = {};  ///< As sentences.
  };

  /// A callback, with its run time.
  struct Callback {
    std::string name;
    std::string kind;
    base::HistogramSummary run_time;  ///< Nanoseconds.
  };

  detail::ComponentState state{};
  std::uint64_t activations = 0;
  std::uint64_t overruns = 0;
  std::string hang = {};
  // Sent once in a period; the rest with each news.
  std::string executor = {};             ///< That of its process.
  base::HistogramSummary callback = {};  ///< Nanoseconds, as the next one.
  base::HistogramSummary lateness = {};
  base::HistogramBuckets callback_buckets = {};
  base::HistogramBuckets lateness_buckets = {};
  std::vector<Callback> callbacks = {};
  std::vector<Subscription> subscriptions = {};
  std::vector<ChainReport> chains = {};  ///< Those that end at it, without their settings.
};

/// Results of a latency chain at one component where it ends.
struct ChainNews {
  std::size_t chain = 0;  ///< Its index in the application file.
  std::uint64_t count = 0;
  std::uint64_t breaches = 0;
  std::uint64_t dropped = 0;
};

/// What a component did in processes that have ended: they report nothing.
struct EarlierRuns {
  std::string component = {};
  std::uint64_t faults = 0;  ///< The ends of its processes are among them.
  std::uint64_t restarts = 0;
  std::uint64_t reloads = 0;
  std::uint64_t rollbacks = 0;
  std::string last_end = {};
  std::vector<ChainNews> chains = {};
};

/// State of a component that only its activations can read, as passed on by it.
struct ComponentNews {
  std::size_t component = 0;
  Health health = Health::kOk;
  std::string health_reason = {};
  std::uint64_t faults = 0;
  std::string last_fault = {};
  std::uint64_t restarts = 0;
  detail::VersionNews version = {};
  std::vector<ChainNews> chains = {};  ///< Passed on at each breach in simulated time, and between
                                       ///< processes.
  bool ends_process = false;           ///< Its process ends for its last fault.
  bool is_urgent = false;              ///< Not only for the next period.
  /// Set for a component in another process, whose figures cannot be read directly.
  std::optional<FiguresElsewhere> elsewhere = {};
};

/// The present news of `core`; in its activation, or before the start.
[[nodiscard]] ComponentNews news_of(const detail::ComponentCore& core);

/// News that the status component has not taken yet: owns the newest of each component only, so
/// that frequent news fill no queue.
///
/// @threads  Safe; `set_count` before the start.
class PendingNews {
 public:
  void set_count(std::size_t components) { pending_.resize(components); }

  /// True if nothing of its component was pending: then the caller must arrange a `take`.
  [[nodiscard]] bool put(ComponentNews news);
  /// The newest of `component`; urgent if any that it replaced was.
  [[nodiscard]] ComponentNews take(std::size_t component);

 private:
  base::PriorityMutex mutex_;
  std::vector<std::optional<ComponentNews>> pending_;
};

/// Passes news of components to the status component, if the application has one: owns the pending
/// ones.
///
/// @threads  `changed` in an activation of the component; `mode_changed` and `changed_elsewhere`
///           Safe; all else before the start.
class StatusSender {
 public:
  explicit StatusSender(TimeDriver& time) : time_(time) {}

  /// `status` is the last of `components` components so far, and lives as long as this. Components
  /// behind it are not reported.
  void set_status(detail::ComponentCore& status, std::size_t components);
  void changed(detail::ComponentCore& component, bool is_urgent);
  /// News of a component in another process. As `Peers::on_notice`.
  void changed_elsewhere(ComponentNews news);
  void mode_changed();
  /// Stops reporting.
  void end() { is_over_ = true; }

 private:
  void deliver(const ComponentNews& news) const;

  TimeDriver& time_;
  detail::ComponentCore* status_ = nullptr;
  PendingNews pending_;
  std::atomic<bool> is_over_{false};
};

}  // namespace fastcycle::host
