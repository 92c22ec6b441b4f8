#include <chrono>

#include <fastcycle/fastcycle.h>

namespace {

using namespace std::chrono_literals;

// A direction indicator: on every 600 ms, off 250 ms later, and a look at the bulb every second.
class Blinker final : public fastcycle::Component {
 public:
  explicit Blinker(fastcycle::Context& context)
      : Component(context), off_(context.create_timer([this] { say("off"); })) {
    context.create_timer({.period = 1s, .phase = 50ms}, [this](const fastcycle::Tick& tick) {
      say("the bulb is well");
      late_ += now() > tick.due ? 1 : 0;
    });
  }

  void serve() override {
    say("on");
    off_.arm_at(now() + 250ms);
  }

  void stop() override { report("late_looks", late_); }

 private:
  void say(std::string_view what) {
    const auto since_start = std::chrono::floor<std::chrono::milliseconds>(now() - start_time());
    log().info("{:4} ms: {}", since_start.count(), what);
  }

  fastcycle::Timer off_;
  std::int64_t late_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Blinker)
