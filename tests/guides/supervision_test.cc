// The code of docs/guides/supervision.md.

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include <gtest/gtest.h>

#include "demo/speed.pb.h"
#include "fastcycle/testing.h"
#include "status/status.pb.h"

namespace {

using fastcycle::status::HEALTH_DEGRADED;
using fastcycle::status::HEALTH_FAILED;
using fastcycle::status::STATE_FAILED;
using fastcycle::status::Status;
using namespace std::chrono_literals;

class Obstacles final : public fastcycle::Component {
 public:
  explicit Obstacles(fastcycle::Context& context)
      : Component(context), lidar_(context.create_latest<demo::Speed>("lidar/points")) {}

  // [snippet health]
  void serve() override {
    const auto age = lidar_.age();
    if (!age || *age > 200ms) {
      health(fastcycle::Health::kDegraded, "no lidar");
    } else {
      health(fastcycle::Health::kOk);
    }
  }
  // [end]

 private:
  fastcycle::Latest<demo::Speed> lidar_;
};

// [snippet supervisor]
class Supervisor final : public fastcycle::Component {
 public:
  explicit Supervisor(fastcycle::Context& context)
      : Component(context), limits_(context.create_publisher<demo::Speed>("supervision/limit")) {
    context.create_subscriber<Status>("/fastcycle/status",
                                      [this](const Status& status) { on_status(status); });
  }

 private:
  void on_status(const Status& status) {
    double mps = 30.0;
    for (const auto& component : status.components()) {
      if (component.state() == STATE_FAILED || component.health() == HEALTH_FAILED) {
        log().error("{}: {}", component.name(), component.last_fault());
        mps = 0.0;
      } else if (component.health() == HEALTH_DEGRADED) {
        mps = std::min(mps, 8.0);
      }
    }
    for (const auto& subscription : status.subscriptions()) {
      if (subscription.topic() == "lidar/points" && subscription.age_ms() > 1000.0) {
        mps = 0.0;
      }
    }
    auto limit = limits_.loan();
    limit->set_mps(mps);
    limits_.publish(std::move(limit));
  }

  fastcycle::Publisher<demo::Speed> limits_;
};
// [end]

class Switcher final : public fastcycle::Component {
 public:
  explicit Switcher(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<Status>("/fastcycle/status",
                                      [this](const Status& status) { on_status(status); });
  }

  // [snippet switch]
  void on_status(const Status& status) {
    const bool has_failed = std::ranges::any_of(status.components(), [](const auto& component) {
      return component.state() == STATE_FAILED;
    });
    if (has_failed && status.mode() != "minimal_risk") {
      context().switch_mode("minimal_risk", "a component failed");
    }
  }
  // [end]
};

/// Fails at its first tick.
class Planner final : public fastcycle::Component {
 public:
  using Component::Component;
  void serve() override { throw std::runtime_error("no plan"); }
};

class Stopper final : public fastcycle::Component {
 public:
  using Component::Component;
  void serve() override { report("stops", true); }
};

// [snippet period]
constexpr const char* kPeriod = R"(
{"status_period_ms": 200}
)";
// [end]

TEST(TheGuideOfSupervision, LimitsTheSpeed) {
  fastcycle::testing::Bench bench;
  bench.configure(kPeriod);
  bench.add<Obstacles>("obstacles", R"({"serve_period_ms": 50})");
  bench.add<Supervisor>("supervisor");
  auto lidar = bench.input<demo::Speed>("lidar/points");
  auto limits = bench.output<demo::Speed>("supervision/limit");
  bench.start();
  const auto last_limit = [&] {
    const auto all = limits.take();
    return all.empty() ? -1.0 : all.back().mps();
  };
  EXPECT_EQ(last_limit(), 30.0);

  bench.advance(60ms);  // Nothing has come from the lidar.
  EXPECT_EQ(last_limit(), 8.0);
  lidar.publish({});
  bench.advance(50ms);
  EXPECT_EQ(last_limit(), 30.0);
  bench.advance(300ms);
  EXPECT_EQ(last_limit(), 8.0);
  bench.advance(1s);
  EXPECT_EQ(last_limit(), 0.0);
}

TEST(TheGuideOfSupervision, SwitchesTheMode) {
  fastcycle::testing::Bench bench;
  bench.configure(R"({"modes": {"nominal": {"components": ["planner"]},
                                "minimal_risk": {"components": ["stopper"]}},
                      "initial_mode": "nominal"})");
  bench.add<Planner>("planner", R"({"serve_period_ms": 10})");
  bench.add<Stopper>("stopper", R"({"serve_period_ms": 10})");
  bench.add<Switcher>("switcher");
  bench.start();
  EXPECT_EQ(bench.mode(), "nominal");

  bench.advance(30ms);
  EXPECT_EQ(bench.mode(), "minimal_risk");
  EXPECT_TRUE(std::get<bool>(bench.result("stopper", "stops")));
}

TEST(TheGuideOfSupervision, TestsASupervisorAlone) {
  // [snippet bench]
  fastcycle::testing::Bench bench;
  bench.add<Supervisor>("supervisor");
  auto statuses = bench.input<Status>("fastcycle/status");
  auto limits = bench.output<demo::Speed>("supervision/limit");
  bench.start();

  Status status;
  auto& lidar = *status.add_components();
  lidar.set_name("lidar");
  lidar.set_health(HEALTH_DEGRADED);
  statuses.publish(status);

  EXPECT_EQ(limits.take().at(0).mps(), 8.0);
  // [end]
}

}  // namespace
