#include <chrono>
#include <cstdint>

#include <fastcycle/fastcycle.h>

#include "components/results.h"
#include "measure/clock.h"
#include "measure/samples.h"
#include "measure/usage.h"

namespace {

/// Records for each tick of a timer when it was due, on the application's clock, and when its
/// callback was entered, on CLOCK_MONOTONIC.
class BenchmarkTimer final : public fastcycle::Component {
 public:
  explicit BenchmarkTimer(fastcycle::Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 5000, .min = 1}).get()),
        warmup_(context.param<std::int64_t>("warmup", {.fallback = 200, .min = 0}).get()),
        samples_file_(context.param<fastcycle::Path>("samples", {.fallback = fastcycle::Path()})),
        source_(context.create_source()) {
    const auto interval_us =
        context.param<std::int64_t>("interval_us", {.fallback = 1000, .min = 1, .unit = "µs"});
    if (!samples_file_.get().empty()) {
      fastcycle::measure::reserve(samples_, warmup_ + count_);
    }
    context.create_timer({.period = std::chrono::microseconds(interval_us.get())},
                         [this](const fastcycle::Tick& tick) { take(tick); });
  }

  void stop() override {
    report("ticks", number_);
    report("skipped", skipped_);
    report("skipped_at_first", skipped_at_first_);
    report("first_due_ns", (first_due_ - start_time()).count());
    report("last_due_ns", (last_due_ - start_time()).count());
    fastcycle::benchmark::report_usage(context(), usage_);
    fastcycle::benchmark::report_samples(context(), samples_file_.get(), samples_);
  }

 private:
  void take(const fastcycle::Tick& tick) {
    const std::int64_t arrived_ns = fastcycle::measure::now_ns();
    if (number_ == warmup_ + count_) {
      return;
    }
    if (number_ == 0) {
      first_due_ = tick.due;
      skipped_at_first_ = static_cast<std::int64_t>(tick.skipped);
    }
    if (number_ == warmup_) {
      at_begin_ = fastcycle::measure::Usage::now();
    }
    last_due_ = tick.due;
    skipped_ += static_cast<std::int64_t>(tick.skipped);
    if (!samples_file_.get().empty()) {
      const std::int64_t due_ns = tick.due.time_since_epoch().count();
      samples_.push_back({number_, due_ns, due_ns, arrived_ns});
    }
    if (++number_ == warmup_ + count_) {
      usage_ = fastcycle::measure::Usage::now() - at_begin_;
      source_.finish();
    }
  }

  const std::int64_t count_;
  const std::int64_t warmup_;
  fastcycle::Param<fastcycle::Path> samples_file_;
  fastcycle::Source source_;
  std::int64_t number_ = 0;
  std::int64_t skipped_ = 0;
  std::int64_t skipped_at_first_ = 0;
  fastcycle::Time first_due_{};
  fastcycle::Time last_due_{};
  fastcycle::measure::Usage at_begin_;
  fastcycle::measure::Usage usage_;
  fastcycle::measure::Samples samples_;
};

}  // namespace

FASTCYCLE_COMPONENT(BenchmarkTimer)
