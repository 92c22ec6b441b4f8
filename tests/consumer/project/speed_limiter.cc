#include <fastcycle/fastcycle.h>
#include "demo/speed.pb.h"

class SpeedLimiter final : public fastcycle::Component {
 public:
  explicit SpeedLimiter(fastcycle::Context& context)
      : Component(context),
        limit_mps_(context.param<double>("limit_mps", {.fallback = 13.9, .min = 0.0, .max = 60.0})),
        limited_(context.create_publisher<demo::Speed>("control/speed")) {
    context.create_subscriber<demo::Speed>(
        "planning/speed", [this](const demo::Speed& planned) { on_planned(planned); });
  }

  void serve() override { /* the Serve Timer: every "serve_period_ms" */ }

 private:
  void on_planned(const demo::Speed& planned) {
    auto out = limited_.loan();                       // recycled, no allocation
    out->set_mps(std::min(planned.mps(), limit_mps_.get()));
    limited_.publish(std::move(out));
  }

  fastcycle::Param<double> limit_mps_;
  fastcycle::Publisher<demo::Speed> limited_;
};

FASTCYCLE_COMPONENT(SpeedLimiter)
