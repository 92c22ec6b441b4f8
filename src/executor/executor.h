#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "base/sleepers.h"
#include "base/thread.h"
#include "executor/actor.h"
#include "executor/foreign_inputs.h"

namespace fastcycle::detail {

/// What a worker does while there is nothing to do.
enum class WaitMode : std::uint8_t {
  kPark,      ///< Sleeps at once: leaves the CPU to other work.
  kSpin,      ///< Polls: only for a worker with a CPU of its own.
  kAdaptive,  ///< Polls for up to 50 µs, then sleeps.
};

/// Options of an executor, from the application file.
struct ExecutorOptions {
  std::string name = "default";
  unsigned threads = 1;
  std::vector<int> cpus;
  base::SchedulingPolicy policy = base::SchedulingPolicy::kOther;
  int priority = 0;
  int slice_us = 0;  ///< As in `ThreadOptions`.
  WaitMode wait = WaitMode::kPark;
  bool hand_over = false;  ///< A publish by one of its workers wakes no other of them.
};

/// Workers that serve components on the machine's clock.
///
/// Components that are ready are bits of a mask; a worker claims one and serves a turn of it. There
/// is no dispatcher: the publisher itself sets the bit and wakes a sleeper. One of the sleeping
/// workers, the leader, sleeps only until the next timer is due.
///
/// @threads  `enqueue`, `wake`, `submit`, `timer_armed` are Safe; all else is the control thread's.
/// @realtime `enqueue` and `wake` allocate nothing and take no lock; at most one system call.
class Executor final : public ReadyQueue, public TimerWatch {
 public:
  static constexpr std::size_t kMaxJobs = 1024;

  explicit Executor(ExecutorOptions options);
  ~Executor() override;

  /// Serves `actor` from now on; before `start`.
  void add(Actor& actor);

  /// Sets the inputs from other processes, which outlive this. Before `start`.
  void set_foreign_inputs(ForeignInputs& inputs) noexcept { foreign_ = &inputs; }

  /// Starts the workers; adds what the machine refused to `refusals`.
  void start(std::vector<base::Refusal>& refusals);

  /// Ends the workers after their current work, and joins them.
  void stop();

  /// Runs `job` on a worker beside the components. False if too many wait.
  [[nodiscard]] bool submit(std::function<void()> job);

  void enqueue(std::uint32_t index) noexcept override;
  void wake() noexcept override;
  void prepare(std::uint32_t index) noexcept override;
  void timer_armed(std::int64_t due_ns) noexcept override;

  [[nodiscard]] const ExecutorOptions& options() const noexcept { return options_; }
  [[nodiscard]] bool is_quiet() const noexcept;
  /// The activations of the workers: one ring each.
  [[nodiscard]] const ActivationRings& rings() const noexcept { return rings_; }
  /// The first workers write into `rings`, which outlive them. Before the start.
  void use_rings(std::span<ActivationRing* const> rings) { rings_.use(rings); }

 private:
  static constexpr std::int64_t kNobodyLeads = INT64_MIN;

  void work(unsigned worker);
  bool run_ready(unsigned worker);
  bool run_job();
  bool fire_timers() noexcept;
  void idle(unsigned worker);
  void sleep(unsigned worker, std::int64_t deadline_ns);
  void sleep_with_foreign(unsigned worker, std::int64_t deadline_ns);
  [[nodiscard]] bool has_ready() const noexcept;
  [[nodiscard]] bool has_work() const noexcept;
  [[nodiscard]] bool spin_for_work(std::int64_t limit_ns);
  bool run_early(std::int64_t now_ns);
  std::int64_t lead(unsigned worker) noexcept;
  std::int64_t announce_deadline() noexcept;
  void stop_leading(unsigned worker) noexcept;

  // Constant after `start`.
  const ExecutorOptions options_;
  std::vector<Actor*> actors_;
  ActivationRings rings_;
  ForeignInputs* foreign_ = nullptr;  ///< Null: no inputs from other processes.

  std::vector<std::atomic<std::uint64_t>> ready_;  ///< One bit a component.
  base::Sleepers sleepers_;
  std::atomic<bool> is_stopping_{false};

  std::atomic<std::int64_t> earliest_due_ns_{base::kNever};
  std::atomic<unsigned> leader_{base::Sleepers::kMaxWorkers};
  std::atomic<std::int64_t> leader_deadline_ns_{kNobodyLeads};

  base::PriorityMutex job_mutex_;
  std::deque<std::function<void()>> jobs_;
  std::atomic<std::size_t> job_count_{0};
  std::atomic<std::size_t> busy_jobs_{0};

  std::vector<base::Thread> threads_;
};

}  // namespace fastcycle::detail
