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

/// What comes into simulated time from outside of all components, at times that are known: a
/// recording.
///
/// @threads  Called by the thread that runs the simulation, between rounds.
class Feed {
 public:
  Feed() = default;
  Feed(const Feed&) = delete;
  Feed& operator=(const Feed&) = delete;
  virtual ~Feed() = default;

  /// When the next of it is due; `kNever` if there is no further one.
  [[nodiscard]] virtual std::int64_t next_due_ns() const noexcept = 0;
  /// In which round of that moment.
  [[nodiscard]] virtual std::uint32_t next_step() const noexcept = 0;
  /// Hands over all that is due before `now`, or at `now` in a round up to `step`.
  virtual void put(Time now, std::uint32_t step) = 0;
};

/// Says when, on the wall, simulated time may go on.
///
/// @threads  Called by the thread that runs the simulation.
class Pace {
 public:
  Pace() = default;
  Pace(const Pace&) = delete;
  Pace& operator=(const Pace&) = delete;
  virtual ~Pace() = default;

  /// CLOCK_MONOTONIC at which time may go to `next`; `kNever` while it stands. Asked again
  /// whenever `Simulation::look_again` was called.
  [[nodiscard]] virtual std::int64_t may_go_at(Time next) noexcept = 0;
  /// Time goes to `next` now; `is_fed`: the feed has something for that moment.
  virtual void goes(Time next, bool is_fed) noexcept = 0;
};

/// Serves components in simulated time, by rounds, in place of all executors.
///
/// A round is all causes with the smallest time. Its components run in parallel; what they publish
/// is handed over when all are done, and makes the next round. Time advances, to the next timer,
/// only when nothing is left to do at the present one and nobody holds it. So the result is the
/// same for any number of workers, and as fast as the components compute.
///
/// What a component with a simulated cost did in a round is handed over at the end of the first
/// round in which that time is over; it serves nothing until then.
///
/// @threads  `enqueue`, `hold`, `let_go`, `submit`, `call`, `interrupt` are Safe; all else is
///           confined to the thread that runs it.
class Simulation final : public ReadyQueue, public TimerWatch, public Stage {
 public:
  enum class End {
    kReached,      ///< Time reached the limit that was asked for.
    kIdle,         ///< Nothing is left that could ever happen.
    kInterrupted,  ///< `interrupt` was called.
    kStuck,        ///< A hundred thousand rounds at one moment: time would never advance.
  };

  Simulation(base::Clock& clock, unsigned workers);
  ~Simulation() override;

  void add(Actor& actor);

  /// Called, if it is set, when a round is over and all that it published was handed over: for who
  /// watches without being a component. `step` is the round's place in its moment.
  std::function<void(std::uint32_t step)> after_round;

  /// What else there is to serve. Before the first round; it has to live as long as rounds run.
  void set_feed(Feed& feed) noexcept { feed_ = &feed; }
  /// Other processes that share this time. Before the first round; it has to live as long as rounds
  /// run. All call `run_now` and `run_until` in the same order.
  void set_peers(RoundPeers& peers) noexcept { peers_ = &peers; }
  /// Without one, time goes as fast as the components compute.
  void set_pace(Pace& pace) noexcept { pace_ = &pace; }
  /// `actor`, which was added, only watches: its timers are no reason for time to go on when
  /// nothing else is left.
  void set_watcher(const Actor& actor) noexcept { watcher_ = &actor; }
  /// Asks the pace again. Safe.
  void look_again() noexcept;

  /// The next round of the present moment is number `first`, or a later one; until the next call
  /// nothing is fed that belongs to round `end` or a later one. So parts of a moment that follow
  /// each other in a certain order, such as the starts of components, have numbers of their own.
  void begin_steps(std::uint32_t first, std::uint32_t end) noexcept;

  /// Serves everything up to `limit`, and moves the clock there.
  End run_until(Time limit) { return run_until(limit, true); }
  /// The same, whatever would end a run.
  void advance_to(Time time) { run_until(time, false); }

