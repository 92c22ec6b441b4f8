#include "replay/stand_in.h"

#include "component/component_core.h"
#include "component/component_host.h"
#include "fastcycle/component.h"

namespace fastcycle::host {
namespace {

class StandIn final : public Component {
 public:
  explicit StandIn(Context& context) : Component(context) {
    context.core().application.declare_replayed(context.core());
  }
};

constexpr ComponentClass kStandIn{"StandIn", &fastcycle::detail::create_component<StandIn>,
                                  &fastcycle::detail::destroy_component<StandIn>};

}  // namespace

const ComponentClass& stand_in_class() noexcept {
  return kStandIn;
}

}  // namespace fastcycle::host
