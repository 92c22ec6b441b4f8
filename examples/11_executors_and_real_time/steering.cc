#include <chrono>

#include <fastcycle/fastcycle.h>

namespace {

using namespace std::chrono_literals;

// Has to come every 10 ms, and counts how often it came more than 5 ms late.
class Steering final : public fastcycle::Component {
 public:
  explicit Steering(fastcycle::Context& context) : Component(context) {
    context.create_timer({.period = 10ms}, [this](const fastcycle::Tick& tick) {
      report("ticks", ++ticks_);
      late_ += now() - tick.due > 5ms || tick.skipped > 0 ? 1 : 0;
      report("late", late_);
    });
  }

 private:
  std::int64_t ticks_ = 0;
  std::int64_t late_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Steering)
