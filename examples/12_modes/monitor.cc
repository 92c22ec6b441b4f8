#include <chrono>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

using namespace std::chrono_literals;

// Has the application drive on carefully while no scans come.
class Monitor final : public fastcycle::Component {
 public:
  explicit Monitor(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<example::Scan>(
        "scan",
        {.deadline = 300ms,
         .on_event = [this](const fastcycle::QosEvent&) { turn_to("degraded", "no scans"); }},
        [this](const example::Scan&) { turn_to("nominal", "scans are back"); });
  }

 private:
  void turn_to(const char* mode, const char* why) {
    if (context().mode() != mode) {
      log().warning("{}: {}", mode, why);
      context().switch_mode(mode, why);
    }
  }
};

}  // namespace

FASTCYCLE_COMPONENT(Monitor)
