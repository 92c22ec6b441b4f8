// Our side of each pair of docs/guides/from_cyberrt.md.

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "config/load.h"
#include "config/problem.h"
#include "config/test_folder.h"
#include "demo/route.pb.h"
#include "demo/speed.pb.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace {

using namespace std::chrono_literals;

demo::Speed speed_of(double mps) {
  demo::Speed speed;
  speed.set_mps(mps);
  return speed;
}

class Limiter final : public fastcycle::Component {
 public:
  explicit Limiter(fastcycle::Context& context)
      : Component(context),
        limit_mps_(context.param<double>("limit_mps")),
        limited_(context.create_publisher<demo::Speed>("limited")) {
    context.create_subscriber<demo::Speed>(
        "planned", [this](const demo::Speed& planned) { on_planned(planned); });
  }

 private:
  void on_planned(const demo::Speed& planned) {
    auto out = limited_.loan();
    out->set_mps(std::min(planned.mps(), limit_mps_.get()));
    limited_.publish(std::move(out));
  }

  fastcycle::Param<double> limit_mps_;
  fastcycle::Publisher<demo::Speed> limited_;
};

TEST(TheGuideFromCyberRt, HasComponents) {
  fastcycle::testing::Bench bench;
  bench.add<Limiter>("limiter", R"({"params": {"limit_mps": 10}})");
  auto planned = bench.input<demo::Speed>("planned");
  auto limited = bench.output<demo::Speed>("limited");
  bench.start();

  planned.publish(speed_of(33.0));

  EXPECT_EQ(limited.take().at(0).mps(), 10.0);
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

class Fusion final : public fastcycle::Component {
 public:
  explicit Fusion(fastcycle::Context& context) : Component(context) {
    context.create_synchronizer<demo::Speed, demo::Speed>(
        {"camera/speed", "radar/speed"}, {.policy = fastcycle::SyncPolicy::kLatest},
        [this](const demo::Speed& camera, const demo::Speed& radar) {
          report("mean_mps", 0.5 * (camera.mps() + radar.mps()));
        });
  }
};

class Display final : public fastcycle::Component {
 public:
  explicit Display(fastcycle::Context& context)
      : Component(context), planned_(context.create_latest<demo::Speed>("planned")) {}

  void serve() override {
    if (const auto planned = planned_.get()) {
      report("mps", planned->mps());
    }
  }

 private:
  fastcycle::Latest<demo::Speed> planned_;
};

TEST(TheGuideFromCyberRt, HasTimerComponentsFusionAndObservers) {
  fastcycle::testing::Bench bench;
  bench.add<Planner>("planner", R"({"serve_period_ms": 100})");
  bench.add<Display>("display", R"({"serve_period_ms": 50})");
  bench.add<Fusion>("fusion");
  auto camera = bench.input<demo::Speed>("camera/speed");
  auto radar = bench.input<demo::Speed>("radar/speed");
  bench.start();

  bench.advance(150ms);
  EXPECT_EQ(std::get<double>(bench.result("display", "mps")), 12.0);
  radar.publish(speed_of(4.0));
  camera.publish(speed_of(3.0));
  EXPECT_EQ(std::get<double>(bench.result("fusion", "mean_mps")), 3.5);
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
    routes_.call(std::move(request), {.deadline = 1s},
                 [this](const fastcycle::Reply<demo::RouteReply>& reply) {
                   report("length_m", reply.ok() ? reply->length_m() : -1.0);
                 });
  }

 private:
  fastcycle::Client<demo::Route, demo::RouteReply> routes_;
};

TEST(TheGuideFromCyberRt, AsksAndAnswers) {
  fastcycle::testing::Bench bench;
  bench.add<Router>("router");
  bench.add<Passenger>("passenger", R"({"serve_period_ms": 50})");
  bench.start();

  bench.advance(50ms);

  EXPECT_EQ(std::get<double>(bench.result("passenger", "length_m")), 60.0);
}

class Detector final : public fastcycle::Component {
 public:
  explicit Detector(fastcycle::Context& context)
      : Component(context), found_(context.create_publisher<demo::Speed>("found")) {
    context.create_subscriber<demo::Speed>("image", [this](const demo::Speed& image) {
      auto result = std::make_shared<double>(0.0);
      this->context().offload(
          "background", [result, seen = image.mps()] { *result = 2.0 * seen; },
          [this, result] {
            auto found = found_.loan();
            found->set_mps(*result);
            found_.publish(std::move(found));
          });
    });
  }

 private:
  fastcycle::Publisher<demo::Speed> found_;
};

TEST(TheGuideFromCyberRt, WorksBesideItsCallbacks) {
  fastcycle::testing::Bench bench;
  bench.add<Detector>("detector");
  bench.configure(R"({"executors": [{"name": "background"}]})");
  auto images = bench.input<demo::Speed>("image");
  auto found = bench.output<demo::Speed>("found");
  bench.start();

  images.publish(speed_of(21.0));

  EXPECT_EQ(found.take().at(0).mps(), 42.0);
}

TEST(TheGuideFromCyberRt, ItsApplicationsHaveNoError) {
  for (const char* text : {R"(
{
  "name": "car",
  "components": [
    {"name": "planner", "library": "planner", "serve_period_ms": 100},
    {"name": "limiter", "library": "limiter", "params": {"limit_mps": 22.2},
     "subscribers": {"planned": {"depth": 4}}}
  ]
}
)",
                           R"(
{
  "name": "car",
  "executors": [
    {"name": "control", "threads": 1, "cpus": [1], "policy": "fifo", "priority": 80},
    {"name": "perception", "threads": 2, "cpus": [2, 3]}
  ],
  "components": [
    {"name": "limiter", "library": "limiter", "executor": "control"},
    {"name": "detector", "library": "detector", "executor": "perception"}
  ]
}
)"}) {
    const fastcycle::config::TestFolder folder;
    fastcycle::config::LoadOptions options;
    options.file = folder.write("app.json", text);
    fastcycle::config::Problems problems;

    EXPECT_EQ(fastcycle::config::load(options, problems).name, "car");

    EXPECT_TRUE(problems.all().empty());
  }
}

}  // namespace
