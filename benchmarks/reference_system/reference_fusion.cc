#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "reference_system/node.h"

namespace fastcycle::benchmark {
namespace {

/// Publishes a sample when each of its inputs "in_0", "in_1" has a new one; with one input, for
/// each sample (a transform).
class ReferenceFusion final : public Component {
 public:
  explicit ReferenceFusion(Context& context)
      : Component(context), out_(context, "out", crunch_param(context)) {
    count_ = static_cast<std::size_t>(
        context.param<std::int64_t>("inputs", {.fallback = 1, .min = 1, .max = 2}).get());
    for (std::size_t i = 0; i < count_; ++i) {
      pointers_[i] = &inputs_[i];
      context.create_subscriber<ReferenceSample>(
          "in_" + std::to_string(i), kNewest,
          [this, i](const Sample<ReferenceSample>& sample) { take(inputs_[i], sample); });
    }
  }

 private:
  void take(ReferenceInput& input, const Sample<ReferenceSample>& sample) {
    const std::int64_t begin_ns = measure::now_ns();
    input.take(sample);
    const std::span<ReferenceInput* const> inputs(pointers_.data(), count_);
    if (std::ranges::all_of(inputs, &ReferenceInput::has_sample)) {
      out_.publish(inputs, begin_ns);
    }
  }

  ReferenceOutput out_;
  std::size_t count_ = 1;
  std::array<ReferenceInput, 2> inputs_;
  std::array<ReferenceInput*, 2> pointers_{};
};

}  // namespace
}  // namespace fastcycle::benchmark

FASTCYCLE_COMPONENT(fastcycle::benchmark::ReferenceFusion)
