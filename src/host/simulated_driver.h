#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "component/time_driver.h"
#include "executor/simulation.h"

namespace fastcycle::host {

/// Simulated time: owns the simulation, which serves components by rounds, and the thread that runs
/// it.
///
/// The control thread waits for that thread. If the run is to end and no activation ends for
/// `kHangLimit`, a component does not return: then the control thread continues without it, and
/// nothing is served any more. `advance_to` and `settle` run on the thread that calls them.
///
/// @threads  As `TimeDriver`.
class SimulatedDriver final : public TimeDriver {
 public:
  /// `workers` 0: as many as the machine has CPUs.
  SimulatedDriver(base::Clock& clock, unsigned workers);
  ~SimulatedDriver() override;

  [[nodiscard]] bool is_simulated() const noexcept override { return true; }
  void add(detail::Actor& actor, const config::ComponentDescription& component) override;
  void set_watcher(const detail::Actor& actor) override { simulation_.set_watcher(actor); }
  void set_feed(detail::Feed& feed) override { simulation_.set_feed(feed); }
  void set_pace(WallPace& pace) override;
  void set_peers(detail::RoundPeers& peers) override;
  void after_round(std::function<void(std::uint32_t step)> action) override {
    simulation_.after_round = std::move(action);
  }
  void start(std::vector<base::Refusal>& refusals) override;
  [[nodiscard]] std::vector<const detail::ActivationRing*> rings() const override;
  void use_rings(std::span<detail::ActivationRing* const> rings) override {
    simulation_.use_rings(rings);
  }
  void begin_part(std::uint32_t part) override;
  void begin_run(std::uint32_t parts) override;
  [[nodiscard]] ControlCall call(detail::Actor& actor, detail::LifeStep step,
                                 std::function<void()> body) override;
  void follow_call() override;
  End run(Time limit, Time input_end) override;
  void advance_to(Time time) override;
  void settle() override;
  void drain(std::int64_t) override;
  void stop(const std::function<bool(const detail::Actor&)>&) override {}
  [[nodiscard]] bool may_serve(const detail::Actor&) const override { return has_hung_; }
  void join() override;
  void interrupt() noexcept override;
  void between_rounds(std::function<void()> action) override {
    simulation_.call(std::move(action));
  }
  void foreign_thread_begins() noexcept override { simulation_.foreign_thread_begins(); }
  void foreign_thread_ends() noexcept override { simulation_.foreign_thread_ends(); }
  void hold() noexcept override { simulation_.hold(); }
  void let_go() noexcept override { simulation_.let_go(); }
  [[nodiscard]] detail::Stage* external_stage() noexcept override { return &simulation_; }
  void stage(detail::Actor& from, std::function<void()> action) override {
    from.stage(std::move(action));
  }
  void await(std::int64_t deadline_ns, const std::function<bool()>& condition) override;
  [[nodiscard]] bool submit(std::size_t executor, detail::Actor& from,
                            std::function<void()> job) override;
  void serve_first(std::vector<std::uint32_t> components) override {
    simulation_.serve_first(std::move(components));
  }

 private:
  static constexpr std::chrono::seconds kHangLimit{4};

  /// Executes `action` on the thread of the simulation. False if a component does not return.
  bool perform(const std::function<void()>& action);
  void work();
  [[nodiscard]] std::uint64_t activations() const;

  base::Clock& clock_;
  detail::Simulation simulation_;
  WallPace* pace_ = nullptr;
  detail::RoundPeers* peers_ = nullptr;
  std::atomic<bool> is_ending_{false};
  bool has_hung_ = false;

  // Between the control thread and the other one.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::function<void()> action_;  ///< The pending or running action; else empty.
  bool is_over_ = false;
  std::thread thread_;
};

}  // namespace fastcycle::host
