#pragma once

// For tests: the expected results of synchronizers, by exhaustive search, and streams of messages.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "fastcycle/synchronizer.h"

namespace fastcycle::detail {

/// A message, as input of the rule.
struct TestArrival {
  std::size_t topic;
  int time;
};

/// The result: messages are identified by their index in the order of arrival.
struct Matched {
  std::vector<std::vector<std::size_t>> sets;
  /// The arrival after which each message was discarded.
  std::map<std::size_t, std::size_t> unmatched;

  bool operator==(const Matched&) const = default;
};

// ---- The rule of `SyncPolicy`, word for word: tries everything ----

/// Calls `use` with every choice of one of `held[topic]` for each topic, as places in `held`.
template <typename Use>
void for_each_set(const std::vector<std::vector<std::size_t>>& held, std::size_t topic,
                  std::vector<std::size_t>& chosen, const Use& use) {
  if (topic == held.size()) {
    use(chosen);
    return;
  }
  for (std::size_t message : held[topic]) {
    chosen.push_back(message);
    for_each_set(held, topic + 1, chosen, use);
    chosen.pop_back();
  }
}

class Oracle {
 public:
  Oracle(const std::vector<TestArrival>& arrivals, std::size_t topics, SyncPolicy policy,
         int max_difference, std::size_t depth)
      : arrivals_(arrivals),
        policy_(policy),
        difference_(max_difference),
        depth_(depth),
        held_(topics),
        newest_(topics, std::numeric_limits<int>::min()) {}

  Matched run() {
    for (now_ = 0; now_ < arrivals_.size(); ++now_) {
      if (policy_ == SyncPolicy::kLatest) {
        arrive_latest();
      } else {
        arrive();
      }
    }
    return matched_;
  }

 private:
  [[nodiscard]] int time(std::size_t message) const { return arrivals_[message].time; }
  [[nodiscard]] std::size_t topic(std::size_t message) const { return arrivals_[message].topic; }

  void give_way(std::size_t message) {
    matched_.unmatched[message] = now_;
    std::erase(held_[topic(message)], message);
  }

  void arrive() {
    int& newest = newest_[topic(now_)];
    if (time(now_) < newest) {
      give_way(now_);
      return;
    }
    newest = time(now_);
    if (const auto best = best_set()) {
      matched_.sets.push_back(*best);
      for (std::size_t member : *best) {
        for (std::size_t older = 0; older < member; ++older) {
          if (std::ranges::count(held_[topic(member)], older) > 0) {
            give_way(older);
          }
        }
        std::erase(held_[topic(member)], member);
      }
    } else if (!has_hope(now_)) {
      give_way(now_);
    } else {
      held_[topic(now_)].push_back(now_);
      if (held_[topic(now_)].size() > depth_) {
        give_way(held_[topic(now_)].front());
      }
    }
    // All at once: messages without hope must not depend on each other.
    std::vector<std::size_t> without_hope;
    for (const auto& messages : held_) {
      std::ranges::copy_if(messages, std::back_inserter(without_hope),
                           [&](std::size_t message) { return !has_hope(message); });
    }
    for (std::size_t message : without_hope) {
      give_way(message);
    }
  }

  /// Among all sets with the message that arrives now and a span that is small enough, the one
  /// with the smallest span, then with the earliest time, then with the first of each topic.
  [[nodiscard]] std::optional<std::vector<std::size_t>> best_set() const {
    std::vector<std::vector<std::size_t>> choices = held_;
    choices[topic(now_)] = {now_};
    std::optional<std::vector<std::size_t>> best;
    std::pair<int, int> best_rank;
    std::vector<std::size_t> chosen;
    for_each_set(choices, 0, chosen, [&](const std::vector<std::size_t>& set) {
      int first = std::numeric_limits<int>::max();
      int last = std::numeric_limits<int>::min();
      for (std::size_t member : set) {
        first = std::min(first, time(member));
        last = std::max(last, time(member));
      }
      const std::pair<int, int> rank{last - first, first};
      if (last - first <= difference_ &&
          (!best || rank < best_rank || (rank == best_rank && set < *best))) {
        best = set;
        best_rank = rank;
      }
    });
    return best;
  }

