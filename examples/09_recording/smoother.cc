#include <deque>
#include <numeric>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

// The mean of the last speeds.
class Smoother final : public fastcycle::Component {
 public:
  explicit Smoother(fastcycle::Context& context)
      : Component(context),
        window_(context.param<std::size_t>("window", {.fallback = 4, .min = 1, .max = 100})),
        smooth_(context.create_publisher<example::Speed>("smooth_speed")) {
    context.create_subscriber<example::Speed>(
        "speed", [this](const example::Speed& speed) { on_speed(speed.mps()); });
  }

 private:
  void on_speed(double mps) {
    last_.push_back(mps);
    if (last_.size() > window_.get()) {
      last_.pop_front();
    }
    auto smooth = smooth_.loan();
    smooth->set_mps(std::accumulate(last_.begin(), last_.end(), 0.0) /
                    static_cast<double>(last_.size()));
    smooth_.publish(std::move(smooth));
  }

  fastcycle::Param<std::size_t> window_;
  fastcycle::Publisher<example::Speed> smooth_;
  std::deque<double> last_;
};

}  // namespace

FASTCYCLE_COMPONENT(Smoother)
