#include "replay/recorded_driver.h"

#include <utility>

#include "executor/actor.h"

namespace fastcycle::host {

const base::Clock& RecordedDriver::clock_of_next(const base::Clock&) {
  return clocks_.emplace_back(base::Clock::simulated(Time{}));
}

void RecordedDriver::add(detail::Actor& actor, const config::ComponentDescription&) {
  actor.inbox.attach(nobody_, actor.index);
  actor.timer_watch = &nobody_;
}

ControlCall RecordedDriver::call(detail::Actor&, detail::LifeStep, std::function<void()>) {
  return {};  // Only the log controls the lifecycle of components.
}

void RecordedDriver::stage(detail::Actor& from, std::function<void()> action) {
  from.stage(std::move(action));
}

bool RecordedDriver::submit(std::size_t, detail::Actor& from, std::function<void()> job) {
  from.stage(std::move(job));
  return true;
}

}  // namespace fastcycle::host
