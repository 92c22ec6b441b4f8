#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

class Talker final : public fastcycle::Component {
 public:
  explicit Talker(fastcycle::Context& context)
      : Component(context), hello_(context.create_publisher<example::Text>("hello")) {}

  void serve() override {
    auto message = hello_.loan();
    message->set_text(fmt::format("hello {}", ++count_));
    hello_.publish(std::move(message));
  }

 private:
  fastcycle::Publisher<example::Text> hello_;
  int count_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Talker)
