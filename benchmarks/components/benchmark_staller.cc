#include <chrono>
#include <cstdint>

#include <fastcycle/fastcycle.h>

#include "benchmark/payload.pb.h"
#include "measure/clock.h"

namespace {

using fastcycle::benchmark::Payload;

/// Publishes once, then blocks its worker for ten periods, repeatedly.
class BenchmarkStaller final : public fastcycle::Component {
 public:
  explicit BenchmarkStaller(fastcycle::Context& context)
      : Component(context),
        interval_us_(
            context.param<std::int64_t>("interval_us", {.fallback = 2000, .min = 1, .unit = "µs"})),
        payloads_(context.create_publisher<Payload>("stalled")) {
    context.create_timer({.period = std::chrono::microseconds(12 * interval_us_.get())}, [this] {
      payloads_.publish(payloads_.loan());
      fastcycle::measure::sleep_until(fastcycle::measure::now_ns() +
                                      10 * 1000 * interval_us_.get());
    });
  }

 private:
  fastcycle::Param<std::int64_t> interval_us_;
  fastcycle::Publisher<Payload> payloads_;
};

}  // namespace

FASTCYCLE_COMPONENT(BenchmarkStaller)
