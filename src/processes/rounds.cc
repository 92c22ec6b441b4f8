#include "processes/rounds.h"

#include <algorithm>
#include <chrono>
#include <climits>
#include <ctime>
#include <thread>

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace fastcycle::processes {

using detail::RoundState;
using host::EndReason;
using host::Peers;
using segment::ProcessIndex;
using segment::RoundWords;

namespace {

// Facts that a process publishes.
enum Fact : std::size_t {
  kFlags,
  kSteps,  ///< Round with recorded input << 32 | index in the round.
  kNextDue,
  kNextUnwatched,
  kEndReason,
  kNow,
  kLimit,
  // After a round, instead of others.
  kSent = kSteps,
  kIncarnation = kNextDue
};
constexpr std::uint64_t kReady = 1;
constexpr std::uint64_t kComputing = 2;
constexpr std::uint64_t kHeld = 4;
constexpr std::uint64_t kThreads = 8;
constexpr std::uint64_t kSources = 16;
constexpr std::uint64_t kSourcesOver = 32;
constexpr std::uint64_t kNotAdvancing = 64;
constexpr std::uint64_t kExchange = 128;  ///< It handed over the messages of a round.
constexpr std::uint64_t kBusy = 256;      ///< With what all processes do together.
constexpr std::uint64_t kFirst = 512;     ///< It is the first such point of the round.

std::uint64_t flags_of(const RoundState& state) {
  return (state.is_ready ? kReady : 0) | (state.is_computing ? kComputing : 0) |
         (state.is_held ? kHeld : 0) | (state.has_threads ? kThreads : 0) |
         (state.is_advancing ? 0 : kNotAdvancing);
}

void sleep_on(const std::atomic<std::uint32_t>& word, std::uint32_t seen) {
  // Wakes up now and then to check whether the awaited process has ended.
  constexpr timespec kLookAgain{.tv_sec = 0, .tv_nsec = 20'000'000};
  syscall(SYS_futex, &word, FUTEX_WAIT, seen, &kLookAgain, nullptr, 0);
}

void pause_a_little() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#endif
}

bool has_come(const RoundWords& words, std::uint32_t count) {
  return static_cast<std::int32_t>(words.count.load(std::memory_order_seq_cst) - count) >= 0;
}

}  // namespace

Rounds::Rounds(const segment::Wire& wire, ProcessIndex process, std::uint32_t incarnation,
               segment::LinkSet& links, NoticeOrder& notices, host::Application& application)
    : wire_(wire),
      process_(process),
      incarnation_(incarnation),
      links_(links),
      notices_(notices),
      application_(application),
      own_(wire.rounds(process, incarnation)),
      has_sources_(std::ranges::any_of(application.components(), [](const auto& component) {
        return component->is_source.load();
      })) {
  known_.resize(wire.plan().processes, 1);
  if (incarnation == 1) {
    return;
  }
  // Continues after the last point it reached before it ended. Repeats its facts of that point and
  // the one before: others that have not reached them yet may find this incarnation.
  for (std::uint32_t earlier = 1;
       earlier < segment::Segments::kGenerations && earlier < incarnation; ++earlier) {
    const RoundWords& words = wire.rounds(process, incarnation - earlier);
    if (words.count.load() <= count_) {
      continue;
    }
    count_ = words.count.load();
    for (std::size_t point = 0; point < 2; ++point) {
      for (std::size_t i = 0; i < RoundWords::kFacts; ++i) {
        own_.facts[point][i].store(words.facts[point][i].load());
      }
    }
  }
  is_joining_ = true;
  own_.is_joining.store(1, std::memory_order_seq_cst);
  own_.count.store(count_, std::memory_order_seq_cst);
}

/// Reaches the next point.
void Rounds::publish(const Facts& facts) {
  ++count_;
  for (std::size_t i = 0; i < RoundWords::kFacts; ++i) {
    own_.facts[count_ & 1][i].store(facts[i], std::memory_order_relaxed);
  }
  own_.count.store(count_, std::memory_order_seq_cst);
  for (ProcessIndex process = ProcessPlan::kMain; process < wire_.plan().processes; ++process) {
    if (process != process_ && known_[process] != 0 &&
        wire_.rounds(process, known_[process]).sleepers.load(std::memory_order_seq_cst) != 0) {
      segment::wake(own_.count, INT_MAX);
      return;
    }
  }
}

