#include "executor/executor.h"

#include <array>
#include <bit>
#include <span>
#include <utility>

#include <sched.h>

#include "base/prefetch.h"
#include "executor/activation.h"
#include "fastcycle/assert.h"

namespace fastcycle::detail {
namespace {

constexpr std::int64_t kSpinNs = 50'000;
/// Of more components the lanes are not looked at one after the other: the mask is quicker.
constexpr std::size_t kEarlyActors = 8;

/// Which executor the calling thread works for; null for all other threads.
thread_local const Executor* t_executor = nullptr;

void pause_briefly() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

}  // namespace

Executor::Executor(ExecutorOptions options) : options_(std::move(options)) {
  FASTCYCLE_ASSERT(options_.threads > 0 && options_.threads <= base::Sleepers::kMaxWorkers,
                   "an executor has 1 to 64 workers");
}

Executor::~Executor() {
  stop();
}

void Executor::add(Actor& actor) {
  actor.inbox.attach(*this, static_cast<std::uint32_t>(actors_.size()),
                     options_.threads == 1 && options_.wait == WaitMode::kSpin);
  actor.timer_watch = this;
  actors_.push_back(&actor);
  ready_ = std::vector<std::atomic<std::uint64_t>>((actors_.size() + 63) / 64);
}

void Executor::start(std::vector<base::Refusal>& refusals) {
  if (options_.threads == 1) {
    leader_.store(0);
  }
  rings_.make(options_.threads);
  for (unsigned worker = 0; worker < options_.threads; ++worker) {
    const std::string suffix = options_.threads == 1 ? "" : "-" + std::to_string(worker);
    threads_.emplace_back(
        base::ThreadOptions{options_.name + suffix, options_.cpus, options_.policy,
                            options_.priority, options_.slice_us},
        [this, worker] { work(worker); }, refusals);
  }
}

void Executor::stop() {
  is_stopping_.store(true);
  for (unsigned worker = 0; worker < threads_.size(); ++worker) {
    sleepers_.wake(worker);
  }
  for (base::Thread& thread : threads_) {
    thread.join();
  }
  threads_.clear();
}

bool Executor::submit(std::function<void()> job) {
  {
    const std::lock_guard lock(job_mutex_);
    if (jobs_.size() >= kMaxJobs) {
      return false;
    }
    jobs_.push_back(std::move(job));
    job_count_.fetch_add(1, std::memory_order_seq_cst);
  }
  sleepers_.wake_one();
  return true;
}

void Executor::enqueue(std::uint32_t index) noexcept {
  ready_[index / 64].fetch_or(std::uint64_t{1} << (index % 64), std::memory_order_seq_cst);
}

void Executor::wake() noexcept {
  if (options_.hand_over && t_executor == this) {
    return;
  }
  sleepers_.wake_one();
}

void Executor::prepare(std::uint32_t index) noexcept {
  if (options_.wait == WaitMode::kPark) {  // A spinning worker would only ask for the line back.
    base::prefetch_for_writing(&ready_[index / 64]);
  }
  sleepers_.prepare_wake();
}

void Executor::timer_armed(std::int64_t due_ns) noexcept {
  std::int64_t earliest = earliest_due_ns_.load(std::memory_order_seq_cst);
  while (due_ns < earliest &&
         !earliest_due_ns_.compare_exchange_weak(earliest, due_ns, std::memory_order_seq_cst)) {
  }
  const std::int64_t watched_ns = leader_deadline_ns_.load(std::memory_order_seq_cst);
  if (watched_ns == kNobodyLeads) {
    // A worker that sleeps now began while another led: it must watch, since this worker may be
    // busy for long.
    sleepers_.wake_one();
  } else if (watched_ns > due_ns) {
    const unsigned leader = leader_.load(std::memory_order_seq_cst);
    if (leader < base::Sleepers::kMaxWorkers) {
      sleepers_.wake(leader);
    }
  }
}

bool Executor::has_ready() const noexcept {
  for (const auto& word : ready_) {
    if (word.load(std::memory_order_seq_cst) != 0) {
      return true;
    }
  }
  return false;
}

bool Executor::has_work() const noexcept {
  return has_ready() || job_count_.load(std::memory_order_seq_cst) != 0 || is_stopping_.load();
}

bool Executor::is_quiet() const noexcept {
  for (const Actor* actor : actors_) {
    if (!actor->is_quiet() && actor->is_open()) {
      return false;
    }
  }
  return job_count_.load() == 0 && busy_jobs_.load() == 0 &&
         (foreign_ == nullptr || !foreign_->has_any());
}

void Executor::work(unsigned worker) {
  const ServingThread serving;
  t_executor = this;
  if (foreign_ != nullptr) {
    foreign_->begin_worker(worker);
  }
  while (!is_stopping_.load(std::memory_order_relaxed)) {
    // Jobs and timers have their turn also where components are always ready.
    bool is_busy = run_ready(worker);
    is_busy |= run_job();
    is_busy |= fire_timers();
    if (foreign_ != nullptr) [[unlikely]] {
      is_busy |= foreign_->take();
    }
    if (!is_busy) {
      idle(worker);
    }
  }
  if (foreign_ != nullptr) {
    foreign_->end_worker(worker);
  }
}

bool Executor::run_ready(unsigned worker) {
  bool has_run = false;
  for (std::size_t i = 0; i < ready_.size(); ++i) {
    // Each worker begins somewhere else, so that they do not all fight for the first component.
    const std::size_t place = ready_.size() == 1 ? 0 : (i + worker) % ready_.size();
    auto& word = ready_[place];
    const std::size_t base = place * 64;
    std::uint64_t bits = word.load(std::memory_order_seq_cst);
    // One pass over the components ready at its begin: none waits longer than one turn of each
    // other.
    while (bits != 0) {
      const auto bit = static_cast<unsigned>(std::countr_zero(bits));
      const std::uint64_t flag = std::uint64_t{1} << bit;
      bits &= ~flag;
      if (options_.threads == 1) {  // Else another worker may be changing its lanes.
        actors_[base + bit]->inbox.prepare_serve();
      }
      if ((word.fetch_and(~flag, std::memory_order_seq_cst) & flag) == 0) {
        continue;
      }
      if (options_.threads > 1 && has_ready()) {
        sleepers_.wake_one();
      }
      actors_[base + bit]->run_turn(rings_[worker]);
      has_run = true;
      fire_timers();
    }
  }
  return has_run;
}

bool Executor::run_job() {
  if (job_count_.load(std::memory_order_seq_cst) == 0) {
    return false;
  }
  std::function<void()> job;
  {
    const std::lock_guard lock(job_mutex_);
    if (jobs_.empty()) {
      return false;
    }
    job = std::move(jobs_.front());
    jobs_.pop_front();
    busy_jobs_.fetch_add(1);
    job_count_.fetch_sub(1, std::memory_order_seq_cst);
  }
  job();
  busy_jobs_.fetch_sub(1);
  return true;
}

bool Executor::fire_timers() noexcept {
  const std::int64_t earliest = earliest_due_ns_.load(std::memory_order_seq_cst);
  if (earliest == base::kNever) {
    return false;
  }
  const std::int64_t now_ns = base::monotonic_ns();
  if (earliest > now_ns) {
    return false;
  }
  earliest_due_ns_.store(base::kNever, std::memory_order_seq_cst);
  bool has_fired = false;
  std::int64_t next_ns = base::kNever;
  for (Actor* actor : actors_) {
    const std::int64_t due_ns = actor->armed_due_ns();
    if (due_ns > now_ns) {
      next_ns = std::min(next_ns, due_ns);
    } else if (actor->take_due(due_ns)) {
      actor->inbox.mark(Inbox::kTimerBit);
      has_fired = true;
    }
  }
  if (next_ns != base::kNever) {
    timer_armed(next_ns);
  }
  return has_fired;
}

std::int64_t Executor::lead(unsigned worker) noexcept {
  unsigned nobody = base::Sleepers::kMaxWorkers;
  if (!leader_.compare_exchange_strong(nobody, worker, std::memory_order_seq_cst)) {
    return base::kNever;
  }
  sleepers_.set_leader(worker);
  return announce_deadline();
}

std::int64_t Executor::announce_deadline() noexcept {
  std::int64_t deadline_ns = earliest_due_ns_.load(std::memory_order_seq_cst);
  for (;;) {
    leader_deadline_ns_.store(deadline_ns, std::memory_order_seq_cst);
    // A timer armed before this store is seen here; one armed after it wakes the leader.
    const std::int64_t again_ns = earliest_due_ns_.load(std::memory_order_seq_cst);
    if (again_ns >= deadline_ns) {
      return deadline_ns;
    }
    deadline_ns = again_ns;
  }
}

void Executor::stop_leading(unsigned worker) noexcept {
  if (leader_.load(std::memory_order_seq_cst) != worker) {
    return;
  }
  leader_deadline_ns_.store(kNobodyLeads, std::memory_order_seq_cst);
  sleepers_.set_leader(base::Sleepers::kMaxWorkers);
  leader_.store(base::Sleepers::kMaxWorkers, std::memory_order_seq_cst);
}

bool Executor::run_early(std::int64_t now_ns) {
  for (Actor* actor : actors_) {
    if (actor->run_early(rings_[0], now_ns)) {
      return true;
    }
  }
  return false;
}

bool Executor::spin_for_work(std::int64_t limit_ns) {
  // A single worker with few components serves a message before its publisher has marked it.
  const bool looks_early = options_.threads == 1 && actors_.size() <= kEarlyActors;
  const std::int64_t begin_ns = base::monotonic_ns();
  for (;;) {
    std::int64_t now_ns = begin_ns;
    for (int i = 0; i < 16; ++i) {
      now_ns = base::monotonic_ns();
      if ((looks_early && run_early(now_ns)) || has_work() ||
          (foreign_ != nullptr && foreign_->has_any())) {
        return true;
      }
      pause_briefly();
    }
    if (options_.wait == WaitMode::kAdaptive) {
      sched_yield();  // The next publisher may be waiting for this CPU.
    }
    if (now_ns >= earliest_due_ns_.load(std::memory_order_relaxed)) {
      return true;
    }
    if (now_ns - begin_ns > limit_ns) {
      return false;
    }
  }
}

/// Sleeps, unless there is work by now. @pre It was announced.
void Executor::sleep(unsigned worker, std::int64_t deadline_ns) {
  if (has_work()) {
    sleepers_.withdraw(worker);
  } else {
    sleepers_.sleep(worker, deadline_ns);
  }
}

/// The same, where messages of other processes are work too.
void Executor::sleep_with_foreign(unsigned worker, std::int64_t deadline_ns) {
  std::array<base::WatchedWord, base::Sleepers::kMaxWatched> words;
  const std::size_t count = foreign_->announce(words);
  if (has_work() || foreign_->has_any()) {
    sleepers_.withdraw(worker);
  } else {
    sleepers_.sleep(worker, deadline_ns, std::span(words).first(count));
  }
  foreign_->withdraw();
}

void Executor::idle(unsigned worker) {
  if (options_.wait != WaitMode::kPark &&
      spin_for_work(options_.wait == WaitMode::kSpin ? base::kNever - 1 : kSpinNs)) {
    return;
  }
  sleepers_.announce(worker);
  // A single worker always leads: a stale deadline only costs a thread that arms an earlier timer a
  // check whether it sleeps.
  const bool is_alone = options_.threads == 1;
  const std::int64_t deadline_ns = is_alone ? announce_deadline() : lead(worker);
  if (foreign_ != nullptr) [[unlikely]] {
    sleep_with_foreign(worker, deadline_ns);
  } else {
    sleep(worker, deadline_ns);
  }
  if (is_alone) {
    return;
  }
  const bool has_led = leader_.load(std::memory_order_seq_cst) == worker;
  stop_leading(worker);
  // If another worker sleeps, it must watch the timers while this one is busy.
  if (has_led && earliest_due_ns_.load(std::memory_order_seq_cst) != base::kNever) {
    sleepers_.wake_one();
  }
}

}  // namespace fastcycle::detail
