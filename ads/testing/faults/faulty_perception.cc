#include <chrono>
#include <stdexcept>
#include <thread>

#include <fastcycle/fastcycle.h>

#include "lidar/sweep.pb.h"
#include "modules/perception/perception.h"

namespace ads {

enum class PerceptionFault { kException, kStall };

/// Perception that fails once, with the first sweep that comes `after_s` after its start or later.
class FaultyPerception final : public Perception {
 public:
  explicit FaultyPerception(fastcycle::Context& context)
      : Perception(context),
        fault_(context.param<PerceptionFault>("fault",
                                              {.fallback = PerceptionFault::kException,
                                               .names = {{"exception", PerceptionFault::kException},
                                                         {"stall", PerceptionFault::kStall}},
                                               .description = "Kind of fault"})),
        after_s_(context.param<double>("after_s", {.fallback = 5.0, .min = 0.0, .unit = "s"})),
        stall_s_(context.param<double>("stall_s", {.fallback = 3.0, .min = 0.0, .unit = "s"})) {
    context.create_subscriber<lidar::Sweep>("lidar/points",
                                            [this](const lidar::Sweep&) { fail_once(); });
  }

 private:
  void fail_once() {
    const std::chrono::duration<double> age = now() - start_time();
    if (has_failed_ || age.count() < after_s_.get()) {
      return;
    }
    has_failed_ = true;
    if (fault_.get() == PerceptionFault::kException) {
      throw std::runtime_error("a fault on purpose");
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(stall_s_.get()));
  }

  fastcycle::Param<PerceptionFault> fault_;
  fastcycle::Param<double> after_s_;
  fastcycle::Param<double> stall_s_;
  bool has_failed_ = false;
};

}  // namespace ads

FASTCYCLE_COMPONENT(ads::FaultyPerception)
