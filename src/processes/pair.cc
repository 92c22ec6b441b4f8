#include "processes/pair.h"

#include <climits>
#include <utility>

#include <linux/futex.h>
#include <pthread.h>

namespace fastcycle::processes {

using segment::ProcessIndex;
using segment::StandbyWords;

namespace {

std::atomic<std::uint32_t>& lock_word(segment::WorkerLife& life) noexcept {
  return reinterpret_cast<std::atomic<std::uint32_t>&>(life.mutex.__data.__lock);
}

std::uint32_t epoch_of(const segment::Wire& wire, ProcessIndex process) noexcept {
  const std::uint32_t incarnation = wire.incarnation(process).load(std::memory_order_acquire);
  return incarnation == 0
             ? 0
             : wire.standby(process, incarnation).epoch.load(std::memory_order_acquire);
}

}  // namespace

ProcessIndex Pair::active_of(const segment::Wire& wire, ProcessIndex process, ProcessIndex twin) {
  const ProcessIndex first = std::min(process, twin);
  const ProcessIndex second = std::max(process, twin);
  return epoch_of(wire, second) > epoch_of(wire, first) ? second : first;
}

Pair::Pair(const ProcessPlan& plan, const segment::Wire& wire, ProcessIndex process,
           std::uint32_t incarnation)
    : wire_(wire),
      process_(process),
      incarnation_(incarnation),
      other_(*plan.other_of(process)),
      workers_(plan.wire().workers[other_]),
      is_shadow_(plan.shadow_in(process) != nullptr),
      words_(wire.standby(process, incarnation)),
      activity_(plan, wire, other_) {
  const std::uint32_t said = wire.begins_on_standby(process).load(std::memory_order_acquire);
  begins_on_standby_ = (said & segment::kFollows) != 0;
  other_incarnation_ = std::max<std::uint32_t>(1, said & ~segment::kFollows);
  for (unsigned worker = 0; worker < plan.wire().workers[process]; ++worker) {
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setpshared(&attributes, PTHREAD_PROCESS_SHARED);
    pthread_mutexattr_setrobust(&attributes, PTHREAD_MUTEX_ROBUST);
    pthread_mutex_init(&wire.life(process, incarnation, worker).mutex, &attributes);
    pthread_mutexattr_destroy(&attributes);
  }
}

Pair::~Pair() = default;

void Pair::begin(host::ApplicationHost& application,
                 const std::vector<detail::ComponentCore*>& components,
                 std::vector<segment::LinkSet*> links, standby::Follower::Listener listener) {
  links_ = std::move(links);
  if (!begins_on_standby_) {
    words_.epoch.store(other_words().epoch.load() + 1, std::memory_order_release);
    return;
  }
  const bool is_late = incarnation_ > 1 || other_incarnation_ > 1;
  if (!is_late) {  // It has everything from the first activation on.
    words_.is_in_step.store(1, std::memory_order_release);
  }
  auto in_step = std::move(listener.in_step);
  listener.in_step = [this, in_step = std::move(in_step)] {
    words_.is_in_step.store(1, std::memory_order_release);
    in_step();
  };
  auto lost = std::move(listener.lost);
  listener.lost = [this, lost = std::move(lost)](const std::string& why) {
    words_.is_in_step.store(0, std::memory_order_release);
    lost(why);
  };
  follower_ = std::make_unique<standby::Follower>(
      application, *this, components,
      standby::Follower::Options{.is_late = is_late, .takes_over = !is_shadow_},
      std::move(listener));
}

void Pair::end() {
  words_.is_ending.store(1, std::memory_order_seq_cst);
  if (follower_ != nullptr) {
    follower_->end();
  }
}

void Pair::begin_worker(unsigned worker) noexcept {
  segment::WorkerLife& life = wire_.life(process_, incarnation_, worker);
  pthread_mutex_lock(&life.mutex);
  lock_word(life).fetch_or(FUTEX_WAITERS);  // So that the kernel wakes threads that sleep on it.
}

void Pair::end_worker(unsigned worker) noexcept {
  pthread_mutex_unlock(&wire_.life(process_, incarnation_, worker).mutex);
}

const std::atomic<std::uint32_t>& Pair::life_of_other(unsigned worker) const noexcept {
  return lock_word(wire_.life(other_, other_incarnation_, worker));
}

std::size_t Pair::announce(std::span<base::WatchedWord> words) noexcept {
  if (follower_ == nullptr) {
    return 0;
  }
  words_.sleepers.fetch_add(1, std::memory_order_seq_cst);
  std::size_t count = 0;
  const auto watch = [&](const std::atomic<std::uint32_t>& word) {
    if (count < words.size()) {
      words[count++] = {.word = &word, .seen = word.load(std::memory_order_seq_cst)};
    }
  };
  watch(other_words().progress);
  for (unsigned worker = 0; worker < workers_ && !is_shadow_; ++worker) {
    watch(life_of_other(worker));
  }
  return count;
}

void Pair::withdraw() noexcept {
  if (follower_ != nullptr) {
    words_.sleepers.fetch_sub(1, std::memory_order_seq_cst);
  }
}

bool Pair::has_ended() const noexcept {
  if (other_words().is_ending.load(std::memory_order_seq_cst) != 0) {
    return false;
  }
  if (wire_.incarnation(other_).load(std::memory_order_seq_cst) != other_incarnation_) {
    return true;  // The supervisor changed it: both were announced before this one started.
  }
  for (unsigned worker = 0; worker < workers_; ++worker) {
    if (is_shadow_ ||
        (life_of_other(worker).load(std::memory_order_seq_cst) & FUTEX_OWNER_DIED) == 0) {
      return false;
    }
  }
  return true;
}

std::optional<std::uint32_t> Pair::crashed_in() const noexcept {
  const std::uint32_t said = other_words().crashed.load(std::memory_order_acquire);
  return said == 0 ? std::nullopt : std::optional(said - 1);
}

void Pair::take_rest() {
  for (segment::LinkSet* links : links_) {
    static_cast<void>(links->take());
  }
}

void Pair::take_place() {
  words_.epoch.store(other_words().epoch.load() + 1, std::memory_order_seq_cst);
}

void FollowerBell::ring() noexcept {
  words_.progress.fetch_add(1, std::memory_order_seq_cst);
  bool is_anyone_asleep = false;
  for (const ProcessIndex follower : followers_) {
    const std::uint32_t now = wire_.incarnation(follower).load(std::memory_order_seq_cst);
    is_anyone_asleep =
        is_anyone_asleep ||
        (now != 0 && wire_.standby(follower, now).sleepers.load(std::memory_order_seq_cst) != 0);
  }
  if (is_anyone_asleep) {
    segment::wake(words_.progress, INT_MAX);
  }
}

}  // namespace fastcycle::processes
