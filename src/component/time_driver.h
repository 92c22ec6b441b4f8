#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/thread.h"
#include "config/description.h"
#include "executor/executor.h"
#include "executor/life_step.h"
#include "executor/round_peers.h"
#include "executor/simulation.h"

namespace fastcycle::host {

class WallPace;

/// The default executor.
inline constexpr const char* kPoolName = "pool";
[[nodiscard]] bool needs_pool(const config::ApplicationDescription& application);

/// The executors of an application, in the order of its file; the default pool is the last one.
[[nodiscard]] std::vector<std::string> executor_names(
    const config::ApplicationDescription& application);

/// How many workers the pool has on this machine, and all executors of an application, live.
[[nodiscard]] unsigned pool_size();
[[nodiscard]] unsigned worker_count(const config::ApplicationDescription& application);
/// How these are named: as their executor, with a number if that has several.
[[nodiscard]] std::vector<std::string> worker_names(
    const config::ApplicationDescription& application);
/// The same in simulated time; `asked`: the requested number, or 0.
[[nodiscard]] unsigned simulated_worker_count(unsigned asked);

/// A call of the control thread to a component: owns the flag that it has ended. Shared with the
/// worker that executes it, possibly after the control thread has given up waiting.
class ControlCall {
 public:
  [[nodiscard]] bool is_over() const noexcept { return is_over_->load(); }
  void end() const noexcept { is_over_->store(true); }

 private:
  std::shared_ptr<std::atomic<bool>> is_over_ = std::make_shared<std::atomic<bool>>(false);
};

/// Advances an application's time and schedules its components: owns the workers that serve them.
///
/// @threads  Stated for each part.
class TimeDriver {
 public:
  TimeDriver() = default;
  TimeDriver(const TimeDriver&) = delete;
  TimeDriver& operator=(const TimeDriver&) = delete;
  virtual ~TimeDriver() = default;

  [[nodiscard]] virtual bool is_simulated() const noexcept = 0;
  /// Whether this is a replay: then a log provides what other components did.
  [[nodiscard]] virtual bool is_recorded() const noexcept { return false; }

  // Before the start; control thread.

  /// The clock of the next component that is added; `application` is that of all.
  [[nodiscard]] virtual const base::Clock& clock_of_next(const base::Clock& application) {
    return application;
  }
  /// Serves `actor`, which is described by `component`, from the start on.
  virtual void add(detail::Actor& actor, const config::ComponentDescription& component) = 0;
  /// `actor` only observes: it does not keep time advancing.
  virtual void set_watcher([[maybe_unused]] const detail::Actor& actor) {}
  /// In simulated time: sets the external input, whose times are known.
  virtual void set_feed([[maybe_unused]] detail::Feed& feed) {}
  /// In simulated time: sets its speed.
  virtual void set_pace([[maybe_unused]] WallPace& pace) {}
  /// In simulated time: sets the other processes that share it.
  virtual void set_peers([[maybe_unused]] detail::RoundPeers& peers) {}
  /// In simulated time: calls `action` at the end of each round, with its index within its instant.
  virtual void after_round([[maybe_unused]] std::function<void(std::uint32_t step)> action) {}
  /// The first workers record their activations in `rings`, which outlive them.
  virtual void use_rings([[maybe_unused]] std::span<detail::ActivationRing* const> rings) {}
  /// Whether a thread is to run with a real-time priority.
  [[nodiscard]] virtual bool is_real_time() const { return false; }

  // From the start to the end; control thread.

  /// Starts the workers; adds what the machine refused to `refusals`.
  virtual void start(std::vector<base::Refusal>& refusals) = 0;
  /// The activations of the workers: one ring each, once they are started.
  [[nodiscard]] virtual std::vector<const detail::ActivationRing*> rings() const = 0;

