#include <chrono>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

// Publishes the speed that it is configured for, while it is active.
class Planner final : public fastcycle::Component {
 public:
  explicit Planner(fastcycle::Context& context)
      : Component(context),
        mps_(context.param<double>("mps")),
        speed_(context.create_publisher<example::Speed>("speed")) {}

  void activate() override { log().info("I plan"); }
  void deactivate() override { log().info("I rest"); }

  void serve() override {
    auto speed = speed_.loan();
    speed->set_mps(mps_.get());
    speed_.publish(std::move(speed));
  }

 private:
  fastcycle::Param<double> mps_;
  fastcycle::Publisher<example::Speed> speed_;
};

// Scans, but not between the first second and the second.
class Scanner final : public fastcycle::Component {
 public:
  explicit Scanner(fastcycle::Context& context)
      : Component(context), scans_(context.create_publisher<example::Scan>("scan")) {}

  void serve() override {
    const auto since_start = now() - start_time();
    if (since_start < std::chrono::seconds(1) || since_start > std::chrono::seconds(2)) {
      scans_.publish(scans_.loan());
    }
  }

 private:
  fastcycle::Publisher<example::Scan> scans_;
};

// Drives as fast as the speed that it receives.
class Vehicle final : public fastcycle::Component {
 public:
  explicit Vehicle(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<example::Speed>("speed", [this](const example::Speed& speed) {
      if (speed.mps() != mps_) {
        mps_ = speed.mps();
        log().info("{} m/s", mps_);
      }
    });
  }

 private:
  double mps_ = 0.0;
};

}  // namespace

FASTCYCLE_COMPONENTS(Planner, Scanner, Vehicle)
