#include "host/simulated_driver.h"

#include <algorithm>
#include <memory>
#include <thread>

#include "component/steps.h"
#include "component/wait.h"
#include "executor/activation.h"
#include "host/pace.h"

namespace fastcycle::host {

SimulatedDriver::SimulatedDriver(base::Clock& clock, unsigned workers)
    : clock_(clock), simulation_(clock, simulated_worker_count(workers)) {}

SimulatedDriver::~SimulatedDriver() {
  join();
}

void SimulatedDriver::join() {
  if (thread_.joinable()) {
    {
      const std::lock_guard lock(mutex_);
      is_over_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  has_hung_ = false;
}

void SimulatedDriver::work() {
  const detail::ServingThread serving;
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return is_over_ || action_; });
    if (!action_) {
      return;
    }
    lock.unlock();
    action_();
    lock.lock();
    action_ = nullptr;
    changed_.notify_all();
  }
}

std::uint64_t SimulatedDriver::activations() const {
  std::uint64_t sum = 0;
  for (const detail::ActivationRing* ring : simulation_.rings().all()) {
    sum += ring->size();
  }
  return sum;
}

bool SimulatedDriver::perform(const std::function<void()>& action) {
  if (has_hung_) {
    return false;
  }
  std::unique_lock lock(mutex_);
  action_ = action;
  changed_.notify_all();
  std::uint64_t seen = activations();
  std::int64_t seen_ns = base::monotonic_ns();
  while (!changed_.wait_for(lock, std::chrono::milliseconds(100), [this] { return !action_; })) {
    const std::int64_t now_ns = base::monotonic_ns();
    // A process that waits for another one's component has not hung.
    if (!is_ending_ || activations() != seen || (peers_ != nullptr && peers_->is_waiting())) {
      seen = activations();
      seen_ns = now_ns;
    } else if (now_ns - seen_ns > std::chrono::nanoseconds(kHangLimit).count()) {
      has_hung_ = true;
      return false;
    }
  }
  return true;
}

void SimulatedDriver::interrupt() noexcept {
  is_ending_ = true;
  simulation_.interrupt();
}

void SimulatedDriver::settle() {
  if (!has_hung_) {
    simulation_.run_now();
  }
}

void SimulatedDriver::drain(std::int64_t) {
  perform([this] { simulation_.run_now(); });
}

void SimulatedDriver::add(detail::Actor& actor, const config::ComponentDescription& component) {
  actor.set_simulated_cost(component.simulated_cost);
  simulation_.add(actor);
}

void SimulatedDriver::set_pace(WallPace& pace) {
  pace_ = &pace;
  pace.on_change = [this] { simulation_.look_again(); };
  simulation_.set_pace(pace);
}

void SimulatedDriver::set_peers(detail::RoundPeers& peers) {
  peers_ = &peers;
  simulation_.set_peers(peers);
}

void SimulatedDriver::start(std::vector<base::Refusal>&) {
  thread_ = std::thread([this] { work(); });
  if (pace_ != nullptr) {
    pace_->begin(clock_.now());
  }
}

std::vector<const detail::ActivationRing*> SimulatedDriver::rings() const {
  const auto& rings = simulation_.rings().all();
  return {rings.begin(), rings.end()};
}

void SimulatedDriver::begin_part(std::uint32_t part) {
  if (has_hung_) {
    return;
  }
  if (part >= kStopPart) {
    is_ending_ = true;
  }
  simulation_.begin_steps(part * kStepsOfPart, (part + 1) * kStepsOfPart);
}

void SimulatedDriver::begin_run(std::uint32_t parts) {
  if (!has_hung_) {
    simulation_.begin_steps(parts * kStepsOfPart, kStopSteps);
  }
}

ControlCall SimulatedDriver::call(detail::Actor& actor, detail::LifeStep step,
                                  std::function<void()> body) {
  ControlCall call;
  actor.post(detail::Cause::kMode, std::move(body), nullptr, detail::to_key(step));
  if (perform([this] { simulation_.run_now(); })) {
    call.end();
  }
  return call;
}

void SimulatedDriver::follow_call() {
  if (peers_ != nullptr) {
    perform([this] { simulation_.run_now(); });
  }
}

TimeDriver::End SimulatedDriver::run(Time limit, Time input_end) {
  simulation_.clear_interrupt();
  if (pace_ != nullptr) {
    pace_->begin(clock_.now());
  }
  auto end = detail::Simulation::End::kInterrupted;
  // Outlives this function, as the action may do.
  const auto reached = std::make_shared<detail::Simulation::End>(end);
  if (perform([this, reached, until = std::min(limit, input_end)] {
        *reached = simulation_.run_until(until);
      })) {
    end = *reached;
  }
  switch (end) {
    case detail::Simulation::End::kReached:
      return input_end <= limit ? End::kInputOver : End::kReached;
    case detail::Simulation::End::kIdle:
      return End::kIdle;
    case detail::Simulation::End::kStuck:
      return End::kStuck;
    case detail::Simulation::End::kInterrupted:
      break;
  }
  return End::kInterrupted;
}

void SimulatedDriver::advance_to(Time time) {
  simulation_.advance_to(time);
}

void SimulatedDriver::await(std::int64_t deadline_ns, const std::function<bool()>& condition) {
  wait_until(deadline_ns, condition);
}

bool SimulatedDriver::submit(std::size_t, detail::Actor& from, std::function<void()> job) {
  from.stage([this, job = std::move(job)] { static_cast<void>(simulation_.submit(job)); });
  return true;
}

}  // namespace fastcycle::host