const std::atomic<std::uint64_t>* Rounds::facts_of(ProcessIndex process) const {
  const RoundWords& its = wire_.rounds(process, known_[process]);
  return has_come(its, count_) ? its.facts[count_ & 1] : nullptr;
}

const std::atomic<std::uint64_t>* Rounds::await(ProcessIndex process) {
  constexpr int kSpins = 100;
  for (int i = 0; i < kSpins; ++i) {
    if (known_[process] != 0) {
      if (const auto* const facts = facts_of(process)) {
        return facts;
      }
    }
    pause_a_little();
  }
  for (;;) {
    const std::uint32_t changes = wire_.changes().load(std::memory_order_seq_cst);
    const std::uint32_t now = wire_.incarnation(process).load(std::memory_order_seq_cst);
    const bool is_coming = wire_.restarting(process).load(std::memory_order_seq_cst) != 0;
    // Facts published before its end count for all.
    if (known_[process] != 0) {
      if (const auto* const facts = facts_of(process)) {
        return facts;
      }
    }
    if (now != 0 && now != known_[process]) {
      known_[process] = now;
      links_.attach();  // It starts as soon as all read what it publishes.
      continue;
    }
    if (now == 0 && !is_coming) {
      // Unless it came, and ended again, between the two loads.
      if (wire_.changes().load(std::memory_order_seq_cst) == changes) {
        return nullptr;
      }
      continue;
    }
    own_.sleepers.store(1, std::memory_order_seq_cst);
    is_waiting_.store(true);
    if (now == 0) {
      sleep_on(wire_.changes(), changes);
    } else {
      const RoundWords& its = wire_.rounds(process, now);
      const std::uint32_t seen = its.count.load(std::memory_order_seq_cst);
      if (static_cast<std::int32_t>(seen - count_) < 0) {
        sleep_on(its.count, seen);
      }
    }
    is_waiting_.store(false);
    own_.sleepers.store(0, std::memory_order_seq_cst);
  }
}

void Rounds::join() {
  if (!is_joining_) {
    return;
  }
  for (ProcessIndex process = ProcessPlan::kMain; process < wire_.plan().processes; ++process) {
    if (process == process_) {
      continue;
    }
    const auto is_waited_for = [&] {
      known_[process] = wire_.incarnation(process).load(std::memory_order_seq_cst);
      if (known_[process] == 0) {
        return false;
      }
      const RoundWords& its = wire_.rounds(process, known_[process]);
      return its.is_joining.load() == 0 && !has_come(its, count_ + 1);
    };
    while (is_waited_for()) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
  }
  if (known_[ProcessPlan::kMain] == 0) {
    return;  // The application ends.
  }
  const auto* const facts =
      wire_.rounds(ProcessPlan::kMain, known_[ProcessPlan::kMain]).facts[(count_ + 1) & 1];
  joins_at_exchange_ = (facts[kFlags].load(std::memory_order_relaxed) & kExchange) != 0;
  application_.begin_at(
      base::from_ns(static_cast<std::int64_t>(facts[kNow].load(std::memory_order_relaxed))));
}

