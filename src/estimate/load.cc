#include "estimate/load.h"

#include <algorithm>
#include <numeric>

namespace fastcycle::estimate {
namespace {

// As the executor has it: src/executor/actor.cc.
constexpr std::uint64_t kTurnActivations = 16;
constexpr Duration kTurn = std::chrono::milliseconds(1);

/// Of a busy window that has more causes, or grows more often, no end is looked for.
constexpr int kMaxCauses = 1000;
constexpr int kMaxGrowths = 1000;

/// A turn of a component whose longest callback takes `longest`.
Duration turn_of(Duration longest) {
  return std::min(longest * static_cast<std::int64_t>(kTurnActivations), kTurn + longest);
}

}  // namespace

std::uint64_t Demand::calls_in(Duration span) const {
  std::uint64_t calls = 0;
  for (const auto& streams : arrivals) {
    for (const Arrivals& stream : streams) {
      calls += stream.at_most_in(span);
    }
  }
  return calls;
}

Duration Demand::work_in(Duration span, Duration each) const {
  Duration work{};
  for (std::size_t i = 0; i < arrivals.size(); ++i) {
    for (const Arrivals& stream : arrivals[i]) {
      work += (run_times[i] + each) * static_cast<std::int64_t>(stream.at_most_in(span));
    }
  }
  return work;
}

Duration Demand::next_after(Duration span) const {
  Duration next = Duration::max();
  for (const auto& streams : arrivals) {
    for (const Arrivals& stream : streams) {
      next = std::min(next,
                      ((span + stream.jitter) / stream.period + 1) * stream.period - stream.jitter);
    }
  }
  return next;
}

Duration Demand::longest() const {
  return run_times.empty() ? Duration() : *std::ranges::max_element(run_times);
}

double Demand::utilization() const {
  double sum = 0;
  for (std::size_t i = 0; i < arrivals.size(); ++i) {
    for (const Arrivals& stream : arrivals[i]) {
      sum += static_cast<double>(stream.burst) * static_cast<double>(run_times[i].count()) /
             static_cast<double>(stream.period.count());
    }
  }
  return sum;
}

/// With whom an executor has to share its CPUs.
struct Waiting::Sharing {
  bool is_shared = false;    ///< There are more workers than CPUs.
  std::int64_t cpus = 1;     ///< That it may use.
  std::vector<bool> others;  ///< By executor: takes CPU time from it.
};

Waiting::Waiting(const System& system, const std::vector<Demand>& demands,
                 const std::vector<bool>& is_known, const std::vector<Duration>& responses)
    : system_(system), demands_(demands), is_known_(is_known), responses_(responses) {}

Waiting::Sharing Waiting::sharing_of(std::size_t executor) const {
  const Executor& own = system_.executors[executor];
  Sharing sharing;
  sharing.cpus = own.cpus.empty() ? system_.cpus : static_cast<std::int64_t>(own.cpus.size());
  sharing.others.resize(system_.executors.size());
  std::int64_t workers = 0;
  for (std::size_t i = 0; i < system_.executors.size(); ++i) {
    const Executor& other = system_.executors[i];
    const bool overlaps = own.cpus.empty() || other.cpus.empty() ||
                          std::ranges::find_first_of(own.cpus, other.cpus) != own.cpus.end();
    // A thread of lower real-time priority takes nothing from one of higher.
    if (i == executor || (overlaps && other.priority >= own.priority)) {
      workers += other.threads;
      sharing.others[i] = i != executor;
    }
  }
  sharing.is_shared = workers > sharing.cpus;
  return sharing;
}

std::string Waiting::obstacle(std::size_t component) const {
  const std::size_t executor = system_.components[component].executor;
  const Sharing sharing = sharing_of(executor);
  if (!sharing.is_shared) {
    return {};
  }
  for (std::size_t i = 0; i < system_.executors.size(); ++i) {
    if ((sharing.others[i] || i == executor) && system_.executors[i].is_spinning) {
      return "executor \"" + system_.executors[i].name +
             "\" looks for work without pause on CPUs that " +
             (i == executor ? "it does not have for itself"
                            : "executor \"" + system_.executors[executor].name + "\" needs");
    }
  }
  for (std::size_t i = 0; i < system_.components.size(); ++i) {
    if (sharing.others[system_.components[i].executor] && !is_known_[i]) {
      return "executor \"" + system_.executors[executor].name + "\" shares its CPUs with \"" +
             system_.components[i].name + "\", whose load has no bound";
    }
  }
  return {};
}

Duration Waiting::work(std::size_t component, Duration window, Duration each) const {
  // The backlog at the begin of the window arrived within its response before that.
  return is_known_[component] ? demands_[component].work_in(window + responses_[component], each)
                              : kNoBound;
}

Duration Waiting::interference(std::size_t component, Duration window, std::uint64_t turns,
                               const Sharing& sharing, std::vector<Duration>* parts) const {
  const std::size_t executor = system_.components[component].executor;
  const Executor& own = system_.executors[executor];
  const auto turn_count = static_cast<std::int64_t>(turns);
  const std::int64_t workers = own.threads;

  // By rotation: from one turn to the next, a worker that passes gives each other component one
  // turn; before the first, one more, in the pass that had begun already.
  Duration by_rotation{};
  // By work: while the component waits, all workers, or all CPUs, are busy with others.
  Duration mates_work{};
  Duration others_work{};
  for (std::size_t i = 0; i < system_.components.size(); ++i) {
    const std::size_t its_executor = system_.components[i].executor;
    const Duration looks =
        sharing.is_shared ? system_.executors[its_executor].looks_for : Duration();
    if (i == component) {
      continue;
    }
    if (its_executor == executor) {
      const Duration its_work = work(i, window, looks);
      const Duration turns_of_it =
          std::min((turn_count + 1) * turn_of(demands_[i].longest()), its_work);
      by_rotation += turns_of_it;
      mates_work += std::min(its_work, window);
      if (parts != nullptr) {
        (*parts)[i] = turns_of_it;
      }
    } else if (sharing.is_shared && sharing.others[its_executor]) {
      const Duration its_work = std::min(work(i, window, looks), window);
      others_work += its_work;
      if (parts != nullptr) {
        (*parts)[i] = its_work / sharing.cpus;
      }
    }
  }
  if (sharing.is_shared) {
    by_rotation += (others_work + (workers > 1 ? mates_work : Duration())) / sharing.cpus;
  }
  if (own.hand_over) {
    return by_rotation + system_.wake_up;
  }
  const std::int64_t at_once = sharing.is_shared ? std::min(workers, sharing.cpus) : workers;
  const Duration by_work = mates_work / at_once +
                           (sharing.is_shared ? others_work / sharing.cpus : Duration()) +
                           system_.wake_up * (turn_count * workers);
  // A pool's leader may have to hand on the watch over the timers before it serves.
  return std::min(by_rotation + system_.wake_up * std::min<std::int64_t>(workers, 2), by_work);
}

Waiting::Result Waiting::of(std::size_t component) const {
  const Demand& own = demands_[component];
  const Sharing sharing = sharing_of(system_.components[component].executor);
  Result result{.is_bounded = true, .hindrance = std::vector<Duration>(system_.components.size())};
  // Its busy window begins at 0 with nothing waiting; `begin` is when a cause comes, at most what
  // came until then goes before it.
  int causes = 0;
  for (Duration begin{}; begin != Duration::max();) {
    if (++causes > kMaxCauses) {
      return {};
    }
    const Duration work = own.work_in(begin);
    const std::uint64_t calls = own.calls_in(begin);
    std::uint64_t turns = calls;
    if (!sharing.is_shared) {
      // A turn ends after 16 activations or 1 ms, which would be less work where others take CPU.
      turns = std::min(
          calls, 1 + (calls - 1) / kTurnActivations + static_cast<std::uint64_t>(work / kTurn));
    }
    Duration end = work;
    for (int growths = 0;; ++growths) {
      const Duration again = work + interference(component, end, turns, sharing, nullptr);
      if (again <= end) {
        break;
      }
      end = again;
      if (end > kNoBound || growths > kMaxGrowths) {
        return {};
      }
    }
    if (end - begin > result.response) {
      result.response = end - begin;
      interference(component, end, turns, sharing, &result.hindrance);
      result.hindrance[component] = work - own.longest();
    }
    const Duration next = own.next_after(begin);
    if (end <= next) {
      break;
    }
    begin = next;
  }
  return result;
}

}  // namespace fastcycle::estimate
