// The code of docs/guides/life_cycle.md.

#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "config/load.h"
#include "demo/speed.pb.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/test_application.h"

namespace {

using namespace std::chrono_literals;

class Device {
 public:
  void open() { is_open_ = true; }
  void transmit(bool on) {
    EXPECT_TRUE(is_open_);
    is_transmitting_ = on;
  }
  [[nodiscard]] double read() const {
    EXPECT_TRUE(is_transmitting_);
    return 12.5;
  }
  void close() {
    EXPECT_FALSE(is_transmitting_);
    is_open_ = false;
  }

 private:
  bool is_open_ = false;
  bool is_transmitting_ = false;
};

// [snippet radar]
class Radar final : public fastcycle::Component {
 public:
  explicit Radar(fastcycle::Context& context)
      : Component(context), tracks_(context.create_publisher<demo::Speed>("radar/speed")) {}

  void start() override { device_.open(); }  // Once: here it may fail.
  void activate() override { device_.transmit(true); }
  void serve() override {  // Only while it is active.
    auto speed = tracks_.loan();
    speed->set_mps(device_.read());
    tracks_.publish(std::move(speed));
  }
  void deactivate() override { device_.transmit(false); }
  void stop() override { device_.close(); }

 private:
  fastcycle::Publisher<demo::Speed> tracks_;
  Device device_;
};
// [end]

TEST(TheGuideToTheLifeCycle, ActivatesAndDeactivates) {
  fastcycle::testing::Bench bench;
  bench.add<Radar>("radar", R"({"serve_period_ms": 10})");
  auto speeds = bench.output<demo::Speed>("radar/speed");
  bench.start();
  bench.advance(50ms);
  EXPECT_EQ(speeds.take().size(), 5U);
  // [snippet bench]
  bench.deactivate("radar");
  bench.advance(100ms);
  EXPECT_TRUE(speeds.take().empty());
  bench.activate("radar");
  bench.advance(100ms);
  EXPECT_EQ(speeds.take().size(), 10U);
  // [end]
  bench.stop();
  EXPECT_TRUE(bench.faults("radar").empty());
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

class Other final : public fastcycle::Component {
 public:
  explicit Other(fastcycle::Context& context) : Component(context) {}
};

TEST(TheGuideToTheLifeCycle, HasConfigurationsThatLoad) {
  fastcycle::host::TestClasses classes;
  classes.with<Other>("radar").with<Other>("planner").with<Other>("localization");
  const auto starts = load(R"(
// [snippet starts]
{
  "name": "car",
  "start_timeout_ms": 2000,
  "components": [
    {"name": "planner", "library": "planner", "after": ["localization"]},
    {"name": "localization", "library": "localization", "start_timeout_ms": 10000}
  ]
}
// [end]
)",
                           classes);
  using Names = std::vector<std::string>;
  EXPECT_EQ(starts->description().components[0].after, Names{"localization"});
  EXPECT_EQ(starts->description().components[0].start_timeout, 2s);
  EXPECT_EQ(starts->description().components[1].start_timeout, 10s);
  EXPECT_EQ(fastcycle::config::start_order(starts->description()),
            (std::vector<std::size_t>{1, 0}));
  const auto restarts = load(R"(
// [snippet restarts]
{
  "name": "car",
  "on_fault": "restart",
  "restart": {"limit": 5, "within_s": 60, "back_off_ms": 100, "back_off_max_ms": 2000},
  "components": [
    {"name": "radar", "library": "radar", "restart": {"limit": 20}},
    {"name": "planner", "library": "planner"}
  ]
}
// [end]
)",
                             classes);
  EXPECT_EQ(restarts->description().components[0].restart.limit, 20U);
  EXPECT_EQ(restarts->description().components[0].restart.back_off, 100ms);
  EXPECT_EQ(restarts->description().components[1].restart.limit, 5U);
  classes.with<Other>("camera").with<Other>("detector");
  const auto steps = load(R"(
// [snippet steps]
{
  "name": "car",
  "on_fault": "restart",
  "restart": {"limit": 3, "within_s": 10, "back_off_ms": 50, "then": "process"},
  "modes": {"full": {"components": ["detector"]}, "limp": {"components": []}},
  "initial_mode": "full",
  "components": [
    {"name": "camera", "library": "camera"},
    {"name": "detector", "library": "detector", "process": "perception", "fault_mode": "limp"}
  ],
  "processes": [
    {"name": "perception", "on_exit": "restart",
     "restart": {"limit": 2, "within_s": 60, "back_off_ms": 200, "then": "continue"}}
  ]
}
// [end]
)",
                          classes);
  using fastcycle::config::AfterRestarts;
  EXPECT_EQ(steps->description().components[1].restart.then, AfterRestarts::kProcess);
  EXPECT_EQ(steps->description().processes[0].restart.then, AfterRestarts::kContinue);
}

}  // namespace