RoundState Rounds::agree(const RoundState& own) {
  if (is_joining_) {
    if (!own.is_advancing) {
      return own;  // Its components start; the others have nothing to do meanwhile.
    }
    is_joining_ = false;
    own_.is_joining.store(0, std::memory_order_seq_cst);
    if (joins_at_exchange_) {
      exchange();
    }
  }
  const std::uint64_t own_flags =
      flags_of(own) | (has_sources_ ? kSources : 0) | (are_sources_over_.load() ? kSourcesOver : 0);
  publish({own_flags, std::uint64_t{own.fed_step} << 32 | own.step,
           static_cast<std::uint64_t>(own.next_due_ns),
           static_cast<std::uint64_t>(own.next_unwatched_ns),
           static_cast<std::uint64_t>(application_.end_reason()),
           static_cast<std::uint64_t>(base::to_ns(application_.clock().now())),
           static_cast<std::uint64_t>(own.limit_ns)});
  RoundState all;
  std::uint64_t flags = 0;
  bool are_sources_over = true;
  EndReason reason = EndReason::kNone;
  for (ProcessIndex process = ProcessPlan::kMain; process < wire_.plan().processes; ++process) {
    const std::atomic<std::uint64_t>* const facts =
        process == process_ ? own_.facts[count_ & 1] : await(process);
    if (facts == nullptr) {
      continue;
    }
    const auto get = [facts](Fact fact) { return facts[fact].load(std::memory_order_relaxed); };
    flags |= get(kFlags);
    are_sources_over = are_sources_over && (get(kFlags) & (kSources | kSourcesOver)) != kSources;
    all.fed_step = std::min(all.fed_step, static_cast<std::uint32_t>(get(kSteps) >> 32));
    all.step = std::max(all.step, static_cast<std::uint32_t>(get(kSteps)));
    all.next_due_ns = std::min(all.next_due_ns, static_cast<std::int64_t>(get(kNextDue)));
    all.next_unwatched_ns =
        std::min(all.next_unwatched_ns, static_cast<std::int64_t>(get(kNextUnwatched)));
    all.limit_ns = std::min(all.limit_ns, static_cast<std::int64_t>(get(kLimit)));
    const auto its_reason = static_cast<EndReason>(get(kEndReason));
    if (reason == EndReason::kNone || (is_failure(its_reason) && !is_failure(reason))) {
      reason = its_reason;
    }
  }
  all.is_ready = (flags & kReady) != 0;
  all.is_computing = (flags & kComputing) != 0;
  all.is_held = (flags & kHeld) != 0;
  all.has_threads = (flags & kThreads) != 0;
  all.is_advancing = (flags & kNotAdvancing) == 0;
  agree_on_end((flags & kSources) != 0, are_sources_over, reason);
  all.is_to_end = agreed_end() != Peers::AgreedEnd::kNone;
  return all;
}

/// Gives the same result in all processes.
void Rounds::agree_on_end(bool have_sources, bool are_sources_over, EndReason reason) {
  if (reason == EndReason::kNone && have_sources && are_sources_over) {
    reason = EndReason::kSourcesFinished;
  }
  if (reason == EndReason::kNone) {
    return;
  }
  if (agreed_end() == Peers::AgreedEnd::kNone || is_failure(reason)) {
    agreed_end_.store(reason == EndReason::kSourcesFinished ? Peers::AgreedEnd::kInputOver
                                                            : Peers::AgreedEnd::kOther);
  }
  if (application_.end_reason() != reason) {
    application_.request_end(reason);
  }
}

void Rounds::exchange() {
  links_.report_finished();
  if (!is_joining_) {
    exchange_notices();
  }
  while (links_.take()) {
  }
}

/// Waits for all, takes their notices, and repeats as long as these cause new ones.
void Rounds::exchange_notices() {
  const Peers& peers = *application_.peers();
  if (peers.on_round_ends) {
    peers.on_round_ends();
  }
  for (bool is_first = true;; is_first = false) {
    const NoticeOrder::Sent own = notices_.send();
    const bool is_busy = peers.is_busy && peers.is_busy();
    publish({kExchange | (is_busy ? kBusy : 0) | (is_first ? kFirst : 0), own.words, incarnation_,
             0, 0, static_cast<std::uint64_t>(base::to_ns(application_.clock().now()))});
    std::vector<NoticeOrder::Sent> sent(wire_.plan().processes);
    bool is_anyone_busy = is_busy;
    bool is_round_over = is_first;
    for (ProcessIndex process = ProcessPlan::kMain; process < wire_.plan().processes; ++process) {
      if (process == process_) {
        sent[process] = own;
      } else if (const std::atomic<std::uint64_t>* const facts = await(process)) {
        sent[process] = {.words = facts[kSent].load(std::memory_order_relaxed),
                         .incarnation = static_cast<std::uint32_t>(
                             facts[kIncarnation].load(std::memory_order_relaxed))};
        const std::uint64_t flags = facts[kFlags].load(std::memory_order_relaxed);
        is_anyone_busy |= (flags & kBusy) != 0;
        if (process == ProcessPlan::kMain) {  // A restarted process may join in the middle.
          is_round_over = (flags & kFirst) != 0;
        }
      }
    }
    if (is_round_over && peers.on_round_over) {
      peers.on_round_over(is_anyone_busy);
    }
    if (!notices_.take(sent)) {
      break;
    }
  }
  if (peers.on_quiet) {
    peers.on_quiet();
  }
}

}  // namespace fastcycle::processes
