#include <chrono>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

using namespace std::chrono_literals;
using fastcycle::Sample;

// Sees what camera and lidar saw at about the same time.
class Fusion final : public fastcycle::Component {
 public:
  explicit Fusion(fastcycle::Context& context) : Component(context) {
    context.create_synchronizer<example::Scan, example::Scan>(
        {"camera/scan", "lidar/scan"},
        {.policy = fastcycle::SyncPolicy::kApproximate, .max_difference = 30ms},
        [this](const Sample<example::Scan>& camera, const Sample<example::Scan>& lidar) {
          const auto apart = lidar.info().origin.taken - camera.info().origin.taken;
          log().info("camera {} and lidar {}, taken {} ms apart", camera->number(), lidar->number(),
                     apart / 1ms);
          report("pairs", ++pairs_);
        });
  }

 private:
  std::int64_t pairs_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Fusion)
