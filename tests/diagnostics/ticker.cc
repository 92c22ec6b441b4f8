// Counts, for components that break at some number.

#include <cstdint>

#include <fastcycle/fastcycle.h>

#include "blame/count.pb.h"

namespace {

class Ticker final : public fastcycle::Component {
 public:
  explicit Ticker(fastcycle::Context& context)
      : Component(context), counts_(context.create_publisher<blame::Count>("counts")) {}

  void serve() override {
    auto count = counts_.loan();
    count->set_value(++value_);
    counts_.publish(std::move(count));
  }

 private:
  fastcycle::Publisher<blame::Count> counts_;
  std::int64_t value_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Ticker)
