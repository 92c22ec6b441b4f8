#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "base/priority_mutex.h"
#include "base/thread.h"
#include "component/application_host.h"
#include "component/bell.h"
#include "component/component_core.h"
#include "component/time_driver.h"
#include "component/wiring.h"

namespace fastcycle::host {

/// A call of a component that had not returned when its application stopped.
struct StuckCall {
  std::string component;
  std::string call;  ///< As text: "its start()", "its callback for \"topic\"".
};

/// Starts and stops components: owns the order of their starts, their threads, and a deadline for
/// each wait.
///
/// A component that does not return is abandoned: the others continue, and `stuck` names it.
///
/// @threads  Confined to the control thread, except for calls of components that are reconstructed.
class Lifecycle final : public ThreadHost {
 public:
  /// Limit for all steps of the end together, regardless of the components.
  static constexpr std::chrono::seconds kEndLimit{5};
  /// Limit for one step. If the application file allows longer callbacks (`callback_limit_ms`),
  /// both limits grow by the difference.
  static constexpr std::chrono::seconds kStepLimit{1};

  /// All arguments outlive this.
  Lifecycle(ApplicationHost& host, const Wiring& wiring, TimeDriver& time, Bell& bell)
      : host_(host), wiring_(wiring), time_(time), bell_(bell) {}
  Lifecycle(const Lifecycle&) = delete;
  Lifecycle& operator=(const Lifecycle&) = delete;

  /// Indices into `ApplicationHost::components`, in the order of the starts. Before `start`.
  void set_order(std::vector<std::size_t> order) { order_ = std::move(order); }
  void add_last(std::size_t component) { order_.push_back(component); }

  /// Starts all, one after the other. False if the run was ended before all were called. A `start`
  /// that has not returned at `deadline_ns` of CLOCK_MONOTONIC ends the run as a fault.
  bool start(std::int64_t deadline_ns);
  /// Arms the timers, as of `start`.
  void start_timers(Time start);
  void start_threads(std::vector<base::Refusal>& refusals);

  // The threads of a component that is reconstructed; in an activation of it.

  void ask_threads_to_end(detail::ComponentCore& component) override;
  [[nodiscard]] std::vector<std::string> running_threads(
      const detail::ComponentCore& component) const override;
  void join_threads(const detail::ComponentCore& component) override;
  void start_threads(detail::ComponentCore& component) override;

  // The steps of an end, in this order.

  /// Requests threads to stop, and waits for them.
  void stop_threads();
  void stop_timers();
  /// Waits for running activations.
  void drain();
  /// In the reverse order of their starts.
  void stop_components();
  /// Waits for calls that have not returned yet, and for what they caused.
  void finish();

  /// The calls that did not return.
  [[nodiscard]] const std::vector<StuckCall>& stuck() const noexcept { return stuck_; }
  /// Whether a thread may still be in the component's code: its object is then not destroyed.
  [[nodiscard]] bool is_stuck(const detail::Actor& component) const;
  /// Waits, without a limit, for the threads of components that have not ended.
  void join_threads();

 private:
  /// A thread that a component declared.
  struct OwnThread {
    detail::ComponentCore& component;
    const detail::ComponentCore::NamedThread& named;
    const std::uint64_t object;  ///< Its owner: `ComponentCore::restart_count`.
    std::stop_source stop = {};
    std::atomic<bool> has_ended{false};
    base::Thread thread = {};
  };
  /// A request to a component during the end.
  struct Asked {
    detail::ComponentCore& component;
    ControlCall call;
  };

  [[nodiscard]] bool is_pending(const detail::ComponentCore& component) const;
  [[nodiscard]] base::ThreadOptions options_of(const config::ComponentDescription& component,
                                               const std::string& thread) const;
  void start_component(detail::ComponentCore& component, std::int64_t deadline_ns);
  /// @pre  `threads_mutex_` is held.
  void begin_threads(detail::ComponentCore& component, std::vector<base::Refusal>& refusals);
  void run_thread(OwnThread& its);
  void end_thread(OwnThread& its) noexcept;
  /// Those of `component`, or, if it is null, of all.
  [[nodiscard]] std::vector<std::stop_source> stop_sources(
      const detail::ComponentCore* component) const;
  [[nodiscard]] bool have_threads_ended() const;
  /// Joins and removes those for which `which` holds.
  template <typename Which>
  void join(const Which& which);
  [[nodiscard]] std::int64_t step_deadline();
  [[nodiscard]] std::chrono::nanoseconds step_limit() const;
  void find_stuck();
  [[nodiscard]] std::string call_of(const detail::ComponentCore& component) const;

  ApplicationHost& host_;
  const Wiring& wiring_;
  TimeDriver& time_;
  Bell& bell_;
  std::vector<std::size_t> order_;
  /// Control plane: starting, stopping and joining threads of components.
  mutable base::PriorityMutex threads_mutex_;
  enum class ThreadsStage : std::uint8_t { kNone, kRun, kEnd };
  ThreadsStage threads_stage_ = ThreadsStage::kNone;
  std::vector<std::unique_ptr<OwnThread>> threads_;
  /// Components whose old threads were requested to end, and whose new ones have not begun.
  std::set<const detail::ComponentCore*> between_objects_;

  std::uint32_t part_ = 0;
  std::int64_t end_ns_ = base::kNever;  ///< CLOCK_MONOTONIC: deadline of all steps of the end.
  std::vector<Asked> asked_;
  std::vector<StuckCall> stuck_;
};

}  // namespace fastcycle::host
