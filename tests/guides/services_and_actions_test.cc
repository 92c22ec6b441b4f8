// The code of docs/guides/services_and_actions.md.

#include <chrono>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "demo/route.pb.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace {

using namespace std::chrono_literals;

// [snippet navigator]
class Navigator final : public fastcycle::Component {
 public:
  explicit Navigator(fastcycle::Context& context)
      : Component(context),
        routes_(context.create_client<demo::Route, demo::RouteReply>("plan_route")) {}

  void serve() override {
    auto request = routes_.loan();
    request->set_goal("garage");
    routes_.call(std::move(request), {.deadline = 100ms},
                 [this](const fastcycle::Reply<demo::RouteReply>& reply) {
                   if (!reply.ok()) {
                     log().warning("{}", reply.error());  // "plan_route": late, 100 ms are over
                     return;
                   }
                   report("length_m", reply->length_m());
                 });
  }

 private:
  fastcycle::Client<demo::Route, demo::RouteReply> routes_;
};
// [end]

// [snippet planner]
class Planner final : public fastcycle::Component {
 public:
  explicit Planner(fastcycle::Context& context) : Component(context) {
    context.create_service<demo::Route, demo::RouteReply>(
        "plan_route", [](const demo::Route& request, demo::RouteReply& reply) {
          reply.set_length_m(10.0 * static_cast<double>(request.goal().size()));
        });
  }
};
// [end]

// [snippet surveyor]
class Surveyor final : public fastcycle::Component {
 public:
  explicit Surveyor(fastcycle::Context& context)
      : Component(context),
        routes_(context.create_client<demo::Route, demo::RouteReply>("plan_route")) {
    context.create_service<demo::Route, demo::RouteReply>(
        "survey",
        [this](const demo::Route& request, fastcycle::Responder<demo::RouteReply> responder) {
          if (request.goal().empty()) {
            responder.reject("a survey needs a goal");
            return;
          }
          waiting_.push_back(std::move(responder));
          auto next = routes_.loan();
          next->set_goal(request.goal());
          routes_.call(std::move(next), {.deadline = 50ms},
                       [this](const fastcycle::Reply<demo::RouteReply>& reply) { answer(reply); });
        });
  }

 private:
  void answer(const fastcycle::Reply<demo::RouteReply>& reply) {
    auto responder = std::move(waiting_.front());
    waiting_.pop_front();
    if (reply.ok()) {
      responder.answer(*reply);
    } else {
      responder.reject(reply.error());
    }
  }

  fastcycle::Client<demo::Route, demo::RouteReply> routes_;
  std::deque<fastcycle::Responder<demo::RouteReply>> waiting_;
};
// [end]

// [snippet parker]
class Parker final : public fastcycle::Component {
 public:
  explicit Parker(fastcycle::Context& context) : Component(context) {
    context.create_action_server<demo::Park, demo::ParkProgress, demo::Parked>(
        "park", {.max_goals = 1}, [this](const demo::Park& goal, Goal accepted) {
          if (goal.place() < 0) {
            accepted.reject("there is no such place");
            return;
          }
          goal_ = std::move(accepted);  // Kept: accepted.
        });
  }

  void serve() override {
    if (!goal_ || !goal_->is_active()) {
      return;  // Nothing to do, or cancelled.
    }
    distance_m_ += 0.5;
    if (distance_m_ >= 2.0) {
      auto result = goal_->loan();
      result->set_distance_m(distance_m_);
      goal_->succeed(std::move(result));
      return;
    }
    auto progress = goal_->loan_feedback();
    progress->set_distance_m(distance_m_);
    goal_->publish(std::move(progress));
  }

 private:
  using Goal = fastcycle::ServerGoal<demo::ParkProgress, demo::Parked>;

  std::optional<Goal> goal_;
  double distance_m_ = 0.0;
};
// [end]

// [snippet driver]
class Driver final : public fastcycle::Component {
 public:
  explicit Driver(fastcycle::Context& context)
      : Component(context),
        parker_(
            context.create_action_client<demo::Park, demo::ParkProgress, demo::Parked>("park")) {
    context.create_subscriber<demo::Park>("wish", [this](const demo::Park& wish) {
      auto goal = parker_.loan();
      goal->CopyFrom(wish);
      parking_ = parker_.send(std::move(goal),
                              {.call = {.deadline = 60s},
                               .on_feedback =
                                   [this](const demo::ParkProgress& progress) {
                                     report("on_the_way_m", progress.distance_m());
                                   }},
                              [this](const fastcycle::Reply<demo::Parked>& result) {
                                report("parked", fastcycle::to_word(result.status()));
                              });
    });
    context.create_subscriber<demo::Route>("stop",
                                           [this](const demo::Route&) { parking_.cancel(); });
  }

 private:
  fastcycle::ActionClient<demo::Park, demo::ParkProgress, demo::Parked> parker_;
  fastcycle::Call parking_;
};
// [end]

TEST(GuideToServices, CallsAndServes) {
  fastcycle::testing::Bench bench;
  bench.add<Navigator>("navigator", R"({"serve_period_ms": 10})");
  bench.add<Planner>("planner");
  bench.start();
  bench.advance(10ms);
  EXPECT_EQ(bench.result("navigator", "length_m"), fastcycle::ReportValue(60.0));
}

TEST(GuideToServices, AnswersLater) {
  // [snippet bench]
  fastcycle::testing::Bench bench;
  bench.add<Surveyor>("surveyor");
  bench.service<demo::Route, demo::RouteReply>(
      "plan_route", [](const demo::Route&, demo::RouteReply& reply) { reply.set_length_m(12.0); });
  auto survey = bench.client<demo::Route, demo::RouteReply>("survey");
  bench.start();

  demo::Route request;
  request.set_goal("garage");
  const auto answer = survey.call(request);

  ASSERT_TRUE(answer.ok()) << answer.error();
  EXPECT_EQ(answer->length_m(), 12.0);
  // [end]

  EXPECT_EQ(survey.call(demo::Route()).error(), "\"survey\": rejected, a survey needs a goal");
}

/// Waits half way, and stops it there, or not.
std::string parked(bool is_stopped) {
  fastcycle::testing::Bench bench;
  bench.add<Parker>("parker", R"({"serve_period_ms": 10})");
  bench.add<Driver>("driver");
  auto wish = bench.input<demo::Park>("wish");
  auto stop = bench.input<demo::Route>("stop");
  bench.start();
  wish.publish(demo::Park());
  bench.advance(20ms);
  EXPECT_EQ(bench.result("driver", "on_the_way_m"), fastcycle::ReportValue(1.0));
  if (is_stopped) {
    stop.publish(demo::Route());
  } else {
    bench.advance(20ms);
  }
  return std::get<std::string>(bench.result("driver", "parked"));
}

TEST(GuideToServices, ParksUnlessItIsStopped) {
  EXPECT_EQ(parked(false), "ok");
  EXPECT_EQ(parked(true), "cancelled");
}

}  // namespace
