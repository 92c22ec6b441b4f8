#include <cstdint>
#include <optional>

#include <fastcycle/fastcycle.h>

#include "components/payload.h"
#include "components/results.h"
#include "measure/clock.h"
#include "measure/samples.h"

namespace {

using fastcycle::benchmark::Payload;

/// Takes the stamp of each received payload; optionally sends it back on "echo".
class BenchmarkSink final : public fastcycle::Component {
 public:
  explicit BenchmarkSink(fastcycle::Context& context)
      : Component(context),
        samples_file_(context.param<fastcycle::Path>("samples", {.fallback = fastcycle::Path()})) {
    fastcycle::measure::reserve(
        samples_, context.param<std::int64_t>("expected", {.fallback = 6000, .min = 0}).get());
    if (context.param<bool>("echoes", {.fallback = false}).get()) {
      echo_ = context.create_publisher<Payload>("echo");
      context.create_subscriber<Payload>(
          "payload",
          [this](const fastcycle::Sample<Payload>& payload) { echo_->publish(payload); });
    } else {
      context.create_subscriber<Payload>("payload",
                                         [this](const Payload& payload) { take(payload); });
    }
  }

  void stop() override {
    report("damaged", damaged_);
    fastcycle::benchmark::report_samples(context(), samples_file_.get(), samples_);
  }

 private:
  void take(const Payload& payload) {
    const std::int64_t arrived_ns = fastcycle::measure::now_ns();
    samples_.push_back({payload.number(), payload.made_ns(), payload.sent_ns(), arrived_ns});
    damaged_ += fastcycle::benchmark::is_whole(payload) ? 0 : 1;
  }

  fastcycle::Param<fastcycle::Path> samples_file_;
  std::optional<fastcycle::Publisher<Payload>> echo_;
  fastcycle::measure::Samples samples_;
  std::int64_t damaged_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(BenchmarkSink)
