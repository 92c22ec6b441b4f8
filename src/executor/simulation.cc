#include "executor/simulation.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <utility>

#include "executor/activation.h"

namespace fastcycle::detail {

Simulation::Simulation(base::Clock& clock, unsigned workers) : clock_(clock), rings_(workers) {
  for (unsigned worker = 1; worker < workers; ++worker) {
    helpers_.emplace_back([this, worker](const std::stop_token& stop) { help(worker, stop); });
  }
}

Simulation::~Simulation() {
  for (std::jthread& helper : helpers_) {
    helper.request_stop();
  }
}

void Simulation::add(Actor& actor) {
  actor.inbox.attach(*this, static_cast<std::uint32_t>(actors_.size()));
  actor.timer_watch = this;
  actors_.push_back(&actor);
  ready_ = std::vector<std::atomic<std::uint64_t>>((actors_.size() + 63) / 64);
  expected_ns_.push_back(0);
  computing_until_ns_.push_back(base::kNever);
}

void Simulation::enqueue(std::uint32_t index) noexcept {
  ready_[index / 64].fetch_or(std::uint64_t{1} << (index % 64), std::memory_order_seq_cst);
  // External work while the simulation waits must wake it.
  if (foreign_threads_.load(std::memory_order_relaxed) != 0) {
    const std::lock_guard lock(mutex_);
    ++changes_;
    changed_.notify_all();
  }
}

void Simulation::timer_armed(std::int64_t) noexcept {}

void Simulation::put(PublisherCore& publisher, Envelope* envelope) {
  const std::lock_guard lock(mutex_);
  external_.push_back({&publisher, envelope});
  ++changes_;
  changed_.notify_all();
}

void Simulation::hold() noexcept {
  const std::lock_guard lock(mutex_);
  ++holds_;
}

void Simulation::let_go() noexcept {
  const std::lock_guard lock(mutex_);
  --holds_;
  ++changes_;
  changed_.notify_all();
}

void Simulation::foreign_thread_ends() noexcept {
  const std::lock_guard lock(mutex_);
  foreign_threads_.fetch_sub(1);
  ++changes_;
  changed_.notify_all();
}

void Simulation::interrupt() noexcept {
  const std::lock_guard lock(mutex_);
  is_interrupted_.store(true);
  ++changes_;
  changed_.notify_all();
}

bool Simulation::submit(std::function<void()> job) {
  const std::lock_guard lock(job_mutex_);
  jobs_.push_back(std::move(job));
  return true;
}

void Simulation::call(std::function<void()> action) {
  const std::lock_guard lock(mutex_);
  actions_.push_back(std::move(action));
  ++changes_;
  changed_.notify_all();
}

void Simulation::take_external() {
  std::vector<External> external;
  std::vector<std::function<void()>> actions;
  {
    const std::lock_guard lock(mutex_);
    external.swap(external_);
    actions.swap(actions_);
  }
  for (const auto& action : actions) {
    action();
  }
  // The order in which foreign threads published is theirs; per publisher it is that of its
  // sequence.
  std::sort(external.begin(), external.end(), [](const External& a, const External& b) {
    return a.publisher->id != b.publisher->id
               ? a.publisher->id < b.publisher->id
               : a.envelope->info.sequence < b.envelope->info.sequence;
  });
  for (const External& entry : external) {
    const std::lock_guard lock(entry.publisher->mutex());
    entry.publisher->deliver(entry.envelope);
  }
}

bool Simulation::has_fed_at(std::int64_t time_ns) const noexcept {
  return feed_ != nullptr && feed_->next_due_ns() <= time_ns && feed_->next_step() < steps_end_;
}

/// Takes the input of the next round. If there is nothing else to do, that is the round in which
/// the next input is due.
bool Simulation::take_fed() {
  const Time now = clock_.now();
  const bool is_fed_here = has_fed_at(base::to_ns(now));
  const std::uint32_t step = peers_ != nullptr ? all_.fed_step
                             : is_fed_here     ? feed_->next_step()
                                               : RoundState::kNoStep;
  if (step == RoundState::kNoStep) {
    return false;
  }
  if (step > step_) {
    if (peers_ != nullptr ? all_.is_ready : is_anyone_ready()) {
      return false;
    }
    step_ = step;
  }
  if (is_fed_here && feed_->next_step() <= step_) {
    feed_->put(now, step_);
  }
  return true;
}

RoundState Simulation::state() {
  const std::int64_t now_ns = base::to_ns(clock_.now());
  RoundState state;
  state.is_ready = is_anyone_ready();
  state.is_computing = is_anyone_computing();
  state.has_threads = foreign_threads_.load() != 0;
  state.fed_step = has_fed_at(now_ns) ? feed_->next_step() : RoundState::kNoStep;
  state.next_due_ns = next_due_ns();
  state.next_unwatched_ns = next_due_ns(watcher_);
  const std::lock_guard lock(mutex_);
  state.is_held = holds_ != 0;
  return state;
}

void Simulation::begin_round(std::optional<Time> limit) {
  take_external();
  if (peers_ == nullptr) {
    return;
  }
  RoundState own = state();
  own.is_advancing = limit.has_value();
  own.limit_ns = limit ? base::to_ns(*limit) : base::kNever;
  own.step = step_;
  all_ = peers_->agree(own);
  step_ = std::max(step_, all_.step);
}

bool Simulation::is_anyone_ready() const noexcept {
  const std::int64_t now_ns = base::to_ns(clock_.now());
  for (std::size_t i = 0; i < actors_.size(); ++i) {
    const std::uint64_t flag = std::uint64_t{1} << (i % 64);
    const bool is_ready = (ready_[i / 64].load(std::memory_order_seq_cst) & flag) != 0;
    const bool is_due = actors_[i]->is_ticking() && actors_[i]->armed_due_ns() <= now_ns;
    if (is_computing(i) ? computing_until_ns_[i] <= now_ns : is_ready || is_due) {
      return true;
    }
  }
  return false;
}

void Simulation::begin_steps(std::uint32_t first, std::uint32_t end) noexcept {
  step_ = std::max(step_, first);
  steps_end_ = end;
}

void Simulation::collect_round() {
  round_.clear();
  const std::int64_t now_ns = base::to_ns(clock_.now());
  for (std::size_t i = 0; i < actors_.size(); ++i) {
    if (is_computing(i)) {
      if (computing_until_ns_[i] <= now_ns) {
        round_.push_back({.actor = actors_[i], .index = i, .is_served = true});
      }
      continue;
    }
    const std::uint64_t flag = std::uint64_t{1} << (i % 64);
    auto& word = ready_[i / 64];
    const bool is_ready = (word.load(std::memory_order_seq_cst) & flag) != 0 &&
                          (word.fetch_and(~flag, std::memory_order_seq_cst) & flag) != 0;
    if (is_ready || (actors_[i]->is_ticking() && actors_[i]->armed_due_ns() <= now_ns)) {
      round_.push_back({actors_[i], i});
    }
  }
}

/// After `begin_round`; false if there is nothing to do in any process.
bool Simulation::run_round() {
  const bool is_fed = take_fed();
  collect_round();
  if (!is_fed && (peers_ != nullptr ? !all_.is_ready : round_.empty())) {
    return false;
  }
  for (const std::uint32_t first : std::exchange(first_, {})) {
    const auto turn = std::ranges::find(round_, std::size_t{first}, &Turn::index);
    if (turn != round_.end()) {
      serve(*turn, 0);
      turn->is_served = true;
    }
  }
  if (is_worth_helpers()) {
    serve_in_parallel();
  } else {
    for (const Turn& turn : round_) {
      serve(turn, 0);
    }
  }
  for (const Turn& turn : round_) {
    const Duration cost = turn.actor->simulated_cost();
    std::int64_t& until_ns = computing_until_ns_[turn.index];
    if (until_ns == base::kNever && cost > Duration(0) && turn.actor->has_staged()) {
      until_ns = base::to_ns(clock_.now() + cost);
    } else {
      until_ns = base::kNever;
      turn.actor->hand_over_stage();
    }
  }
  run_jobs();
  if (peers_ != nullptr) {
    peers_->exchange();
  }
  const std::uint32_t step = step_++;
  if (after_round) {
    after_round(step);
  }
  return true;
}

void Simulation::serve(const Turn& turn, unsigned worker) {
  if (turn.is_served) {
    return;
  }
  const std::int64_t begin_ns = base::monotonic_ns();
  turn.actor->run_round(rings_[worker]);
  const std::int64_t cost_ns = base::monotonic_ns() - begin_ns;
  std::int64_t& expected_ns = expected_ns_[turn.index];
  expected_ns += (cost_ns - expected_ns) / 8;
}

bool Simulation::is_worth_helpers() const noexcept {
  // Waking helpers costs some 30 µs: less than that is faster done alone. The result is the same.
  constexpr std::int64_t kWorthNs = 50'000;
  if (helpers_.empty() || round_.size() < 2) {
    return false;
  }
  std::int64_t sum_ns = 0;
  std::int64_t longest_ns = 0;
  for (const Turn& turn : round_) {
    sum_ns += expected_ns_[turn.index];
    longest_ns = std::max(longest_ns, expected_ns_[turn.index]);
  }
  return sum_ns - longest_ns > kWorthNs;
}

void Simulation::serve_in_parallel() {
  next_in_round_.store(0, std::memory_order_relaxed);
  {
    const std::lock_guard lock(round_mutex_);
    ++round_number_;
    helpers_at_work_ = helpers_.size();
  }
  round_begins_.notify_all();
  serve_shared(0);
  std::unique_lock lock(round_mutex_);
  round_ends_.wait(lock, [this] { return helpers_at_work_ == 0; });
}

void Simulation::serve_shared(unsigned worker) {
  for (;;) {
    const std::size_t i = next_in_round_.fetch_add(1, std::memory_order_relaxed);
    if (i >= round_.size()) {
      return;
    }
    serve(round_[i], worker);
  }
}

void Simulation::help(unsigned worker, const std::stop_token& stop) {
  const ServingThread serving;
  std::uint64_t seen = 0;
  std::unique_lock lock(round_mutex_);
  while (round_begins_.wait(lock, stop, [&] { return round_number_ != seen; })) {
    seen = round_number_;
    lock.unlock();
    serve_shared(worker);
    lock.lock();
    if (--helpers_at_work_ == 0) {
      round_ends_.notify_one();
    }
  }
}

void Simulation::run_jobs() {
  std::vector<std::function<void()>> jobs;
  {
    const std::lock_guard lock(job_mutex_);
    jobs.swap(jobs_);
  }
  for (const auto& job : jobs) {
    job();
  }
}

void Simulation::run_now() {
  for (std::uint64_t rounds = 0; rounds < kMaxRoundsAtOnce; ++rounds) {
    begin_round();
    if (run_round()) {
      continue;
    }
    const bool has_ended = end_computing();
    if (peers_ != nullptr ? !all_.is_computing : !has_ended) {
      return;
    }
  }
}

bool Simulation::is_anyone_computing() const noexcept {
  return std::ranges::any_of(computing_until_ns_,
                             [](std::int64_t until_ns) { return until_ns != base::kNever; });
}

bool Simulation::end_computing() noexcept {
  bool has_ended = false;
  for (std::int64_t& until_ns : computing_until_ns_) {
    if (until_ns != base::kNever) {
      until_ns = std::min(until_ns, base::to_ns(clock_.now()));
      has_ended = true;
    }
  }
  return has_ended;
}

std::int64_t Simulation::next_due_ns(const Actor* without) const noexcept {
  std::int64_t next_ns = base::kNever;
  if (feed_ != nullptr) {
    const std::int64_t fed_ns = feed_->next_due_ns();
    // Input of a later part of this instant does not advance time.
    next_ns = fed_ns > base::to_ns(clock_.now()) || has_fed_at(fed_ns) ? fed_ns : base::kNever;
  }
  for (std::size_t i = 0; i < actors_.size(); ++i) {
    if (is_computing(i)) {
      next_ns = std::min(next_ns, computing_until_ns_[i]);
    } else if (actors_[i]->is_ticking() && actors_[i] != without) {
      next_ns = std::min(next_ns, actors_[i]->armed_due_ns());
    }
  }
  return next_ns;
}

std::uint64_t Simulation::changes() {
  const std::lock_guard lock(mutex_);
  return changes_;
}

bool Simulation::wait_for_change(std::uint64_t seen, bool may_end) {
  std::unique_lock lock(mutex_);
  if (holds_ == 0 && may_end && changes_ == seen) {
    return false;
  }
  changed_.wait(lock, [&] { return changes_ != seen || is_interrupted_.load(); });
  return true;
}

void Simulation::look_again() noexcept {
  const std::lock_guard lock(mutex_);
  ++changes_;
  changed_.notify_all();
}

bool Simulation::wait_for_pace(std::uint64_t seen, Time next) {
  const std::int64_t at_ns = pace_->may_go_at(next);
  std::unique_lock lock(mutex_);
  const auto is_changed = [&] { return changes_ != seen || is_interrupted_.load(); };
  if (at_ns == base::kNever) {
    changed_.wait(lock, is_changed);
    return false;
  }
  const std::chrono::steady_clock::time_point at{std::chrono::nanoseconds(at_ns)};
  if (changed_.wait_until(lock, at, is_changed)) {
    return false;
  }
  pace_->goes(next, has_fed_at(base::to_ns(next)));
  return true;
}

void Simulation::advance(Time time) noexcept {
  if (time > clock_.now()) {
    clock_.set_simulated(time);
    step_ = 0;
  }
}

bool Simulation::advance_together(std::uint64_t seen, End& end) {
  if (!all_.is_advancing) {
    return false;  // Another one serves the present time only, and has not come as far as this one.
  }
  const Time limit = base::from_ns(all_.limit_ns);
  const bool is_idle = limit == Time::max() && all_.next_unwatched_ns == base::kNever;
  if (all_.is_held || (is_idle && all_.has_threads)) {
    // All check periodically: only one of them may be notified of a change.
    constexpr std::chrono::milliseconds kLook{1};
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kLook, [&] { return changes_ != seen; });
    return false;
  }
  if (is_idle) {
    end = End::kIdle;
    return true;
  }
  const Time next = std::min(base::from_ns(all_.next_due_ns), limit);
  while (pace_ != nullptr && !wait_for_pace(seen, next) && !is_interrupted_.load()) {
    seen = changes();
  }
  advance(next);
  end = End::kReached;
  return all_.next_due_ns > base::to_ns(limit);
}

