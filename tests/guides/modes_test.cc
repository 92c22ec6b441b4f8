// The code of docs/guides/modes.md.

#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
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

// [snippet monitor]
class Monitor final : public fastcycle::Component {
 public:
  explicit Monitor(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<demo::Speed>("measured", [this](const demo::Speed& measured) {
      if (measured.mps() > 40.0) {
        this->context().switch_mode("degraded", "too fast to plan for");
      }
    });
  }
};
// [end]

class Planner final : public fastcycle::Component {
 public:
  explicit Planner(fastcycle::Context& context) : Component(context) {}
};

TEST(TheGuideToModes, SwitchesAndTests) {
  // [snippet test]
  fastcycle::testing::Bench bench;
  bench.add<Monitor>("monitor");
  bench.add<Planner>("planner");
  bench.configure(R"({"modes": {"nominal": {"components": ["planner"]}, "degraded": {}},
                      "initial_mode": "nominal"})");
  auto measured = bench.input<demo::Speed>("measured");
  bench.start();
  EXPECT_TRUE(bench.is_active("planner"));

  demo::Speed fast;
  fast.set_mps(50.0);
  measured.publish(fast);

  EXPECT_EQ(bench.mode(), "degraded");
  EXPECT_FALSE(bench.is_active("planner"));
  bench.switch_mode("nominal");
  EXPECT_TRUE(bench.is_active("planner"));
  // [end]
}

/// Loads an application from a file that says this, and builds it.
std::unique_ptr<fastcycle::host::Application> load(const std::string& text,
                                                   fastcycle::host::TestClasses& classes) {
  const auto file = std::filesystem::path(::testing::TempDir()) /
                    ("guide_" + std::to_string(::getpid()) + ".json");
  std::ofstream(file) << text;
  fastcycle::config::Problems problems;
  auto description = fastcycle::config::load({.file = file}, problems);
  std::filesystem::remove(file);
  for (const auto& problem : problems.all()) {
    ADD_FAILURE() << fastcycle::config::to_string(problem);
  }
  auto application = std::make_unique<fastcycle::host::Application>(
      std::move(description), fastcycle::host::ClockOptions{.is_simulated = true});
  application->build(classes, problems, fastcycle::host::ConstructorFault::kError);
  EXPECT_FALSE(problems.has_errors());
  return application;
}

class Faulty final : public fastcycle::Component {
 public:
  explicit Faulty(fastcycle::Context& context) : Component(context) {
    context.create_timer({.period = std::chrono::milliseconds(10)},
                         [] { throw std::runtime_error("on purpose"); });
  }
};

TEST(TheGuideToModes, HasAConfigurationInWhichFaultsLeadOn) {
  fastcycle::host::TestClasses classes;
  classes.with<Planner>("monitor").with<Faulty>("planner").with<Planner>("stopper");
  const auto application = load(R"(
// [snippet modes]
{
  "name": "car",
  "modes": {
    "nominal": {"components": ["planner"]},
    "degraded": {"components": ["fallback"]},
    "minimal_risk": {"executors": ["safety"]}
  },
  "initial_mode": "nominal",
  "executors": [{"name": "safety"}],
  "topics": {"commands": {"multiple_publishers": true}},
  "components": [
    {"name": "monitor", "library": "monitor"},
    {"name": "planner", "library": "planner", "on_fault": "restart", "fault_mode": "degraded"},
    {"name": "fallback", "library": "planner", "fault_mode": "minimal_risk"},
    {"name": "stopper", "library": "stopper", "executor": "safety"}
  ]
}
// [end]
)",
                                classes);
  application->start();
  // The planner faults every 10 ms, and is made anew three times.
  application->advance_to(application->start_time() + std::chrono::milliseconds(39));
  EXPECT_EQ(application->modes().current(), "nominal");
  application->advance_to(application->start_time() + std::chrono::milliseconds(41));
  EXPECT_EQ(application->modes().current(), "degraded");
  // The fallback, of the same code, faults at once for good.
  application->advance_to(application->start_time() + std::chrono::milliseconds(60));
  EXPECT_EQ(application->modes().current(), "minimal_risk");
  application->stop();
}

}  // namespace
