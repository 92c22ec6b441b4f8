// Our side of each pair of docs/guides/from_ros2.md.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "config/load.h"
#include "config/problem.h"
#include "config/test_folder.h"
#include "demo/route.pb.h"
#include "demo/speed.pb.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "fastcycle/transforms.h"
#include "transform/transform.pb.h"

namespace {

using namespace std::chrono_literals;

demo::Speed speed_of(double mps) {
  demo::Speed speed;
  speed.set_mps(mps);
  return speed;
}

class Planner final : public fastcycle::Component {
 public:
  explicit Planner(fastcycle::Context& context)
      : Component(context), planned_(context.create_publisher<demo::Speed>("planned")) {}

  void serve() override {
    auto message = planned_.loan();
    message->set_mps(12.0);
    planned_.publish(std::move(message));
  }

 private:
  fastcycle::Publisher<demo::Speed> planned_;
};

class Limiter final : public fastcycle::Component {
 public:
  explicit Limiter(fastcycle::Context& context)
      : Component(context),
        limit_mps_(context.param<double>(
            "limit_mps", {.fallback = 13.9, .min = 0.0, .max = 60.0, .is_tunable = true})),
        limited_(context.create_publisher<demo::Speed>("limited")) {
    context.on_change(limit_mps_, [this](double limit_mps) { log().info("now {}", limit_mps); });
    context.create_subscriber<demo::Speed>("planned", [this](const demo::Speed& planned) {
      auto out = limited_.loan();
      out->set_mps(std::min(planned.mps(), limit_mps_.get()));
      limited_.publish(std::move(out));
    });
  }

 private:
  fastcycle::Param<double> limit_mps_;
  fastcycle::Publisher<demo::Speed> limited_;
};

TEST(TheGuideFromRos2, PublishesSubscribesAndHasParams) {
  fastcycle::testing::Bench bench;
  bench.add<Planner>("planner", R"({"serve_period_ms": 100})");
  bench.add<Limiter>("limiter", R"({"params": {"limit_mps": 10}})");
  auto limited = bench.output<demo::Speed>("limited");
  bench.start();

  bench.advance(100ms);
  EXPECT_EQ(limited.take().at(0).mps(), 10.0);
  EXPECT_TRUE(bench.change_params({{"limiter.limit_mps", "11"}}).has_changed());
  EXPECT_FALSE(bench.change_params({{"limiter.limit_mps", "61"}}).has_changed());
  bench.advance(100ms);
  EXPECT_EQ(limited.take().at(0).mps(), 11.0);
}

class Watchdog final : public fastcycle::Component {
 public:
  explicit Watchdog(fastcycle::Context& context)
      : Component(context),
        alarms_(context.create_publisher<demo::Speed>("alarm")),
        silent_(context.create_timer([this] { alarms_.publish(alarms_.loan()); })) {
    context.create_subscriber<demo::Speed>(
        "planned", [this](const demo::Speed&) { silent_.arm_at(now() + 200ms); });
  }

 private:
  fastcycle::Publisher<demo::Speed> alarms_;
  fastcycle::Timer silent_;
};

class Reader final : public fastcycle::Component {
 public:
  explicit Reader(fastcycle::Context& context)
      : Component(context), speed_(context.create_latest<demo::Speed>("planned")) {}

  void serve() override {
    if (const auto speed = speed_.get()) {
      report("mps", speed->mps());
    }
  }

 private:
  fastcycle::Latest<demo::Speed> speed_;
};

TEST(TheGuideFromRos2, HasTimersAndTheNewestMessage) {
  fastcycle::testing::Bench bench;
  bench.add<Watchdog>("watchdog");
  bench.add<Reader>("reader", R"({"serve_period_ms": 50})");
  auto planned = bench.input<demo::Speed>("planned");
  auto alarms = bench.output<demo::Speed>("alarm");
  bench.start();

  planned.publish(speed_of(7.0));
  bench.advance(199ms);
  EXPECT_TRUE(alarms.take().empty());
  bench.advance(1ms);

  EXPECT_EQ(alarms.take().size(), 1U);
  EXPECT_EQ(std::get<double>(bench.result("reader", "mps")), 7.0);
}

class Router final : public fastcycle::Component {
 public:
  explicit Router(fastcycle::Context& context) : Component(context) {
    context.create_service<demo::Route, demo::RouteReply>(
        "plan_route", [](const demo::Route& request, demo::RouteReply& reply) {
          reply.set_length_m(10.0 * static_cast<double>(request.goal().size()));
        });
  }
};

class Passenger final : public fastcycle::Component {
 public:
  explicit Passenger(fastcycle::Context& context)
      : Component(context),
        routes_(context.create_client<demo::Route, demo::RouteReply>("plan_route")) {}

