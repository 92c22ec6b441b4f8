#include <fastcycle/fastcycle.h>

#include "demo/speed.pb.h"

/// Plans a speed that rises and starts again.
///
/// Out:  `planning/speed`, one message per Serve period
class SpeedPlanner final : public fastcycle::Component {
 public:
  explicit SpeedPlanner(fastcycle::Context& context)
      : Component(context), planned_(context.create_publisher<demo::Speed>("planning/speed")) {}

  void serve() override {
    speed_mps_ = speed_mps_ < 30.0 ? speed_mps_ + 0.1 : 0.0;
    auto out = planned_.loan();
    out->set_mps(speed_mps_);
    planned_.publish(std::move(out));
  }

 private:
  fastcycle::Publisher<demo::Speed> planned_;
  double speed_mps_ = 0.0;
};

FASTCYCLE_COMPONENT(SpeedPlanner)
