#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

class Listener final : public fastcycle::Component {
 public:
  explicit Listener(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<example::Text>("hello", [this](const example::Text& message) {
      log().info("I hear: {}", message.text());
      report("received", ++received_);
    });
  }

 private:
  std::int64_t received_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Listener)
