#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

// Speeds up by 1 m/s each time that it measures.
class Speedometer final : public fastcycle::Component {
 public:
  explicit Speedometer(fastcycle::Context& context)
      : Component(context), speed_(context.create_publisher<example::Speed>("speed")) {}

  void serve() override {
    auto measured = speed_.loan();
    measured->set_mps(++mps_);
    speed_.publish(std::move(measured));
  }

 private:
  fastcycle::Publisher<example::Speed> speed_;
  double mps_ = 0.0;
};

}  // namespace

FASTCYCLE_COMPONENT(Speedometer)