  /// The next steps of the life cycle are part `part` of their instant.
  virtual void begin_part([[maybe_unused]] std::uint32_t part) {}
  /// The starts, which were `parts`, have ended; the run begins.
  virtual void begin_run([[maybe_unused]] std::uint32_t parts) {}

  /// Calls `body` in an activation of `actor`; rings the bell when that has ended, consequences of
  /// a fault included. In simulated time it has ended when this returns.
  [[nodiscard]] virtual ControlCall call(detail::Actor& actor, detail::LifeStep step,
                                         std::function<void()> body) = 0;
  /// In simulated time of several processes, in place of `call` when another process calls its
  /// component: serves what follows from that.
  virtual void follow_call() {}

  /// How a run ended.
  enum class End : std::uint8_t {
    kReached,      ///< The requested time was reached.
    kInputOver,    ///< In simulated time: the input has ended.
    kIdle,         ///< In simulated time: no event is left.
    kStuck,        ///< Simulated time does not advance.
    kInterrupted,  ///< `interrupt` was called.
  };
  /// Runs components until the application's clock reaches `limit`; in simulated time at most until
  /// `input_end`.
  virtual End run(Time limit, Time input_end) = 0;
  /// In simulated time: serves everything up to `time`.
  virtual void advance_to([[maybe_unused]] Time time) {}
  /// In simulated time: serves what is left to do at the present time.
  virtual void settle() {}
  /// Waits until no activation is running, at most until `deadline_ns`.
  virtual void drain(std::int64_t deadline_ns) = 0;

  /// No offloaded work is begun any more.
  virtual void refuse_jobs() {}
  /// Ends the workers, except those that may serve an actor for which `is_stuck` holds, or that do
  /// offloaded work: these run until their call returns.
  virtual void stop(const std::function<bool(const detail::Actor&)>& is_stuck) = 0;
  /// Whether a worker may still be in `actor`, after `stop`.
  [[nodiscard]] virtual bool may_serve([[maybe_unused]] const detail::Actor& actor) const {
    return false;
  }
  /// Waits, without a limit, for the workers that `stop` left running.
  virtual void join() {}

  // Safe, from the start to the end.

  /// Ends `run`, and keeps a later one from waiting.
  virtual void interrupt() noexcept = 0;
  /// Executes `action` now; in simulated time between rounds.
  virtual void between_rounds(std::function<void()> action) = 0;
  /// In simulated time threads of components keep an idle run from ending.
  virtual void foreign_thread_begins() noexcept {}
  virtual void foreign_thread_ends() noexcept {}
  /// In simulated time: time does not advance until each hold was released.
  virtual void hold() noexcept {}
  virtual void let_go() noexcept {}
  /// Where messages of foreign threads wait for the end of a round; null if they do not wait.
  [[nodiscard]] virtual detail::Stage* external_stage() noexcept { return nullptr; }

  // In an activation of `from`.

  /// Executes `action` now; in simulated time at the end of the present round.
  virtual void stage(detail::Actor& from, std::function<void()> action) = 0;
  /// In simulated time: waits until `condition` holds, at most until `deadline_ns` of
  /// CLOCK_MONOTONIC; no time passes meanwhile. Live it returns at once.
  virtual void await([[maybe_unused]] std::int64_t deadline_ns,
                     [[maybe_unused]] const std::function<bool()>& condition) {}
  /// Queues `job` for a worker of the executor with index `executor` of `executor_names`. False if
  /// too many wait.
  [[nodiscard]] virtual bool submit(std::size_t executor, detail::Actor& from,
                                    std::function<void()> job) = 0;

  /// In simulated time, between two rounds: in the next one these components are served first.
  virtual void serve_first([[maybe_unused]] std::vector<std::uint32_t> components) {}

  /// None in simulated time.
  [[nodiscard]] const std::vector<std::unique_ptr<detail::Executor>>& executors() const noexcept {
    return executors_;
  }

 protected:
  std::vector<std::unique_ptr<detail::Executor>> executors_;
};

}  // namespace fastcycle::host