// [snippet state]
/// The mean of what it received lately.
class Smoother final : public fastcycle::Component {
 public:
  explicit Smoother(fastcycle::Context& context)
      : Component(context),
        mean_(context.state<demo::Speed>("mean")),
        means_(context.create_publisher<demo::Speed>("mean/speed")) {
    context.create_subscriber<demo::Speed>("radar/speed", [this](const demo::Speed& speed) {
      mean_->set_mps(0.5 * mean_->mps() + 0.5 * speed.mps());
      auto mean = means_.loan();
      *mean = *mean_;
      means_.publish(std::move(mean));
    });
  }

 private:
  fastcycle::State<demo::Speed> mean_;
  fastcycle::Publisher<demo::Speed> means_;
};
// [end]

// [snippet saved]
/// The same, with state in another form.
class Filter final : public fastcycle::Component {
 public:
  explicit Filter(fastcycle::Context& context)
      : Component(context),
        state_(context.state<demo::Speed>("mean",
                                          [this](demo::Speed& state) { state.set_mps(mean_); })),
        mean_(state_->mps()),  // 0 at the first start.
        means_(context.create_publisher<demo::Speed>("mean/speed")) {
    context.create_subscriber<demo::Speed>("radar/speed",
                                           [this](const demo::Speed& speed) { add(speed.mps()); });
  }

 private:
  void add(double mps) {
    if (mps < 0.0) {
      throw std::runtime_error("no radar measures that");
    }
    mean_ = 0.5 * mean_ + 0.5 * mps;
    auto mean = means_.loan();
    mean->set_mps(mean_);
    means_.publish(std::move(mean));
  }

  fastcycle::State<demo::Speed> state_;
  double mean_;
  fastcycle::Publisher<demo::Speed> means_;
};
// [end]

TEST(TheGuideToTheLifeCycle, KeepsDeclaredStateOverARestart) {
  fastcycle::testing::Bench bench;
  bench.add<Filter>("filter", R"({"on_fault": "restart"})");
  auto speeds = bench.input<demo::Speed>("radar/speed");
  auto means = bench.output<demo::Speed>("mean/speed");
  bench.start();
  const auto publish_speed = [&](double mps) {
    demo::Speed speed;
    speed.set_mps(mps);
    speeds.publish(speed);
    bench.advance(10ms);
  };

  publish_speed(8.0);
  publish_speed(-1.0);  // A fault: the object is made anew.
  publish_speed(4.0);

  const auto received = means.take();
  ASSERT_EQ(received.size(), 2U);
  EXPECT_EQ(received[0].mps(), 4.0);
  EXPECT_EQ(received[1].mps(), 4.0);  // Without the state it would be 2.
}

TEST(TheGuideToTheLifeCycle, WorksOnDeclaredState) {
  fastcycle::testing::Bench bench;
  bench.add<Smoother>("smoother");
  auto speeds = bench.input<demo::Speed>("radar/speed");
  auto means = bench.output<demo::Speed>("mean/speed");
  bench.start();
  demo::Speed speed;
  speed.set_mps(8.0);
  speeds.publish(speed);
  bench.advance(10ms);
  speeds.publish(speed);
  bench.advance(10ms);

  const auto received = means.take();
  ASSERT_EQ(received.size(), 2U);
  EXPECT_EQ(received[1].mps(), 6.0);
}
