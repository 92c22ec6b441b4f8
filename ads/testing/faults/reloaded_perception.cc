#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>

#include <fastcycle/fastcycle.h>

#include "modules/perception/perception.h"

namespace ads {

enum class ReloadFault { kNone, kException, kHang, kSlow };

/// Perception with the topics, the state and the params of `ads/perception`, which takes its place
/// while the vehicle drives, and may fail shortly after that.
class ReloadedPerception final : public Perception {
 public:
  explicit ReloadedPerception(fastcycle::Context& context)
      : Perception(context),
        fault_(
            context.param<ReloadFault>("fault", {.fallback = ReloadFault::kNone,
                                                 .names = {{"none", ReloadFault::kNone},
                                                           {"exception", ReloadFault::kException},
                                                           {"hang", ReloadFault::kHang},
                                                           {"slow", ReloadFault::kSlow}},
                                                 .description = "Kind of fault"})),
        stall_ms_(
            context.param<double>("stall_ms", {.fallback = 100.0, .min = 0.0, .unit = "ms"})) {
    context.create_timer({.period = std::chrono::milliseconds(50)}, [this] { fail(); });
  }

 private:
  void fail() {
    switch (fault_.get()) {
      case ReloadFault::kNone:
        break;
      case ReloadFault::kException:
        throw std::runtime_error("a fault on purpose");
      case ReloadFault::kHang:
      case ReloadFault::kSlow:  // In small pieces: each is in time, and all together are late.
        std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(stall_ms_.get()));
        break;
    }
  }

  fastcycle::Param<ReloadFault> fault_;
  fastcycle::Param<double> stall_ms_;
};

}  // namespace ads

FASTCYCLE_COMPONENT(ads::ReloadedPerception)
