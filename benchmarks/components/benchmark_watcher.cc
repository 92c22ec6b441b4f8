#include <chrono>
#include <cstdint>

#include <fastcycle/fastcycle.h>

#include "benchmark/payload.pb.h"
#include "components/results.h"
#include "measure/clock.h"
#include "measure/samples.h"
#include "measure/usage.h"

namespace {

using fastcycle::benchmark::Payload;

/// Records for each event of its deadline when the deadline expired, on the application's clock,
/// and when its callback was entered, on CLOCK_MONOTONIC.
class BenchmarkWatcher final : public fastcycle::Component {
 public:
  explicit BenchmarkWatcher(fastcycle::Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 2000, .min = 1}).get()),
        warmup_(context.param<std::int64_t>("warmup", {.fallback = 100, .min = 0}).get()),
        deadline_(std::chrono::microseconds(
            context.param<std::int64_t>("interval_us", {.fallback = 2000, .min = 1, .unit = "µs"})
                .get())),
        samples_file_(context.param<fastcycle::Path>("samples", {.fallback = fastcycle::Path()})),
        source_(context.create_source()) {
    if (!samples_file_.get().empty()) {
      fastcycle::measure::reserve(samples_, warmup_ + count_);
    }
    context.create_subscriber<Payload>(
        "stalled",
        {.deadline = deadline_,
         .on_event = [this](const fastcycle::QosEvent& event) { take(event); }},
        [](const Payload&) {});
  }

  void stop() override {
    report("events", number_);
    fastcycle::benchmark::report_usage(context(), usage_);
    fastcycle::benchmark::report_samples(context(), samples_file_.get(), samples_);
  }

 private:
  void take(const fastcycle::QosEvent& event) {
    const std::int64_t arrived_ns = fastcycle::measure::now_ns();
    if (event.kind != fastcycle::QosKind::kDeadlineMissed || number_ == warmup_ + count_) {
      return;
    }
    if (number_ == warmup_) {
      at_begin_ = fastcycle::measure::Usage::now();
    }
    if (event.since != since_) {
      since_ = event.since;  // The message itself may still wait in the queue.
      reported_before_ = reported_;
    }
    // The first period since the last message without an event.
    const auto period = static_cast<std::int64_t>(reported_ - reported_before_) + 1;
    reported_ = event.count;
    if (!samples_file_.get().empty()) {
      const std::int64_t due_ns = (event.since + period * deadline_).time_since_epoch().count();
      samples_.push_back({number_, due_ns, due_ns, arrived_ns});
    }
    if (++number_ == warmup_ + count_) {
      usage_ = fastcycle::measure::Usage::now() - at_begin_;
      source_.finish();
    }
  }

  const std::int64_t count_;
  const std::int64_t warmup_;
  const fastcycle::Duration deadline_;
  fastcycle::Param<fastcycle::Path> samples_file_;
  fastcycle::Source source_;
  std::int64_t number_ = 0;
  std::uint64_t reported_ = 0;         ///< Periods.
  fastcycle::Time since_;              ///< When the last message was published.
  std::uint64_t reported_before_ = 0;  ///< Before that message.
  fastcycle::measure::Usage at_begin_;
  fastcycle::measure::Usage usage_;
  fastcycle::measure::Samples samples_;
};

}  // namespace

FASTCYCLE_COMPONENT(BenchmarkWatcher)
