#include <chrono>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

// Takes a scan each time that it is served, and needs a while to get it out. It loses every fifth.
class Sensor final : public fastcycle::Component {
 public:
  explicit Sensor(fastcycle::Context& context)
      : Component(context),
        delay_ms_(context.param<std::int64_t>("delay_ms", {.fallback = 0, .min = 0, .max = 90})),
        loses_(context.param<bool>("loses", {.fallback = false})),
        scans_(context.create_publisher<example::Scan>("scan")),
        out_(context.create_timer([this] { send(); })) {}

  void serve() override {
    ++number_;
    taken_ = now();
    out_.arm_at(now() + std::chrono::milliseconds(delay_ms_.get()));
  }

 private:
  void send() {
    if (loses_.get() && number_ % 5 == 0) {
      return;
    }
    auto scan = scans_.loan();
    scan->set_number(number_);
    scans_.publish(std::move(scan), {.taken_at = taken_});
  }

  fastcycle::Param<std::int64_t> delay_ms_;
  fastcycle::Param<bool> loses_;
  fastcycle::Publisher<example::Scan> scans_;
  fastcycle::Timer out_;
  fastcycle::Time taken_{};
  int number_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Sensor)
