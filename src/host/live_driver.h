#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "base/clock.h"
#include "component/bell.h"
#include "component/time_driver.h"

namespace fastcycle::host {

/// The machine's clock: owns the executors of an application, and waits for them.
///
/// @threads  As `TimeDriver`.
class LiveDriver final : public TimeDriver {
 public:
  /// `bell` is rung when work ends that the control thread waits for.
  LiveDriver(const base::Clock& clock, const config::ApplicationDescription& application,
             Bell& bell);

  [[nodiscard]] bool is_simulated() const noexcept override { return false; }
  void add(detail::Actor& actor, const config::ComponentDescription& component) override;
  [[nodiscard]] bool is_real_time() const override { return is_real_time_; }
  void start(std::vector<base::Refusal>& refusals) override;
  [[nodiscard]] std::vector<const detail::ActivationRing*> rings() const override;
  void use_rings(std::span<detail::ActivationRing* const> rings) override;
  [[nodiscard]] ControlCall call(detail::Actor& actor, detail::LifeStep step,
                                 std::function<void()> body) override;
  End run(Time limit, Time input_end) override;
  void drain(std::int64_t deadline_ns) override;
  void refuse_jobs() override;
  void stop(const std::function<bool(const detail::Actor&)>& is_stuck) override;
  [[nodiscard]] bool may_serve(const detail::Actor& actor) const override;
  void join() override;
  void interrupt() noexcept override;
  void between_rounds(std::function<void()> action) override { action(); }
  void stage(detail::Actor&, std::function<void()> action) override { action(); }
  [[nodiscard]] bool submit(std::size_t executor, detail::Actor& from,
                            std::function<void()> job) override;

 private:
  /// Further data of one executor.
  struct Its {
    std::vector<const detail::Actor*> actors = {};
    std::atomic<int> jobs{0};  ///< Running offloaded jobs.
    std::atomic<bool> refuses_jobs{false};
    bool is_stopped = false;
  };

  [[nodiscard]] std::size_t executor_of(const config::ComponentDescription& component) const;

  const base::Clock& clock_;
  Bell& bell_;
  bool is_real_time_ = false;
  std::vector<std::unique_ptr<Its>> its_;  ///< By executor.
  std::atomic<bool> is_interrupted_{false};
};

}  // namespace fastcycle::host