  /// Whether some span that includes the time of `message` has, for each other topic, a message
  /// that is held or could still come.
  [[nodiscard]] bool has_hope(std::size_t message) const {
    for (int begin = time(message); begin >= time(message) - difference_; --begin) {
      bool is_filled = true;
      for (std::size_t other = 0; other < held_.size(); ++other) {
        is_filled = is_filled && (other == topic(message) || may_fill(other, begin));
      }
      if (is_filled) {
        return true;
      }
    }
    return false;
  }

  [[nodiscard]] bool may_fill(std::size_t other, int begin) const {
    return newest_[other] <= begin + difference_ ||
           std::ranges::any_of(held_[other], [&](std::size_t candidate) {
             return time(candidate) >= begin && time(candidate) <= begin + difference_;
           });
  }

  void arrive_latest() {
    if (topic(now_) != 0) {
      if (!held_[topic(now_)].empty()) {
        const std::size_t old = held_[topic(now_)].front();
        held_[topic(now_)].clear();
        if (!is_used(old)) {
          give_way(old);
        }
      }
      held_[topic(now_)] = {now_};
      return;
    }
    std::vector<std::size_t> set{now_};
    for (std::size_t other = 1; other < held_.size(); ++other) {
      if (held_[other].empty()) {
        give_way(now_);
        return;
      }
      set.push_back(held_[other].front());
    }
    matched_.sets.push_back(set);
  }

  [[nodiscard]] bool is_used(std::size_t message) const {
    return std::ranges::any_of(
        matched_.sets, [&](const auto& set) { return std::ranges::count(set, message) > 0; });
  }

  const std::vector<TestArrival>& arrivals_;
  const SyncPolicy policy_;
  const int difference_;
  const std::size_t depth_;
  std::size_t now_ = 0;
  std::vector<std::vector<std::size_t>> held_;  ///< In the order of arrival.
  std::vector<int> newest_;                     ///< Of each topic.
  Matched matched_;
};

// ---- Any streams ----

/// Streams as sensors make them: a period and an offset each, jitter, losses, equal times; and, as
/// networks do it, some that arrive late, or in a wrong order.
inline std::vector<TestArrival> random_streams(std::mt19937_64& random, std::size_t topics) {
  const auto up_to = [&](int limit) {
    return static_cast<int>(random() % static_cast<std::uint64_t>(limit + 1));
  };
  struct Sent {
    int arrives;
    std::size_t number;  ///< What arrives at one time stays in this order.
    TestArrival arrival;
  };
  std::vector<Sent> sent;
  const int period = 1 + up_to(20);
  const int jitter = up_to(period);
  const int loss = up_to(4);
  const int disorder = up_to(3) == 0 ? period : 0;
  const int count = 12 + up_to(8);
  for (std::size_t topic = 0; topic < topics; ++topic) {
    const int its_period = up_to(2) == 0 ? 1 + up_to(20) : period;
    const int offset = up_to(period);
    const int latency = up_to(2 * period);
    int earliest = 0;
    for (int i = 0; i < count; ++i) {
      const int time = offset + i * its_period + up_to(jitter);
      // A topic keeps its order, unless there is disorder.
      const int arrives = std::max(earliest, time + latency + up_to(jitter));
      earliest = disorder == 0 ? arrives : arrives - disorder;
      if (up_to(9) >= loss) {
        sent.push_back({arrives, sent.size(), {topic, time}});
      }
    }
  }
  std::ranges::sort(sent, {},
                    [](const Sent& message) { return std::pair(message.arrives, message.number); });
  std::vector<TestArrival> arrivals;
  for (const Sent& message : sent) {
    arrivals.push_back(message.arrival);
  }
  return arrivals;
}

}  // namespace fastcycle::detail
