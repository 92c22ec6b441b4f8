#include "executor/set_matcher.h"

#include <algorithm>

#include "fastcycle/assert.h"

namespace fastcycle::detail {

SetMatcher::SetMatcher(std::size_t topics, const SynchronizerOptions& options)
    : topics_(topics),
      policy_(options.policy),
      max_difference_(options.policy == SyncPolicy::kApproximate ? options.max_difference
                                                                 : Duration(0)),
      depth_(options.depth) {
  FASTCYCLE_ASSERT(topics >= 2 && topics <= kMaxTopics, "a synchronizer has 2 to 4 topics");
  for (std::size_t topic = 0; topic < topics_; ++topic) {
    queues_[topic].held.reserve(depth_ + 1);
  }
  departed_.reserve(topics_ * (depth_ + 1));
}

std::size_t SetMatcher::Queue::first_from(Time time) const noexcept {
  const auto found = std::ranges::lower_bound(held, time, {}, &Held::time);
  return static_cast<std::size_t>(found - held.begin());
}

std::optional<Duration> SetMatcher::Queue::nearest(Time time) const noexcept {
  std::optional<Duration> smallest;
  const auto look_at = [&](Time other) {
    const Duration difference = other < time ? time - other : other - time;
    smallest = smallest ? std::min(*smallest, difference) : difference;
  };
  for (std::size_t i = 0; i < std::min(count, kRecent); ++i) {
    look_at(recent[i]);
  }
  const std::size_t place = first_from(time);
  if (place < held.size()) {
    look_at(held[place].time);
  }
  if (place > 0) {
    look_at(held[place - 1].time);
  }
  return smallest;
}

bool SetMatcher::add(std::size_t topic, Time time, Envelope* envelope) {
  departed_.clear();
  if (policy_ == SyncPolicy::kLatest) {
    return add_to_latest(topic, time, envelope);
  }
  Queue& queue = queues_[topic];
  if (queue.newest && time < *queue.newest) {
    departed_.push_back({topic, envelope, false, Unmatched::kLate});
    return false;
  }
  queue.note(time);
  Places places{};
  const bool is_complete = find_best(topic, time, places);
  if (is_complete) {
    take(topic, envelope, places);
  } else if (is_hopeless(topic, time)) {
    depart_without(topic, {time, envelope, false}, Unmatched::kTooFar);
  } else {
    queue.held.push_back({time, envelope, false});
    if (queue.held.size() > depth_) {
      depart_without(topic, queue.held.front(), Unmatched::kDepth);
      queue.held.erase(queue.held.begin());
    }
  }
  drop_hopeless();
  return is_complete;
}

bool SetMatcher::add_to_latest(std::size_t topic, Time time, Envelope* envelope) {
  if (topic != 0) {
    depart(topic, queues_[topic].held.size());
    queues_[topic].held.push_back({time, envelope, false});
    return false;
  }
  const auto end = queues_.begin() + static_cast<std::ptrdiff_t>(topics_);
  const auto empty =
      std::find_if(queues_.begin() + 1, end, [](const Queue& queue) { return queue.held.empty(); });
  if (empty != end) {
    departed_.push_back({topic, envelope, false, Unmatched::kNoMessage,
                         static_cast<std::size_t>(empty - queues_.begin())});
    return false;
  }
  set_[0] = {.envelope = envelope, .is_new = true, .is_held = false};
  for (std::size_t other = 1; other < topics_; ++other) {
    Held& held = queues_[other].held.front();
    set_[other] = {.envelope = held.envelope, .is_new = !held.was_used, .is_held = true};
    held.was_used = true;
  }
  return true;
}

/// Whether `try_begin` accepts the beginning of some span of `max_difference` that includes `time`.
/// Only spans that begin with `time` or with a held message matter: any other one can begin later,
/// until it does, and still include the same messages.
template <typename Try>
bool SetMatcher::any_begin(std::size_t topic, Time time, const Try& try_begin) const noexcept {
  if (try_begin(time)) {
    return true;
  }
  for (std::size_t other = 0; other < topics_; ++other) {
    if (other == topic) {
      continue;
    }
    const std::vector<Held>& held = queues_[other].held;
    for (std::size_t place = queues_[other].first_from(time); place > 0; --place) {
      const Time begin = held[place - 1].time;
      if (time - begin > max_difference_) {
        break;
      }
      if (try_begin(begin)) {
        return true;
      }
    }
  }
  return false;
}

/// The smallest span of a set that begins at `first`, and its members; nothing if there is none.
std::optional<Duration> SetMatcher::span_from(std::size_t topic, Time time, Time first,
                                              Places& places) const noexcept {
  Time last = time;
  for (std::size_t other = 0; other < topics_; ++other) {
    if (other == topic) {
      continue;
    }
    places[other] = queues_[other].first_from(first);
    if (places[other] == queues_[other].held.size()) {
      return std::nullopt;
    }
    last = std::max(last, queues_[other].held[places[other]].time);
  }
  return last - first;
}

bool SetMatcher::find_best(std::size_t topic, Time time, Places& best) const noexcept {
  std::optional<Duration> smallest;
  Time earliest{};
  static_cast<void>(any_begin(topic, time, [&](Time first) {
    Places places{};
    const auto span = span_from(topic, time, first, places);
    if (span && *span <= max_difference_ &&
        (!smallest || *span < *smallest || (*span == *smallest && first < earliest))) {
      smallest = span;
      earliest = first;
      best = places;
    }
    return false;
  }));
  return smallest.has_value();
}

void SetMatcher::take(std::size_t topic, Envelope* envelope, const Places& places) {
  for (std::size_t other = 0; other < topics_; ++other) {
    std::vector<Held>& held = queues_[other].held;
    if (other == topic) {
      depart(other, held.size());
      set_[other] = {.envelope = envelope, .is_new = true, .is_held = false};
    } else {
      set_[other] = {.envelope = held[places[other]].envelope, .is_new = true, .is_held = false};
      depart(other, places[other]);
      held.erase(held.begin());
    }
  }
}

/// Whether `topic` has, or may still get, a message within the span that begins at `first`.
bool SetMatcher::may_fill(std::size_t topic, Time first) const noexcept {
  const Queue& queue = queues_[topic];
  if (!queue.newest || *queue.newest - first <= max_difference_) {
    return true;
  }
  const std::size_t place = queue.first_from(first);
  return place < queue.held.size() && queue.held[place].time - first <= max_difference_;
}

bool SetMatcher::is_hopeless(std::size_t topic, Time time) const noexcept {
  return !any_begin(topic, time, [&](Time first) {
    for (std::size_t other = 0; other < topics_; ++other) {
      if (other != topic && !may_fill(other, first)) {
        return false;
      }
    }
    return true;
  });
}

/// None that is hopeless gives hope to another: that would give hope to itself.
void SetMatcher::drop_hopeless() noexcept {
  for (std::size_t topic = 0; topic < topics_; ++topic) {
    std::erase_if(queues_[topic].held, [&](const Held& held) {
      if (!is_hopeless(topic, held.time)) {
        return false;
      }
      depart_without(topic, held, Unmatched::kTooFar);
      return true;
    });
  }
}

/// It is given back for want of a message of the topic whose nearest is the farthest from it.
void SetMatcher::depart_without(std::size_t topic, const Held& held, Unmatched why) noexcept {
  Departed departed{topic, held.envelope, false, why};
  bool is_first = true;
  for (std::size_t other = 0; other < topics_; ++other) {
    if (other == topic) {
      continue;
    }
    const std::optional<Duration> difference = queues_[other].nearest(held.time);
    const bool is_farther =
        is_first || !difference || (departed.difference && *difference > *departed.difference);
    if (is_farther) {
      departed.partner = other;
      departed.difference = difference;
    }
    is_first = false;
    if (!difference) {
      break;
    }
  }
  departed_.push_back(departed);
}

/// The oldest `count` of `topic` are given back.
void SetMatcher::depart(std::size_t topic, std::size_t count) noexcept {
  std::vector<Held>& held = queues_[topic].held;
  for (std::size_t place = 0; place < count; ++place) {
    departed_.push_back({topic, held[place].envelope, held[place].was_used});
  }
  held.erase(held.begin(), held.begin() + static_cast<std::ptrdiff_t>(count));
}

void SetMatcher::clear() noexcept {
  departed_.clear();
  for (std::size_t topic = 0; topic < topics_; ++topic) {
    depart(topic, queues_[topic].held.size());
    queues_[topic].newest.reset();
    queues_[topic].count = 0;
  }
}

}  // namespace fastcycle::detail
