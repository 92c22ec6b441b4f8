#include <chrono>
#include <optional>
#include <stdexcept>
#include <string>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

// Asks for the map only when it needs it, and fails once on the way.
class Navigator final : public fastcycle::Component {
 public:
  explicit Navigator(fastcycle::Context& context) : Component(context) {}

  void serve() override {
    if (!subscription_) {
      subscription_ = context().create_subscriber<example::Map>(
          "map", [this](const example::Map& map) { map_ = map.name(); });
      return;
    }
    log().info("I drive {}", map_.empty() ? "without a map" : "by the map of " + map_);
    if (now() - start_time() == std::chrono::seconds(3)) {
      throw std::runtime_error("a bug");
    }
  }

 private:
  std::optional<fastcycle::Subscriber> subscription_;
  std::string map_;
};

}  // namespace

FASTCYCLE_COMPONENT(Navigator)
