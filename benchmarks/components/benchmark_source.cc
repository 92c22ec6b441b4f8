#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "components/payload.h"
#include "components/results.h"
#include "measure/clock.h"
#include "measure/samples.h"
#include "measure/usage.h"

namespace {

using fastcycle::benchmark::Payload;

/// Publishes a filled payload every interval, as the paper's publisher does, and ends the run after
/// `warmup + count` of them. Optionally records stamps: of the messages that come back on "echo",
/// or of the duration of `publish`.
class BenchmarkSource final : public fastcycle::Component {
 public:
  explicit BenchmarkSource(fastcycle::Context& context)
      : Component(context),
        size_(
            static_cast<std::size_t>(context
                                         .param<std::int64_t>("size_bytes", {.fallback = 32 * 1024,
                                                                             .min = 0,
                                                                             .max = 1 << 30,
                                                                             .unit = "B",
                                                                             .description = {}})
                                         .get())),
        count_(context.param<std::int64_t>("count", {.fallback = 5000, .min = 1}).get()),
        warmup_(context.param<std::int64_t>("warmup", {.fallback = 200, .min = 0}).get()),
        stamps_publish_(context.param<bool>("stamps_publish", {.fallback = false}).get()),
        samples_file_(context.param<fastcycle::Path>("samples", {.fallback = fastcycle::Path()})),
        payload_(context.create_publisher<Payload>(
            "payload", {.prototype = fastcycle::benchmark::prototype(size_)})),
        source_(context.create_source()) {
    const auto interval_us =
        context.param<std::int64_t>("interval_us", {.fallback = 1000, .min = 1, .unit = "µs"});
    context.create_timer({.period = std::chrono::microseconds(interval_us.get())},
                         [this] { send(); });
    const bool takes_echo = context.param<bool>("takes_echo", {.fallback = false}).get();
    if (takes_echo) {
      context.create_subscriber<Payload>("echo", [this](const Payload& echo) { take(echo); });
    }
    if (takes_echo || stamps_publish_) {
      fastcycle::measure::reserve(samples_, warmup_ + count_);
    }
  }

  void stop() override {
    report("sent", std::max<std::int64_t>(number_ - warmup_, 0));
    report("damaged", damaged_);
    fastcycle::benchmark::report_usage(context(), usage_);
    fastcycle::benchmark::report_samples(context(), samples_file_.get(), samples_);
  }

 private:
  void send() {
    if (number_ == warmup_) {
      usage_at_begin_ = fastcycle::measure::Usage::now();
    }
    if (number_ == warmup_ + count_) {
      // One interval after the last message, so that it has arrived.
      if (!is_done_) {
        usage_ = fastcycle::measure::Usage::now() - usage_at_begin_;
      }
      is_done_ = true;
      source_.finish();
      return;
    }
    auto payload = fastcycle::benchmark::make_payload(payload_, size_, number_);
    const std::int64_t made_ns = payload->made_ns();
    const std::int64_t sent_ns = fastcycle::measure::now_ns();
    payload->set_sent_ns(sent_ns);
    payload_.publish(std::move(payload));
    if (stamps_publish_) {
      samples_.push_back({number_, made_ns, sent_ns, fastcycle::measure::now_ns()});
    }
    ++number_;
  }

  void take(const Payload& echo) {
    const std::int64_t arrived_ns = fastcycle::measure::now_ns();
    samples_.push_back({echo.number(), echo.made_ns(), echo.sent_ns(), arrived_ns});
    damaged_ += fastcycle::benchmark::is_whole(echo) ? 0 : 1;
  }

  const std::size_t size_;
  const std::int64_t count_;
  const std::int64_t warmup_;
  const bool stamps_publish_;
  fastcycle::Param<fastcycle::Path> samples_file_;
  fastcycle::Publisher<Payload> payload_;
  fastcycle::Source source_;
  std::int64_t number_ = 0;
  std::int64_t damaged_ = 0;
  bool is_done_ = false;
  fastcycle::measure::Usage usage_at_begin_;
  fastcycle::measure::Usage usage_;
  fastcycle::measure::Samples samples_;
};

}  // namespace

FASTCYCLE_COMPONENT(BenchmarkSource)
