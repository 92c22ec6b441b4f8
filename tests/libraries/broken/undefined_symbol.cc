// Uses a function that no library defines.

#include "harmless.h"

extern "C" int function_that_nobody_wrote();

namespace {

class Optimist final : public fastcycle::Component {
 public:
  explicit Optimist(fastcycle::Context& context) : Component(context) {
    report("answer", static_cast<std::int64_t>(function_that_nobody_wrote()));
  }
};

}  // namespace

FASTCYCLE_COMPONENT(Optimist)
