#include <array>
#include <cstddef>
#include <string>

#include "reference_system/node.h"

namespace fastcycle::benchmark {
namespace {

/// Two transforms in one component: "in_0" to "out_0", and "in_1" to "out_1".
class ReferenceIntersection final : public Component {
 public:
  explicit ReferenceIntersection(Context& context)
      : Component(context),
        outputs_{ReferenceOutput(context, "out_0", crunch_param(context, "crunch_0")),
                 ReferenceOutput(context, "out_1", crunch_param(context, "crunch_1"))} {
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      context.create_subscriber<ReferenceSample>(
          "in_" + std::to_string(i), kNewest,
          [this, i](const Sample<ReferenceSample>& sample) { take(i, sample); });
    }
  }

 private:
  void take(std::size_t i, const Sample<ReferenceSample>& sample) {
    const std::int64_t begin_ns = measure::now_ns();
    inputs_[i].take(sample);
    ReferenceInput* const input = &inputs_[i];
    outputs_[i].publish({&input, 1}, begin_ns);
  }

  std::array<ReferenceInput, 2> inputs_;
  std::array<ReferenceOutput, 2> outputs_;
};

}  // namespace
}  // namespace fastcycle::benchmark

FASTCYCLE_COMPONENT(fastcycle::benchmark::ReferenceIntersection)