Simulation::End Simulation::run_until(Time limit, bool may_end) {
  std::uint64_t rounds_at_once = 0;
  for (;;) {
    if (!may_end) {
      clear_interrupt();
    } else if (peers_ == nullptr && is_interrupted_.load()) {
      return End::kInterrupted;
    }
    // External input after this is seen as a change, and causes another pass.
    const std::uint64_t seen = changes();
    begin_round(limit);
    if (may_end && peers_ != nullptr && all_.is_to_end) {
      return End::kInterrupted;
    }
    if (run_round()) {
      if (++rounds_at_once > kMaxRoundsAtOnce) {
        return End::kStuck;
      }
      continue;
    }
    rounds_at_once = 0;
    if (peers_ != nullptr) {
      End end{};
      if (advance_together(seen, end)) {
        return end;
      }
      continue;
    }
    const std::int64_t next_ns = next_due_ns();
    const bool is_idle = limit == Time::max() && next_due_ns(watcher_) == base::kNever;
    // Threads that hold no time do not keep it from reaching the limit.
    const bool waits_for_threads = is_idle && foreign_threads_.load() != 0;
    if (wait_for_change(seen, !waits_for_threads)) {
      continue;
    }
    if (is_idle) {
      return End::kIdle;
    }
    const Time next = std::min(base::from_ns(next_ns), limit);
    if (pace_ != nullptr && !wait_for_pace(seen, next)) {
      continue;
    }
    advance(next);
    if (next_ns > base::to_ns(limit)) {
      return End::kReached;
    }
  }
}

}  // namespace fastcycle::detail
