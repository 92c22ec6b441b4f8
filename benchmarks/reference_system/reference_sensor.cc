#include <chrono>
#include <cstdint>

#include "reference_system/node.h"

namespace fastcycle::benchmark {
namespace {

/// A driver: a sample each period.
class ReferenceSensor final : public Component {
 public:
  explicit ReferenceSensor(Context& context) : Component(context), out_(context, "out", 0) {
    const auto period_ms =
        context.param<std::int64_t>("period_ms", {.min = 1, .max = 10'000, .unit = "ms"});
    context.create_timer(
        {.period = std::chrono::milliseconds(period_ms.get()), .phase = phase_param(context)},
        [this] { out_.publish({}, measure::now_ns()); });
  }

 private:
  ReferenceOutput out_;
};

}  // namespace
}  // namespace fastcycle::benchmark

FASTCYCLE_COMPONENT(fastcycle::benchmark::ReferenceSensor)
