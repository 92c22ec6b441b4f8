#include "host/live_driver.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "component/policy.h"
#include "component/wait.h"

namespace fastcycle::host {

namespace {

detail::WaitMode to_wait(config::Wait wait) {
  switch (wait) {
    case config::Wait::kSpin:
      return detail::WaitMode::kSpin;
    case config::Wait::kAdaptive:
      return detail::WaitMode::kAdaptive;
    case config::Wait::kPark:
      break;
  }
  return detail::WaitMode::kPark;
}

}  // namespace

LiveDriver::LiveDriver(const base::Clock& clock, const config::ApplicationDescription& application,
                       Bell& bell)
    : clock_(clock), bell_(bell) {
  for (const config::ExecutorDescription& executor : application.executors) {
    executors_.push_back(std::make_unique<detail::Executor>(
        detail::ExecutorOptions{.name = executor.name,
                                .threads = static_cast<unsigned>(executor.threads),
                                .cpus = executor.cpus,
                                .policy = to_policy(executor.policy),
                                .priority = executor.priority,
                                .slice_us = executor.slice_us,
                                .wait = to_wait(executor.wait),
                                .hand_over = executor.hand_over}));
  }
  if (needs_pool(application)) {
    executors_.push_back(std::make_unique<detail::Executor>(
        detail::ExecutorOptions{.name = kPoolName, .threads = pool_size(), .cpus = {}}));
  }
  for (std::size_t i = 0; i < executors_.size(); ++i) {
    its_.push_back(std::make_unique<Its>());
  }
  const auto has_priority = [](const config::ComponentDescription& component) {
    return std::ranges::any_of(component.threads, [](const auto& thread) {
      return thread.second.policy != config::Policy::kOther;
    });
  };
  is_real_time_ = std::ranges::any_of(application.executors,
                                      [](const config::ExecutorDescription& executor) {
                                        return executor.policy != config::Policy::kOther;
                                      }) ||
                  std::ranges::any_of(application.components, has_priority);
}

std::size_t LiveDriver::executor_of(const config::ComponentDescription& component) const {
  const auto found = std::ranges::find_if(executors_, [&](const auto& executor) {
    return executor->options().name == component.executor;
  });
  return found == executors_.end() ? executors_.size() - 1
                                   : static_cast<std::size_t>(found - executors_.begin());
}

void LiveDriver::add(detail::Actor& actor, const config::ComponentDescription& component) {
  const std::size_t executor = executor_of(component);
  executors_[executor]->add(actor);
  its_[executor]->actors.push_back(&actor);
}

void LiveDriver::start(std::vector<base::Refusal>& refusals) {
  for (const auto& executor : executors_) {
    executor->start(refusals);
  }
}

std::vector<const detail::ActivationRing*> LiveDriver::rings() const {
  std::vector<const detail::ActivationRing*> rings;
  for (const auto& executor : executors_) {
    rings.insert(rings.end(), executor->rings().all().begin(), executor->rings().all().end());
  }
  return rings;
}

void LiveDriver::use_rings(std::span<detail::ActivationRing* const> rings) {
  for (const auto& executor : executors_) {
    const std::size_t count = std::min<std::size_t>(executor->options().threads, rings.size());
    executor->use_rings(rings.first(count));
    rings = rings.subspan(count);
  }
}

ControlCall LiveDriver::call(detail::Actor& actor, detail::LifeStep step,
                             std::function<void()> body) {
  ControlCall call;
  actor.post_and_notify(
      detail::Cause::kMode, std::move(body),
      [call, &bell = bell_] {
        call.end();
        bell.ring();
      },
      detail::to_key(step));
  return call;
}

TimeDriver::End LiveDriver::run(Time limit, Time) {
  const std::int64_t deadline_ns = limit == Time::max() ? base::kNever : clock_.monotonic_at(limit);
  return bell_.wait(deadline_ns, [this] { return is_interrupted_.load(); }) ? End::kInterrupted
                                                                            : End::kReached;
}

void LiveDriver::interrupt() noexcept {
  is_interrupted_.store(true);
  bell_.ring();
}

void LiveDriver::drain(std::int64_t deadline_ns) {
  // Twice quiet in a row: between two looks nothing was under way.
  int quiet_looks = 0;
  wait_until(deadline_ns, [&] {
    const bool is_quiet =
        std::ranges::all_of(executors_, [](const auto& executor) { return executor->is_quiet(); });
    quiet_looks = is_quiet ? quiet_looks + 1 : 0;
    return quiet_looks == 2;
  });
}

void LiveDriver::refuse_jobs() {
  for (const auto& its : its_) {
    its->refuses_jobs.store(true);
  }
}

void LiveDriver::stop(const std::function<bool(const detail::Actor&)>& is_stuck) {
  refuse_jobs();
  for (std::size_t i = 0; i < executors_.size(); ++i) {
    const bool comes_back =
        its_[i]->jobs.load() == 0 &&
        std::ranges::none_of(its_[i]->actors, [&](const auto* actor) { return is_stuck(*actor); });
    if (comes_back) {
      executors_[i]->stop();
      its_[i]->is_stopped = true;
    }
  }
}

bool LiveDriver::may_serve(const detail::Actor& actor) const {
  return std::ranges::any_of(its_, [&](const auto& its) {
    return !its->is_stopped && std::ranges::find(its->actors, &actor) != its->actors.end();
  });
}

void LiveDriver::join() {
  for (std::size_t i = 0; i < executors_.size(); ++i) {
    executors_[i]->stop();
    its_[i]->is_stopped = true;
  }
}

bool LiveDriver::submit(std::size_t executor, detail::Actor&, std::function<void()> job) {
  return executors_[executor]->submit([&its = *its_[executor], job = std::move(job)] {
    // In this order: a thread that refuses jobs and then sees none running will see none begin.
    its.jobs.fetch_add(1);
    if (!its.refuses_jobs.load()) {
      job();
    }
    its.jobs.fetch_sub(1);
  });
}

}  // namespace fastcycle::host
