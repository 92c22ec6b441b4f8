// What must hold of transforms in a whole application: the same answers with any number of workers,
// static frames that come late, and no allocation while transforms are found.

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>
#include <variant>

#include <gtest/gtest.h>

#include "../core/counting_allocator.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/transforms.h"
#include "host/test_application.h"

namespace fastcycle {
namespace {

using host::TestClasses;
using transforms::StaticBroadcaster;
using transforms::Transform;
using transforms::Tree;
using namespace std::chrono_literals;

/// Drives along x with 10 m/s.
class Localization final : public Component {
 public:
  explicit Localization(Context& context)
      : Component(context), poses_(context.create_publisher<transform::Transform>("pose")) {}

  void serve() override {
    auto message = poses_.loan();
    const double seconds = std::chrono::duration<double>(now() - start_time()).count();
    transforms::to_message("map", "base_link",
                           {.taken = now(), .child_to_parent = {{10.0 * seconds, 0.0, 0.0}, {}}},
                           *message);
    poses_.publish(std::move(message));
  }

 private:
  Publisher<transform::Transform> poses_;
};

/// Says where the lidar is, at once or late, and again when it was moved.
class Calibration final : public Component {
 public:
  explicit Calibration(Context& context)
      : Component(context),
        is_late_(context.param<bool>("late", {.fallback = false})),
        broadcaster_(context) {}

  void start() override {
    if (!is_late_.get()) {
      say(2.0);
    }
  }
  void serve() override { say(++calls_ < 3 ? 2.0 : 3.0); }

 private:
  void say(double x) {
    broadcaster_.set("base_link", "lidar", {{x, 0.0, 0.0}, {}});
    broadcaster_.publish();
  }

  Param<bool> is_late_;
  int calls_ = 0;
  StaticBroadcaster broadcaster_;
};

/// Asks every 10 ms where the lidar was 15 ms ago, and records the replies.
class Asker final : public Component {
 public:
  explicit Asker(Context& context)
      : Component(context), tree_(context, {.moving = {{"pose", "map", "base_link"}}}) {}

  void serve() override {
    const auto found = tree_.a_to_b("lidar", "map", now() - 15ms);
    const std::string received = found ? std::to_string(found->translation.x) : found.error().why;
    received_ += received + "\n";
    ++(found ? found_ : missing_);
    last_ = found ? found->translation.x : 0.0;
    if (found && first_ == 0.0) {
      first_ = last_;
    }
  }

  void stop() override {
    report("received", received_);
    report("found", found_);
    report("missing", missing_);
    report("first", first_);
    report("last", last_);
  }

 private:
  Tree tree_;
  std::string received_;
  std::int64_t found_ = 0;
  std::int64_t missing_ = 0;
  double first_ = 0.0;
  double last_ = 0.0;
};

constexpr const char* kTopics = R"("topics": {"transforms/static": {"latched": 1}})";

ReportValue result(const host::Application& application, const std::string& component,
                   const std::string& name) {
  for (const auto& one : application.components()) {
    if (one->name == component) {
      return one->results.at(name);
    }
  }
  return {};
}

std::unique_ptr<host::Application> drive(const std::string& components, unsigned workers) {
  TestClasses all;
  all.with<Localization>("localization").with<Calibration>("calibration").with<Asker>("asker");
  auto application = host::make_application(
      std::string(R"({"name": "drive", )") + kTopics + R"(, "components": [)" + components + "]}",
      all, {.is_simulated = true, .workers = workers});
  application->start();
  application->run(1s);
  application->stop();
  return application;
}

constexpr const char* kLateCalibration = R"(
  {"name": "asker", "library": "asker", "serve_period_ms": 10},
  {"name": "second", "library": "asker", "serve_period_ms": 7},
  {"name": "localization", "library": "localization", "serve_period_ms": 10},
  {"name": "calibration", "library": "calibration", "serve_period_ms": 300, "params": {"late": true}})";

TEST(LateStaticFrames, AreKnownFromThenOn) {
  const auto application = drive(kLateCalibration, 1);

  // It speaks at 300, 600 and, having moved, at 900 ms.
  EXPECT_EQ(std::get<std::int64_t>(result(*application, "asker", "missing")), 30);
  EXPECT_EQ(std::get<std::int64_t>(result(*application, "asker", "found")), 70);
  EXPECT_NEAR(std::get<double>(result(*application, "asker", "first")), 2.95 + 2.0, 1e-9);
  EXPECT_NEAR(std::get<double>(result(*application, "asker", "last")), 9.85 + 3.0, 0.011);
}

TEST(StaticFramesOfAStart, ReachComponentsBeforeAndAfterTheirPublisher) {
  const std::string asker = R"({"name": "asker", "library": "asker", "serve_period_ms": 10},)";
  const std::string calibration = R"({"name": "calibration", "library": "calibration"},)";
  const std::string localization =
      R"({"name": "localization", "library": "localization", "serve_period_ms": 10})";
  for (const std::string& order : {asker + calibration, calibration + asker}) {
    const auto application = drive(order + localization, 1);
    EXPECT_GE(std::get<std::int64_t>(result(*application, "asker", "found")), 97) << order;
  }
}

TEST(LookUps, AreTheSameForAnyNumberOfWorkers) {
  const auto one = drive(kLateCalibration, 1);
  for (const unsigned workers : {2U, 4U}) {
    const auto more = drive(kLateCalibration, workers);
    for (const std::string asker : {"asker", "second"}) {
      EXPECT_EQ(result(*one, asker, "received"), result(*more, asker, "received")) << workers;
    }
  }
}

/// Counts what 1000 look-ups allocate once all is known.
class Counter final : public Component {
 public:
  explicit Counter(Context& context)
      : Component(context), tree_(context, {.moving = {{"pose", "map", "base_link"}}}) {}

  void serve() override {
    if (now() < start_time() + 500ms) {
      static_cast<void>(tree_.a_to_b("lidar", "map"));
      return;
    }
    const auto before = allocation_count();
    for (int i = 0; i < 1000; ++i) {
      found_ += tree_.a_to_b("lidar", "map", now() - 5ms - Duration(i * 400'000)) ? 1 : 0;
    }
    allocations_ += static_cast<std::int64_t>(allocation_count() - before);
  }
  void stop() override {
    report("found", found_);
    report("allocations", allocations_);
  }

 private:
  Tree tree_;
  std::int64_t found_ = 0;
  std::int64_t allocations_ = 0;
};

TEST(LookUps, AllocateNothingWhenTheyFindTheTransform) {
  setenv("FASTCYCLE_POISON", "off", 1);  // Otherwise each message is made anew.
  TestClasses all;
  all.with<Localization>("localization").with<Calibration>("calibration").with<Counter>("counter");
  auto application =
      host::make_application(std::string(R"({"name": "drive", )") + kTopics + R"(, "components": [
        {"name": "calibration", "library": "calibration"},
        {"name": "localization", "library": "localization", "serve_period_ms": 10},
        {"name": "counter", "library": "counter", "serve_period_ms": 100, "serve_phase_ms": 5}]})",
                             all, {.is_simulated = true, .workers = 1});
  application->start();
  application->run(1s);
  application->stop();

  EXPECT_EQ(std::get<std::int64_t>(result(*application, "counter", "found")), 5000);
  EXPECT_EQ(std::get<std::int64_t>(result(*application, "counter", "allocations")), 0);
}

}  // namespace
}  // namespace fastcycle
