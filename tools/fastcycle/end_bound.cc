#include "end_bound.h"

#include <algorithm>
#include <cstdio>
#include <string_view>
#include <utility>

#include "command.h"
#include "diagnostics/crash_reporter.h"
#include "diagnostics/who_runs.h"
#include "print.h"

namespace fastcycle::tool {
namespace {

using diagnostics::RunningCall;

/// All others have bounds of their own.
bool is_of_main_thread(const RunningCall& call) {
  return call.call == "its constructor" || call.call == "its destructor";
}

}  // namespace

EndBound::EndBound(const config::ApplicationDescription& description, const char* command,
                   std::function<void()> leave)
    : description_(description),
      command_(command),
      leave_(std::move(leave)),
      thread_([this] { watch(); }) {}

EndBound::~EndBound() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void EndBound::begin_within(std::chrono::nanoseconds time) {
  const Clock::time_point asked = Clock::now() + std::chrono::duration_cast<Clock::duration>(time);
  {
    const std::lock_guard lock(mutex_);
    begin_ = std::min(begin_.value_or(asked), asked);
  }
  changed_.notify_one();
}

void EndBound::watch() {
  constexpr std::chrono::seconds kPeriod{1};
  std::unique_lock lock(mutex_);
  while (!is_over_) {
    if (!begin_) {
      changed_.wait(lock);
    } else if (Clock::now() < *begin_) {
      changed_.wait_until(lock, *begin_);
    } else {
      lock.unlock();
      end_if_stuck();
      lock.lock();
      changed_.wait_for(lock, kPeriod, [this] { return is_over_; });
    }
  }
}

void EndBound::end_if_stuck() const {
  for (const RunningCall& call : diagnostics::who_runs_now(kLimit, is_of_main_thread)) {
    const auto component = std::ranges::find(description_.components, call.actor->name,
                                             &config::ComponentDescription::name);
    const bool is_bounded = component == description_.components.end() ||
                            (component->hang.lifecycle_limit.count() > 0 &&
                             call.time > component->hang.lifecycle_limit);
    if (is_bounded) {
      print_to(stderr,
               "fastcycle {}: component \"{}\" has not returned from {}, currently in {}; the "
               "process ends without waiting for it\n",
               command_, call.actor->name, call.call, call.place());
      std::fflush(stderr);
      leave_();
      diagnostics::end_process(kFailed);
    }
  }
}

}  // namespace fastcycle::tool
