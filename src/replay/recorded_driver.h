#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

#include "base/clock.h"
#include "component/time_driver.h"
#include "executor/executor.h"

namespace fastcycle::host {

/// The time driver for executing a recorded run again: it serves no component by itself, since
/// `ExactReplay` decides which activation is next. Each component has a clock of its own, which
/// shows the times of its recorded activations.
///
/// Requests of components are staged while they run, as in simulated time; offloaded work is
/// executed when the stage is handed over.
///
/// @threads  As `TimeDriver`; nothing here is shared between components.
class RecordedDriver final : public TimeDriver {
 public:
  RecordedDriver() = default;

  /// The clock of the component with this number. Between its activations.
  [[nodiscard]] base::Clock& clock(std::size_t component) { return clocks_[component]; }

  [[nodiscard]] bool is_simulated() const noexcept override { return true; }
  [[nodiscard]] bool is_recorded() const noexcept override { return true; }
  [[nodiscard]] const base::Clock& clock_of_next(const base::Clock& application) override;
  void add(detail::Actor& actor, const config::ComponentDescription& component) override;
  void start(std::vector<base::Refusal>&) override {}
  [[nodiscard]] std::vector<const detail::ActivationRing*> rings() const override { return {}; }
  [[nodiscard]] ControlCall call(detail::Actor& actor, detail::LifeStep step,
                                 std::function<void()> body) override;
  End run(Time, Time) override { return End::kIdle; }
  void drain(std::int64_t) override {}
  void stop(const std::function<bool(const detail::Actor&)>&) override {}
  void interrupt() noexcept override {}
  void between_rounds(std::function<void()> action) override { action(); }
  void stage(detail::Actor& from, std::function<void()> action) override;
  [[nodiscard]] bool submit(std::size_t executor, detail::Actor& from,
                            std::function<void()> job) override;

 private:
  /// Ignores readiness.
  class Nobody final : public detail::ReadyQueue, public detail::TimerWatch {
   public:
    void enqueue(std::uint32_t) noexcept override {}
    void wake() noexcept override {}
    void prepare(std::uint32_t) noexcept override {}
    void timer_armed(std::int64_t) noexcept override {}
  };

  Nobody nobody_;
  std::deque<base::Clock> clocks_;  ///< By component.
};

}  // namespace fastcycle::host
