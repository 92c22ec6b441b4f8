#include <cstdint>
#include <filesystem>
#include <optional>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "benchmark/payload.pb.h"
#include "measure/clock.h"
#include "measure/payload.h"
#include "measure/samples.h"
#include "measure/usage.h"

namespace {

using fastcycle::benchmark::Payload;

/// Publishes a filled payload every interval, as the paper's publisher does. Where it is asked to,
/// it also takes the stamps of the messages that come back on "echo". It ends the run when it has
/// published `warmup + count` messages.
class BenchmarkSource final : public fastcycle::Component {
 public:
  explicit BenchmarkSource(fastcycle::Context& context)
      : Component(context),
        size_(context.param<std::int64_t>(
            "size_bytes",
            {.fallback = 32 * 1024, .min = 0, .max = 1 << 30, .unit = "B", .description = {}})),
        count_(context.param<std::int64_t>("count", {.fallback = 5000, .min = 1})),
        warmup_(context.param<std::int64_t>("warmup", {.fallback = 200, .min = 0})),
        samples_file_(context.param<fastcycle::Path>("samples", {.fallback = fastcycle::Path()})),
        payload_(context.create_publisher<Payload>("payload", {.prototype = prototype()})),
        source_(context.create_source()) {
    const auto interval_us =
        context.param<std::int64_t>("interval_us", {.fallback = 1000, .min = 1, .unit = "µs"});
    context.create_timer({.period = std::chrono::microseconds(interval_us.get())},
                         [this] { send(); });
    if (context.param<bool>("takes_echo", {.fallback = false}).get()) {
      samples_.reserve(static_cast<std::size_t>(total()));
      context.create_subscriber<Payload>("echo", [this](const Payload& echo) { take(echo); });
    }
  }

  void stop() override {
    report("sent", count_.get());
    report("cpu_us", usage_.cpu_us);
    report("minor_faults", usage_.minor_faults);
    report("major_faults", usage_.major_faults);
    report("voluntary_switches", usage_.voluntary_switches);
    report("involuntary_switches", usage_.involuntary_switches);
    if (!samples_file_.get().empty()) {
      report("samples", fastcycle::measure::write_samples(samples_file_.get(), samples_));
    }
  }

 private:
  [[nodiscard]] std::int64_t total() const { return warmup_.get() + count_.get(); }
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(size_.get()); }

  [[nodiscard]] Payload prototype() const {
    Payload payload;
    payload.mutable_data()->assign(size(), '\0');
    return payload;
  }

  void send() {
    if (number_ == warmup_.get()) {
      usage_at_begin_ = fastcycle::measure::Usage::now();
    }
    if (number_ == total()) {
      // One interval after the last message, so that it has arrived.
      usage_ = fastcycle::measure::Usage::now() - usage_at_begin_;
      source_.finish();
    }
    if (number_ >= total()) {
      ++number_;
      return;
    }
    const std::int64_t made_ns = fastcycle::measure::now_ns();
    auto payload = payload_.loan_uncleared();
    payload->mutable_data()->resize(size());
    fastcycle::measure::fill(payload->mutable_data()->data(), size(), number_);
    payload->set_number(number_++);
    payload->set_made_ns(made_ns);
    payload->set_sent_ns(fastcycle::measure::now_ns());
    payload_.publish(std::move(payload));
  }

  void take(const Payload& echo) {
    const std::int64_t arrived_ns = fastcycle::measure::now_ns();
    samples_.push_back({echo.number(), echo.made_ns(), echo.sent_ns(), arrived_ns});
  }

  fastcycle::Param<std::int64_t> size_;
  fastcycle::Param<std::int64_t> count_;
  fastcycle::Param<std::int64_t> warmup_;
  fastcycle::Param<fastcycle::Path> samples_file_;
  fastcycle::Publisher<Payload> payload_;
  fastcycle::Source source_;
  std::int64_t number_ = 0;
  fastcycle::measure::Usage usage_at_begin_;
  fastcycle::measure::Usage usage_;
  fastcycle::measure::Samples samples_;
};

}  // namespace

FASTCYCLE_COMPONENT(BenchmarkSource)
