#include "diagnostics/watchdog.h"

#include <algorithm>
#include <utility>

namespace fastcycle::diagnostics {
namespace {

using namespace std::chrono_literals;

bool is_same(const RunningCall& a, const RunningCall& b) {
  return a.begin_ns == b.begin_ns && a.actor == b.actor && a.thread == b.thread;
}

}  // namespace

Watchdog::Watchdog(Options options)
    : options_(std::move(options)),
      shortest_(options_.notice.count() > 0 ? std::min(options_.smallest_limit, options_.notice)
                                            : options_.smallest_limit) {
  if (options_.smallest_limit.count() > 0) {
    thread_ = base::Thread({.name = "watchdog", .cpus = {}}, [this] { watch(); }, refusals_);
  }
}

Watchdog::~Watchdog() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    changed_.notify_all();
  }
  thread_.join();
}

void Watchdog::watch() {
  const std::chrono::nanoseconds pause =
      std::clamp<std::chrono::nanoseconds>(shortest_ / 4, 5ms, 1s);
  std::unique_lock lock(mutex_);
  while (!changed_.wait_for(lock, pause, [this] { return is_stopping_; })) {
    lock.unlock();
    look();
    lock.lock();
  }
}

void Watchdog::look() {
  // A thread that hangs already is not signalled again: a signal may disturb a blocking call.
  std::vector<RunningCall> still;
  std::vector<RunningCall> slow;
  const auto is_new_hang = [&](const RunningCall& call) {
    const auto known = std::ranges::find_if(
        hanging_, [&](const RunningCall& other) { return is_same(call, other); });
    if (known != hanging_.end()) {
      still.push_back(*known);
      still.back().time = call.time;
      return false;
    }
    const auto limit = options_.limit_of(call);
    if (limit && call.time <= *limit && options_.notice.count() > 0 &&
        call.time > options_.notice) {
      slow.push_back(call);
    }
    return limit && call.time > *limit;
  };
  const std::vector<RunningCall> hangs = who_runs_now(shortest_, is_new_hang);
  for (const RunningCall& call : slow) {
    if (std::ranges::none_of(slow_,
                             [&](const RunningCall& other) { return is_same(call, other); })) {
      options_.on_slow(call);
    }
  }
  slow_ = std::move(slow);
  for (const RunningCall& call : hanging_) {
    const bool is_there =
        std::ranges::any_of(still, [&](const RunningCall& other) { return is_same(call, other); });
    if (!is_there) {
      options_.on_return(call);
    }
  }
  hanging_ = std::move(still);
  for (const RunningCall& call : hanging_) {
    options_.on_look(call);
  }
  for (const RunningCall& call : hangs) {
    hanging_.push_back(call);
    options_.on_hang(call);
  }
}

}  // namespace fastcycle::diagnostics
