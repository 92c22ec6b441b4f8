#include <array>
#include <chrono>
#include <string>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

using namespace std::chrono_literals;

// Asks for a route every second, and waits for none of them.
class Passenger final : public fastcycle::Component {
 public:
  explicit Passenger(fastcycle::Context& context)
      : Component(context),
        routes_(context.create_client<example::RouteRequest, example::Route>("plan_route")) {}

  void serve() override {
    const std::string goal = kGoals.at(asked_++ % kGoals.size());
    auto request = routes_.loan();
    request->set_goal(goal);
    routes_.call(std::move(request), {.deadline = 800ms},
                 [this, goal](const fastcycle::Reply<example::Route>& reply) {
                   if (reply.ok()) {
                     log().info("to the {} it is {} m", goal, reply->length_m());
                   } else {
                     log().warning("{}", reply.error());
                   }
                 });
    log().info("asked for \"{}\"", goal);
  }

 private:
  static constexpr std::array kGoals{"garage", "", "supermarket"};
  fastcycle::Client<example::RouteRequest, example::Route> routes_;
  std::size_t asked_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(Passenger)
