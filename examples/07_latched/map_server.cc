#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

// Publishes its map once.
class MapServer final : public fastcycle::Component {
 public:
  explicit MapServer(fastcycle::Context& context)
      : Component(context), map_(context.create_publisher<example::Map>("map")) {}

  void start() override {
    auto map = map_.loan();
    map->set_name("Karlsruhe");
    map_.publish(std::move(map));
  }

 private:
  fastcycle::Publisher<example::Map> map_;
};

}  // namespace

FASTCYCLE_COMPONENT(MapServer)
