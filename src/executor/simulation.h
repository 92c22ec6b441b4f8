#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "executor/actor.h"
#include "executor/round_peers.h"

namespace fastcycle::detail {

/// External input of simulated time, with known times: a recording.
///
/// @threads  Called by the thread that runs the simulation, between rounds.
class Feed {
 public:
  Feed() = default;
  Feed(const Feed&) = delete;
  Feed& operator=(const Feed&) = delete;
  virtual ~Feed() = default;

  /// When the next input is due; `kNever` if there is none.
  [[nodiscard]] virtual std::int64_t next_due_ns() const noexcept = 0;
  /// In which round of that instant.
  [[nodiscard]] virtual std::uint32_t next_step() const noexcept = 0;
  /// Hands over all that is due before `now`, or at `now` in a round up to `step`.
  virtual void put(Time now, std::uint32_t step) = 0;
};

/// Determines when, in wall time, simulated time may advance.
///
/// @threads  Called by the thread that runs the simulation.
class Pace {
 public:
  Pace() = default;
  Pace(const Pace&) = delete;
  Pace& operator=(const Pace&) = delete;
  virtual ~Pace() = default;

  /// CLOCK_MONOTONIC at which time may advance to `next`; `kNever` while paused. Called again after
  /// each `Simulation::look_again`.
  [[nodiscard]] virtual std::int64_t may_go_at(Time next) noexcept = 0;
  /// Time advances to `next` now; `is_fed`: the feed has input for that instant.
  virtual void goes(Time next, bool is_fed) noexcept = 0;
};

/// Serves components in simulated time, by rounds, in place of all executors.
///
/// A round is all causes with the smallest time. Its components run in parallel; what they publish
/// is handed over when all have finished, and forms the next round. Time advances, to the next
/// timer, only when nothing is left to do at the present time and no hold exists. So the result is
/// the same for any number of workers, and as fast as the components compute.
///
/// The effects of a component with a simulated cost are handed over at the end of the first round
/// in which that time has passed; it serves nothing until then.
///
/// @threads  `enqueue`, `hold`, `let_go`, `submit`, `call`, `interrupt` are Safe; all else is
///           confined to the thread that runs it.
class Simulation final : public ReadyQueue, public TimerWatch, public Stage {
 public:
  enum class End {
    kReached,      ///< Time reached the requested limit.
    kIdle,         ///< No event is left.
    kInterrupted,  ///< `interrupt` was called.
    kStuck,        ///< A hundred thousand rounds at one instant: time would never advance.
  };

  Simulation(base::Clock& clock, unsigned workers);
  ~Simulation() override;

  void add(Actor& actor);

  /// If set, called at the end of a round, after all that it published was handed over: for
  /// observers that are not components. `step` is the round's index in its instant.
  std::function<void(std::uint32_t step)> after_round;

  /// Sets the external input. Before the first round; it outlives all rounds.
  void set_feed(Feed& feed) noexcept { feed_ = &feed; }
  /// Sets the other processes that share this time. Before the first round; it outlives all rounds.
  /// All call `run_now` and `run_until` in the same order.
  void set_peers(RoundPeers& peers) noexcept { peers_ = &peers; }
  /// Without one, time advances as fast as the components compute.
  void set_pace(Pace& pace) noexcept { pace_ = &pace; }
  /// `actor`, which was added, only observes: its timers do not keep time advancing when nothing
  /// else is left.
  void set_watcher(const Actor& actor) noexcept { watcher_ = &actor; }
  /// Makes the simulation query the pace again. Safe.
  void look_again() noexcept;

  /// The next round of the present instant is number `first`, or a later one; until the next call
  /// no input of round `end` or later is fed. So ordered parts of an instant, such as the starts of
  /// components, have their own ranges of numbers.
  void begin_steps(std::uint32_t first, std::uint32_t end) noexcept;

  /// Serves everything up to `limit`, and advances the clock to it.
  End run_until(Time limit) { return run_until(limit, true); }
  /// The same, ignoring the conditions that end a run.
  void advance_to(Time time) { run_until(time, false); }

  /// Serves what is left to do at the present time, without advancing it; at most a hundred
  /// thousand rounds. Pending computations end at once.
  void run_now();

  /// Ends `run_until` after the present round; `clear_interrupt` allows the next one. With peers,
  /// they determine when it ends, since all must end in the same round.
  void interrupt() noexcept;
  void clear_interrupt() noexcept { is_interrupted_.store(false); }

  /// The next round's index in the present instant, from 0.
  [[nodiscard]] std::uint32_t step() const noexcept { return step_; }

  void hold() noexcept;
  void let_go() noexcept;

  /// Runs `job` at the end of the present round; time does not advance before it has finished.
  [[nodiscard]] bool submit(std::function<void()> job);

  /// Calls `action` before the next round, on the thread that runs the simulation. Safe.
  void call(std::function<void()> action);

