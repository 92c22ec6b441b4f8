#include "executor/timer_set.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "broker/topic.h"

namespace fastcycle::detail {

TimerCore& TimerSet::add(Actor& actor, const TimerOptions& options, TickCallback callback,
                         TimerRole role) {
  TimerStatistics& its_statistics = statistics_of(
      role.name.empty() ? fmt::format("timer {}", timers_.size()) : role.name, role.cause);
  timers_.push_back(std::make_unique<TimerCore>(actor, timers_.size(), options, std::move(callback),
                                                std::move(role)));
  timers_.back()->statistics = &its_statistics;
  return *timers_.back();
}

TimerCore& TimerSet::add_watch(Actor& actor, Watch& watch, std::int64_t now_ns) {
  timers_.push_back(std::make_unique<TimerCore>(actor, timers_.size(), TimerOptions(),
                                                TickCallback(), TimerRole()));
  TimerCore& timer = *timers_.back();
  timer.watch = &watch;
  if (now_ns != base::kNever) {
    watch.begin(now_ns);
    timer.due_ns = watch.next_look_ns();
  }
  return timer;
}

void TimerSet::add_credit_event(Actor& actor, PublisherCore& publisher,
                                std::function<void()> callback) {
  TimerCore& timer = add(actor, {}, [callback = std::move(callback)](const Tick&) { callback(); },
                         {.name = publisher.topic.name,
                          .label = "its callback for credits of \"" + publisher.topic.name + "\"",
                          .cause = Cause::kEvent});
  credit_events_.push_back({&publisher, &timer});
}

TimerStatistics& TimerSet::statistics_of(const std::string& name, Cause cause) {
  const std::lock_guard lock(mutex_);
  for (TimerStatistics& its : statistics_) {
    if (!its.is_taken && its.name == name && its.cause == cause) {
      its.is_taken = true;
      return its;
    }
  }
  return statistics_.emplace_back(name, cause);
}

std::vector<const TimerStatistics*> TimerSet::statistics() const {
  const std::lock_guard lock(mutex_);
  std::vector<const TimerStatistics*> all;
  for (const TimerStatistics& its : statistics_) {
    all.push_back(&its);
  }
  return all;
}

TimerCore* TimerSet::due(std::int64_t now_ns) noexcept {
  TimerCore* earliest = nullptr;
  for (const auto& timer : timers_) {
    if (timer->due_ns > now_ns || (clock_.is_simulated() && timer->armed_in_turn == turn_)) {
      continue;
    }
    if (earliest == nullptr || timer->due_ns < earliest->due_ns) {
      earliest = timer.get();
    }
  }
  return earliest;
}

Tick TimerSet::take(TimerCore& timer, std::int64_t now_ns) noexcept {
  Tick tick{.due = base::from_ns(timer.due_ns)};
  if (timer.is_periodic()) {
    const std::int64_t late_ns = now_ns - timer.due_ns;
    tick.skipped = static_cast<std::uint64_t>(late_ns / timer.options.period.count());
    tick.due += timer.options.period * static_cast<std::int64_t>(tick.skipped);
    timer.due_ns = base::to_ns(tick.due + timer.options.period);
  } else {
    timer.due_ns = base::kNever;
  }
  timer.armed_in_turn = turn_;
  return tick;
}

void TimerSet::look_again(TimerCore& timer) noexcept {
  timer.due_ns = timer.watch->next_look_ns();
  timer.armed_in_turn = turn_;
}

void TimerSet::arm(TimerCore& timer, std::int64_t due_ns) noexcept {
  timer.due_ns = due_ns;
  timer.armed_in_turn = turn_;
}

void TimerSet::take_credits(std::int64_t now_ns) noexcept {
  for (const CreditEvent& event : credit_events_) {
    if (event.publisher->take_returned_credits() && is_on_) {
      event.timer->due_ns = now_ns;
    }
  }
}

void TimerSet::start(Time start) {
  is_on_ = true;
  for (const auto& timer : timers_) {
    if (timer->is_periodic()) {
      timer->due_ns = base::to_ns(start + timer->options.phase + timer->options.period);
    } else if (timer->watch != nullptr) {
      timer->watch->begin(base::to_ns(start));
      timer->due_ns = timer->watch->next_look_ns();
    }
  }
}

void TimerSet::cancel() noexcept {
  is_on_ = false;
  for (const auto& timer : timers_) {
    timer->due_ns = base::kNever;
  }
}

void TimerSet::clear() noexcept {
  credit_events_.clear();
  while (!timers_.empty()) {  // A callback may own handles whose end asks for what is left.
    const auto timers = std::exchange(timers_, {});
  }
  const std::lock_guard lock(mutex_);
  for (TimerStatistics& its : statistics_) {
    its.is_taken = false;
  }
}

std::int64_t TimerSet::next_due_ns() const noexcept {
  std::int64_t due_ns = base::kNever;
  for (const auto& timer : timers_) {
    due_ns = std::min(due_ns, timer->due_ns);
  }
  return due_ns;
}

}  // namespace fastcycle::detail
