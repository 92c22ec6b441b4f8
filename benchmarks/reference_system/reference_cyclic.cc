#include <chrono>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "reference_system/node.h"

namespace fastcycle::benchmark {
namespace {

/// Publishes a sample each period, made from those that its inputs "in_0", "in_1", … have got since
/// the one before.
class ReferenceCyclic final : public Component {
 public:
  explicit ReferenceCyclic(Context& context)
      : Component(context), out_(context, "out", crunch_param(context)) {
    const auto period_ms =
        context.param<std::int64_t>("period_ms", {.min = 1, .max = 10'000, .unit = "ms"});
    const auto count = context.param<std::int64_t>("inputs", {.min = 1, .max = 16});
    for (std::int64_t i = 0; i < count.get(); ++i) {
      ReferenceInput& input = inputs_.emplace_back();
      pointers_.push_back(&input);
      context.create_subscriber<ReferenceSample>(
          "in_" + std::to_string(i), kNewest,
          [&input](const Sample<ReferenceSample>& sample) { input.take(sample); });
    }
    context.create_timer(
        {.period = std::chrono::milliseconds(period_ms.get()), .phase = phase_param(context)},
        [this] { out_.publish(pointers_, measure::now_ns()); });
  }

 private:
  ReferenceOutput out_;
  std::deque<ReferenceInput> inputs_;
  std::vector<ReferenceInput*> pointers_;
};

}  // namespace
}  // namespace fastcycle::benchmark

FASTCYCLE_COMPONENT(fastcycle::benchmark::ReferenceCyclic)