  void serve() override {
    auto request = routes_.loan();
    request->set_goal("garage");
    routes_.call(std::move(request), {.deadline = 100ms},
                 [this](const fastcycle::Reply<demo::RouteReply>& reply) {
                   report("length_m", reply.ok() ? reply->length_m() : -1.0);
                 });
  }

 private:
  fastcycle::Client<demo::Route, demo::RouteReply> routes_;
};

TEST(TheGuideFromRos2, AsksAndAnswers) {
  fastcycle::testing::Bench bench;
  bench.add<Router>("router");
  bench.add<Passenger>("passenger", R"({"serve_period_ms": 50})");
  bench.start();

  bench.advance(50ms);

  EXPECT_EQ(std::get<double>(bench.result("passenger", "length_m")), 60.0);
}

class Parker final : public fastcycle::Component {
 public:
  using Goal = fastcycle::ServerGoal<demo::ParkProgress, demo::Parked>;

  explicit Parker(fastcycle::Context& context) : Component(context) {
    context.create_action_server<demo::Park, demo::ParkProgress, demo::Parked>(
        "park", {.max_goals = 1},
        [this](const demo::Park&, Goal accepted) { goal_ = std::move(accepted); });
  }

  void serve() override {
    if (!goal_ || !goal_->is_active()) {
      return;  // Nothing to do, or cancelled.
    }
    driven_m_ += 0.5;
    if (driven_m_ < 1.0) {
      auto progress = goal_->loan_feedback();
      progress->set_distance_m(driven_m_);
      goal_->publish(std::move(progress));
    } else {
      auto parked = goal_->loan();
      parked->set_distance_m(driven_m_);
      goal_->succeed(std::move(parked));
    }
  }

 private:
  std::optional<Goal> goal_;
  double driven_m_ = 0.0;
};

class Driver final : public fastcycle::Component {
 public:
  explicit Driver(fastcycle::Context& context)
      : Component(context),
        parker_(
            context.create_action_client<demo::Park, demo::ParkProgress, demo::Parked>("park")) {}

  void activate() override {
    parker_.send(
        parker_.loan(),
        {.call = {.deadline = 60s},
         .on_feedback = [this](const demo::ParkProgress& p) { report("way_m", p.distance_m()); }},
        [this](const fastcycle::Reply<demo::Parked>& result) {
          report("parked", fastcycle::to_word(result.status()));
        });
  }

 private:
  fastcycle::ActionClient<demo::Park, demo::ParkProgress, demo::Parked> parker_;
};

TEST(TheGuideFromRos2, HasActions) {
  fastcycle::testing::Bench bench;
  bench.add<Parker>("parker", R"({"serve_period_ms": 50})");
  bench.add<Driver>("driver");
  bench.start();

  bench.advance(200ms);

  EXPECT_EQ(std::get<double>(bench.result("driver", "way_m")), 0.5);
  EXPECT_EQ(std::get<std::string>(bench.result("driver", "parked")), "ok");
}

class Brake final : public fastcycle::Component {
 public:
  explicit Brake(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<demo::Speed>(
        "planned",
        {.depth = 4,
         .deadline = 100ms,
         .on_event =
             [this](const fastcycle::QosEvent& event) {
               if (event.kind == fastcycle::QosKind::kDeadlineMissed) {
                 report("braked", true);
               }
             }},
        [this](const demo::Speed& planned) { report("mps", planned.mps()); });
  }
};

TEST(TheGuideFromRos2, HasQualityOfService) {
  fastcycle::testing::Bench bench;
  bench.add<Brake>("brake");
  auto planned = bench.input<demo::Speed>("planned");
  bench.start();

  planned.publish(speed_of(3.0));
  bench.advance(101ms);

  EXPECT_EQ(std::get<double>(bench.result("brake", "mps")), 3.0);
  EXPECT_TRUE(std::get<bool>(bench.result("brake", "braked")));
}

class Fusion final : public fastcycle::Component {
 public:
  explicit Fusion(fastcycle::Context& context) : Component(context) {
    context.create_synchronizer<demo::Speed, demo::Speed>(
        {"camera/speed", "radar/speed"},
        {.policy = fastcycle::SyncPolicy::kApproximate, .max_difference = 20ms},
        [this](const demo::Speed& camera, const demo::Speed& radar) {
          report("mean_mps", 0.5 * (camera.mps() + radar.mps()));
        });
  }
};

TEST(TheGuideFromRos2, Synchronizes) {
  fastcycle::testing::Bench bench;
  bench.add<Fusion>("fusion");
  auto camera = bench.input<demo::Speed>("camera/speed");
  auto radar = bench.input<demo::Speed>("radar/speed");
  bench.start();

  camera.publish(speed_of(3.0));
  bench.advance(15ms);
  radar.publish(speed_of(4.0));

  EXPECT_EQ(std::get<double>(bench.result("fusion", "mean_mps")), 3.5);
}

class Tracker final : public fastcycle::Component {
 public:
  explicit Tracker(fastcycle::Context& context)
      : Component(context),
        tree_(context, {.moving = {{"localization/base", "map", "base_link"}}, .max_hold = 50ms}) {
    context.create_subscriber<demo::Speed>("ahead_m", [this](const demo::Speed& ahead) {
      if (const auto base_to_map = tree_.a_to_b("base_link", "map", now())) {
        const auto in_map = *base_to_map * fastcycle::transforms::Vector{ahead.mps(), 0.0, 0.0};
        report("east_m", in_map.x);
      } else {
        log().warning("{}", base_to_map.error().why);
      }
    });
  }

