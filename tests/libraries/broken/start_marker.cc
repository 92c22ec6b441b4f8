// A component without an error, that leaves the file `started` where the program works once it is
// started, and that computes with the smallest of numbers.

#include <chrono>
#include <fstream>
#include <limits>

#include <fastcycle/fastcycle.h>

namespace {

bool keeps_small_numbers() {
  const volatile double smallest = std::numeric_limits<double>::min();
  const volatile double half = smallest / 2;
  return half > 0;
}

class StartMarker final : public fastcycle::Component {
 public:
  explicit StartMarker(fastcycle::Context& context)
      : Component(context),
        kept_in_constructor_(keeps_small_numbers()),
        timer_(context.create_timer({.period = std::chrono::milliseconds(5)}, [this] {
          if (!keeps_small_numbers()) {
            kept_in_timer_ = false;
          }
        })) {}

  void start() override {
    std::ofstream("started") << "yes\n";
    kept_in_start_ = keeps_small_numbers();
  }

  void stop() override {
    report("kept_in_constructor", kept_in_constructor_);
    report("kept_in_start", kept_in_start_);
    report("kept_in_timer", kept_in_timer_);
  }

 private:
  const bool kept_in_constructor_;
  bool kept_in_start_ = false;
  bool kept_in_timer_ = true;
  fastcycle::Timer timer_;
};

}  // namespace

FASTCYCLE_COMPONENT(StartMarker)
