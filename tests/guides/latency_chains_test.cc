// The code of docs/guides/latency_chains.md.

#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <unistd.h>

#include "config/load.h"
#include "demo/speed.pb.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/test_application.h"

namespace {

using namespace std::chrono_literals;

class Lidar final : public fastcycle::Component {
 public:
  explicit Lidar(fastcycle::Context& context)
      : Component(context), points_(context.create_publisher<demo::Speed>("lidar/points")) {}

 private:
  fastcycle::Publisher<demo::Speed> points_;
};

class Planner final : public fastcycle::Component {
 public:
  explicit Planner(fastcycle::Context& context)
      : Component(context), commands_(context.create_publisher<demo::Speed>("vehicle/command")) {
    context.create_subscriber<demo::Speed>(
        "lidar/points", [this](const demo::Speed&) { commands_.publish(commands_.loan()); });
  }

 private:
  fastcycle::Publisher<demo::Speed> commands_;
};

class Brake final : public fastcycle::Component {
 public:
  explicit Brake(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<demo::Speed>("vehicle/command", [](const demo::Speed&) {});
  }
};

TEST(TheGuideToLatencyChains, SwitchesTheModeWhenTheyTakeTooLong) {
  // [snippet test]
  fastcycle::testing::Bench bench;
  bench.add<Planner>("planner");
  bench.add<Brake>("brake");
  bench.configure(R"({"modes": {"nominal": {"components": ["planner"]}, "degraded": {}},
                      "initial_mode": "nominal",
                      "chains": [{"name": "lidar_to_brake", "from": "lidar/points",
                                  "to": "vehicle/command", "deadline_ms": 100,
                                  "on_breach": "degrade", "mode": "degraded"}]})");
  auto points = bench.input<demo::Speed>("lidar/points");
  bench.start();

  points.publish({}, {.taken_at = bench.now() - 100ms});
  EXPECT_EQ(bench.mode(), "nominal");
  points.publish({}, {.taken_at = bench.now() - 101ms});
  EXPECT_EQ(bench.mode(), "degraded");
  // [end]
}

TEST(TheGuideToLatencyChains, HasAConfigurationThatFitsTogether) {
  const auto file = std::filesystem::path(::testing::TempDir()) /
                    ("chains_" + std::to_string(::getpid()) + ".json");
  std::ofstream(file) << R"(
// [snippet chains]
{
  "name": "car",
  "modes": {"nominal": {"components": ["planner"]}, "degraded": {}},
  "initial_mode": "nominal",
  "chains": [
    {"name": "lidar_to_brake", "from": "lidar/points", "to": "vehicle/command", "deadline_ms": 100,
     "on_breach": "degrade", "mode": "degraded"}
  ],
  "components": [
    {"name": "lidar", "library": "lidar"},
    {"name": "planner", "library": "planner"},
    {"name": "brake", "library": "brake"}
  ]
}
// [end]
)";
  fastcycle::config::Problems problems;
  auto description = fastcycle::config::load({.file = file}, problems);
  std::filesystem::remove(file);
  fastcycle::host::TestClasses classes;
  classes.with<Lidar>("lidar").with<Planner>("planner").with<Brake>("brake");
  fastcycle::host::Application application(std::move(description), {.is_simulated = true});
  application.build(classes, problems, fastcycle::host::ConstructorFault::kError);

  EXPECT_TRUE(problems.all().empty());
  EXPECT_EQ(application.chains().report().size(), 1U);
}

}  // namespace
