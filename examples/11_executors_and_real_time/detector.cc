#include <chrono>

#include <fastcycle/fastcycle.h>

namespace {

using namespace std::chrono_literals;

// Computes for 30 ms each time that it is served. What it waits for is a clock, for this is a
// lesson; a component that does its work has no other time than now().
class Detector final : public fastcycle::Component {
 public:
  explicit Detector(fastcycle::Context& context) : Component(context) {}

  void serve() override {
    const auto end = std::chrono::steady_clock::now() + 30ms;
    while (std::chrono::steady_clock::now() < end) {
    }
    report("images", ++images_);
  }

 private:
  std::int64_t images_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Detector)
