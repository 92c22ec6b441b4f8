#include <chrono>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

using namespace std::chrono_literals;

// Works at its own pace, and is never called for a speed.
class Display final : public fastcycle::Component {
 public:
  explicit Display(fastcycle::Context& context)
      : Component(context),
        newest_(context.create_latest<example::Speed>("speed")),
        last_second_(context.create_history<example::Speed>("speed", {.depth = 100, .span = 1s})) {}

  void serve() override {
    const auto newest = newest_.get();
    if (!newest) {
      log().info("no speed yet");
      return;
    }
    double sum_mps = 0.0;
    for (std::size_t i = 0; i < last_second_.size(); ++i) {
      sum_mps += last_second_[i]->mps();
    }
    log().info("{} m/s, {} ms old; {:.1f} m/s in the last second", newest->mps(),
               std::chrono::floor<std::chrono::milliseconds>(*newest_.age()).count(),
               sum_mps / static_cast<double>(last_second_.size()));
  }

 private:
  fastcycle::Latest<example::Speed> newest_;
  fastcycle::History<example::Speed> last_second_;
};

}  // namespace

FASTCYCLE_COMPONENT(Display)