 private:
  fastcycle::transforms::Tree tree_;
};

TEST(TheGuideFromRos2, KnowsWhereThingsAre) {
  fastcycle::testing::Bench bench;
  bench.add<Tracker>("tracker");
  auto poses = bench.input<transform::Transform>("localization/base");
  auto ahead = bench.input<demo::Speed>("ahead_m");
  bench.start();

  transform::Transform pose;
  fastcycle::transforms::to_message(
      "map", "base_link", {.taken = bench.now(), .child_to_parent = {{100.0, 0.0, 0.0}, {}}}, pose);
  poses.publish(pose);
  ahead.publish(speed_of(5.0));

  EXPECT_EQ(std::get<double>(bench.result("tracker", "east_m")), 105.0);
}

class Camera final : public fastcycle::Component {
 public:
  explicit Camera(fastcycle::Context& context) : Component(context) {}

  void start() override { is_open_ = true; }        // Configure: acquire the device.
  void activate() override { is_on_ = true; }       // Activate.
  void deactivate() override { is_on_ = false; }    // Deactivate.
  void stop() override { is_open_ = false; }        // Clean up.
  void serve() override { report("image", true); }  // Only while it is active.

 private:
  bool is_open_ = false;
  bool is_on_ = false;
};

TEST(TheGuideFromRos2, HasALifeCycle) {
  fastcycle::testing::Bench bench;
  bench.add<Camera>("camera", R"({"serve_period_ms": 50})");
  bench.start();

  bench.advance(50ms);
  bench.deactivate("camera");

  EXPECT_FALSE(bench.is_active("camera"));
  EXPECT_TRUE(std::get<bool>(bench.result("camera", "image")));
}

TEST(TheGuideFromRos2, IsTestedWithoutWaiting) {
  fastcycle::testing::Bench bench;
  bench.add<Limiter>("limiter", R"({"params": {"limit_mps": 10}})");
  auto planned = bench.input<demo::Speed>("planned");
  auto limited = bench.output<demo::Speed>("limited");
  bench.start();

  planned.publish(speed_of(33.0));

  EXPECT_EQ(limited.take().at(0).mps(), 10.0);
}

void expect_no_error(const char* text) {
  const fastcycle::config::TestFolder folder;
  fastcycle::config::LoadOptions options;
  options.file = folder.write("app.json", text);
  fastcycle::config::Problems problems;

  EXPECT_EQ(fastcycle::config::load(options, problems).name, "car");

  EXPECT_TRUE(problems.all().empty());
}

TEST(TheGuideFromRos2, ItsApplicationsHaveNoError) {
  expect_no_error(R"(
{
  "name": "car",
  "components": [
    {"name": "planner", "library": "planner", "serve_period_ms": 100},
    {"name": "limiter", "library": "limiter", "params": {"limit_mps": 22.2},
     "remap": {"planned": "planning/speed"}}
  ]
}
)");
  expect_no_error(R"(
{
  "name": "car",
  "topics": {"map": {"latched": 1}},
  "components": [{"name": "map_server", "library": "map_server"}]
}
)");
  expect_no_error(R"(
{
  "name": "car",
  "executors": [
    {"name": "control", "threads": 1, "cpus": [1], "policy": "fifo", "priority": 80},
    {"name": "perception", "threads": 3}
  ],
  "components": [
    {"name": "steering", "library": "steering", "executor": "control"},
    {"name": "detector", "library": "detector", "executor": "perception"}
  ]
}
)");
}

}  // namespace