  /// In the next round these components are served before all others, one after the other. The
  /// result is the same; it only orders their effects on state shared outside of messages.
  void serve_first(std::vector<std::uint32_t> indices) { first_ = std::move(indices); }

  /// While there are such threads, an idle simulation waits for their messages.
  void foreign_thread_begins() noexcept { foreign_threads_.fetch_add(1); }
  void foreign_thread_ends() noexcept;

  /// Takes a message of an external publisher; it is delivered before the next round.
  void put(PublisherCore& publisher, Envelope* envelope) override;

  void enqueue(std::uint32_t index) noexcept override;
  void prepare(std::uint32_t) noexcept override {}
  void wake() noexcept override {}
  void timer_armed(std::int64_t due_ns) noexcept override;

  /// The activations of the workers: one ring each.
  [[nodiscard]] const ActivationRings& rings() const noexcept { return rings_; }
  /// The first workers write into `rings`, which outlive them. Before the start.
  void use_rings(std::span<ActivationRing* const> rings) { rings_.use(rings); }

 private:
  struct External {
    PublisherCore* publisher;
    Envelope* envelope;
  };

  /// One component's part of a round.
  struct Turn {
    Actor* actor;
    std::size_t index;
    bool is_served = false;  ///< Ahead of the others, or within its simulated cost.
  };

  static constexpr std::uint64_t kMaxRoundsAtOnce = 100'000;

  End run_until(Time limit, bool may_end);
  /// Takes external input, and agrees with the peers on what is to be done. With a `limit` time may
  /// advance until then.
  void begin_round(std::optional<Time> limit = {});
  bool run_round();
  void collect_round();
  [[nodiscard]] RoundState state();
  /// Ends pending computations now, as time does not advance; false if there are none.
  bool end_computing() noexcept;
  [[nodiscard]] bool is_anyone_computing() const noexcept;
  [[nodiscard]] bool is_computing(std::size_t index) const noexcept {
    return computing_until_ns_[index] != base::kNever;
  }
  void serve(const Turn& turn, unsigned worker);
  void serve_in_parallel();
  [[nodiscard]] bool is_worth_helpers() const noexcept;
  void help(unsigned worker, const std::stop_token& stop);
  void serve_shared(unsigned worker);
  void run_jobs();
  void take_external();
  bool take_fed();
  [[nodiscard]] bool is_anyone_ready() const noexcept;
  [[nodiscard]] bool has_fed_at(std::int64_t time_ns) const noexcept;
  void advance(Time time) noexcept;
  [[nodiscard]] std::int64_t next_due_ns(const Actor* without = nullptr) const noexcept;
  [[nodiscard]] std::uint64_t changes();
  /// Waits for external input since `seen`; false if there is nothing to wait for.
  [[nodiscard]] bool wait_for_change(std::uint64_t seen, bool may_end);
  /// For `run_until`, when no round is left: advances to the next time that the peers agreed on.
  /// Returns true if the run has ended, by `end`.
  [[nodiscard]] bool advance_together(std::uint64_t seen, End& end);
  /// Waits until the pace allows time to advance to `next`; false on external input since `seen`.
  [[nodiscard]] bool wait_for_pace(std::uint64_t seen, Time next);

  base::Clock& clock_;
  std::uint32_t step_ = 0;
  std::uint32_t steps_end_ = std::numeric_limits<std::uint32_t>::max();
  Feed* feed_ = nullptr;
  Pace* pace_ = nullptr;
  RoundPeers* peers_ = nullptr;
  RoundState all_;  ///< With peers: the combined state.
  const Actor* watcher_ = nullptr;
  std::vector<Actor*> actors_;
  ActivationRings rings_;

  std::vector<std::atomic<std::uint64_t>> ready_;
  /// By component: when its pending computation ends; `kNever` if there is none.
  std::vector<std::int64_t> computing_until_ns_;
  std::atomic<bool> is_interrupted_{false};
  std::atomic<int> foreign_threads_{0};

  // Input of other threads, which also wakes an idle simulation.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<External> external_;
  std::vector<std::function<void()>> actions_;
  int holds_ = 0;
  std::uint64_t changes_ = 0;

  std::mutex job_mutex_;
  std::vector<std::function<void()>> jobs_;

  // One round. Not changed by the running thread while helpers serve it.
  std::vector<Turn> round_;
  std::vector<std::int64_t> expected_ns_;  ///< By component: expected cost, from its last turns.
  std::atomic<std::size_t> next_in_round_{0};
  std::vector<std::uint32_t> first_;  ///< Served before all others.

  std::mutex round_mutex_;
  std::condition_variable_any round_begins_;
  std::condition_variable round_ends_;
  std::uint64_t round_number_ = 0;
  std::size_t helpers_at_work_ = 0;
  std::vector<std::jthread> helpers_;
};

}  // namespace fastcycle::detail
