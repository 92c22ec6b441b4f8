#include <chrono>
#include <optional>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

using namespace std::chrono_literals;
using fastcycle::Responder;

// Plans one route at a time: so many tenths of a second as the goal has letters.
class Router final : public fastcycle::Component {
 public:
  explicit Router(fastcycle::Context& context)
      : Component(context), planned_(context.create_timer([this] { answer(); })) {
    context.create_service<example::RouteRequest, example::Route>(
        "plan_route",
        [this](const example::RouteRequest& request, Responder<example::Route> responder) {
          if (request.goal().empty()) {
            responder.reject("a route needs a goal");
            return;
          }
          length_m_ = 1000.0 * static_cast<double>(request.goal().size());
          owed_.emplace(std::move(responder));
          planned_.arm_at(now() + 100ms * request.goal().size());
        });
  }

 private:
  void answer() {
    example::Route route;
    route.set_length_m(length_m_);
    owed_->answer(route);
    owed_.reset();
  }

  std::optional<Responder<example::Route>> owed_;
  fastcycle::Timer planned_;
  double length_m_ = 0.0;
};

}  // namespace

FASTCYCLE_COMPONENT(Router)