  /// Serves what is left to do at the present time, without advancing it; at most a hundred
  /// thousand rounds. What is still being computed is done at once.
  void run_now();

  /// Ends `run_until` after the present round; `clear_interrupt` allows the next one. With peers it
  /// is they who say when it ends, since all must end in the same round.
  void interrupt() noexcept;
  void clear_interrupt() noexcept { is_interrupted_.store(false); }

  /// The next round's place among those of the present moment, from 0.
  [[nodiscard]] std::uint32_t step() const noexcept { return step_; }

  void hold() noexcept;
  void let_go() noexcept;

  /// Runs `job` when the present round is over; time does not advance before it is done.
  [[nodiscard]] bool submit(std::function<void()> job);

  /// Calls `action` before the next round, on the thread that runs the simulation. Safe.
  void call(std::function<void()> action);

  /// In the next round these components are served before all others, one after the other. The
  /// result is the same; but what else they share with others is seen in this order.
  void serve_first(std::vector<std::uint32_t> indices) { first_ = std::move(indices); }

  /// As long as there are such threads, an idle simulation waits for what they publish.
  void foreign_thread_begins() noexcept { foreign_threads_.fetch_add(1); }
  void foreign_thread_ends() noexcept;

  /// Takes a message of an external publisher; it is delivered before the next round.
  void put(PublisherCore& publisher, Envelope* envelope) override;

  void enqueue(std::uint32_t index) noexcept override;
  void prepare(std::uint32_t) noexcept override {}
  void wake() noexcept override {}
  void timer_armed(std::int64_t due_ns) noexcept override;

  /// What the workers do: one ring each.
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
    bool is_served = false;  ///< Ahead of the others, or before the time that it took.
  };

  static constexpr std::uint64_t kMaxRoundsAtOnce = 100'000;

  End run_until(Time limit, bool may_end);
  /// Takes what came from outside, and asks the peers what is to be done. With a `limit` time may
  /// go on until then.
  void begin_round(std::optional<Time> limit = {});
  bool run_round();
  void collect_round();
  [[nodiscard]] RoundState state();
  /// What is still being computed is done now, as time does not go on; false if there is none.
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
  /// Waits until something came from outside since `seen`; false if nothing has to be waited for.
  [[nodiscard]] bool wait_for_change(std::uint64_t seen, bool may_end);
  /// As `run_until`, when no round is left: moves to the next moment that the peers agreed on.
  /// Returns true if the run has ended, by `end`.
  [[nodiscard]] bool advance_together(std::uint64_t seen, End& end);
  /// Waits until the pace lets time go to `next`; false if something came from outside since
  /// `seen`.
  [[nodiscard]] bool wait_for_pace(std::uint64_t seen, Time next);

  base::Clock& clock_;
  std::uint32_t step_ = 0;
  std::uint32_t steps_end_ = std::numeric_limits<std::uint32_t>::max();
  Feed* feed_ = nullptr;
  Pace* pace_ = nullptr;
  RoundPeers* peers_ = nullptr;
  RoundState all_;  ///< With peers: what all know together.
  const Actor* watcher_ = nullptr;
  std::vector<Actor*> actors_;
  ActivationRings rings_;

  std::vector<std::atomic<std::uint64_t>> ready_;
  /// By component: when what it computes is done, if that takes time; else `kNever`.
  std::vector<std::int64_t> computing_until_ns_;
  std::atomic<bool> is_interrupted_{false};
  std::atomic<int> foreign_threads_{0};

  // What other threads bring, and what wakes an idle simulation.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<External> external_;
  std::vector<std::function<void()>> actions_;
  int holds_ = 0;
  std::uint64_t changes_ = 0;

  std::mutex job_mutex_;
  std::vector<std::function<void()>> jobs_;

  // One round. While helpers serve it, the running thread changes nothing of it.
  std::vector<Turn> round_;
  std::vector<std::int64_t> expected_ns_;  ///< By component: what its last turns cost.
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
