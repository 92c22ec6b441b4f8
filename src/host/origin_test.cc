// How old is what a component publishes: the rule by which timers inherit, in whole applications.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using namespace std::chrono_literals;

/// A sensor: publishes on "measured" at every tick from "from_ms" on.
class Sensor final : public Component {
 public:
  explicit Sensor(Context& context)
      : Component(context),
        from_ms_(context.param<std::int64_t>("from_ms", {.fallback = 0})),
        measured_(context.create_publisher<Int64Value>("measured")) {}
  void serve() override {
    if (now() - start_time() >= std::chrono::milliseconds(from_ms_.get())) {
      measured_.publish(measured_.loan());
    }
  }

 private:
  Param<std::int64_t> from_ms_;
  Publisher<Int64Value> measured_;
};

/// Publishes on "out" at every tick, whatever it has received on "in".
class Relay final : public Component {
 public:
  explicit Relay(Context& context)
      : Component(context), out_(context.create_publisher<Int64Value>("out")) {
    context.create_subscriber<Int64Value>("in", [](const Int64Value&) {});
  }
  void serve() override { out_.publish(out_.loan()); }

 private:
  Publisher<Int64Value> out_;
};

/// As `Relay`, from a view.
class Looker final : public Component {
 public:
  explicit Looker(Context& context)
      : Component(context),
        out_(context.create_publisher<Int64Value>("out")),
        in_(context.create_latest<Int64Value>("in")) {}
  void serve() override {
    if (const auto age = in_.age()) {
      shown_ms.push_back(*age / 1ms);
    }
    out_.publish(out_.loan());
  }

  std::vector<std::int64_t> shown_ms;

 private:
  Publisher<Int64Value> out_;
  Latest<Int64Value> in_;
};

/// Notes how old each message of "in" is, ms, and whose measurement it is.
class Judge final : public Component {
 public:
  explicit Judge(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("in", [this](const Sample<Int64Value>& message) {
      ages_ms.push_back((message.info().publish_time - message.info().origin.taken) / 1ms);
      roots.push_back(message.info().origin.root);
    });
  }

  std::vector<std::int64_t> ages_ms;
  std::vector<PublisherId> roots;
};

template <typename T>
T& component(const Application& application, std::size_t index) {
  return static_cast<T&>(*application.components()[index]->component);
}

std::unique_ptr<Application> run(const std::string& text, Duration limit) {
  TestClasses classes;
  classes.with<Sensor>("sensor").with<Relay>("relay").with<Looker>("looker").with<Judge>("judge");
  auto application = make_application(text, classes, {.is_simulated = true});
  application->start();
  application->run(limit);
  return application;
}

TEST(OriginOfATimer, IsThatOfWhatItsViewsShowInThisActivation) {
  const auto application = run(R"({"name": "t", "components": [
    {"name": "sensor", "library": "sensor", "serve_period_ms": 30},
    {"name": "looker", "library": "looker", "serve_period_ms": 55, "remap": {"in": "measured"}},
    {"name": "judge", "library": "judge", "remap": {"in": "out"}}]})",
                               400ms);

  const auto& looker = component<Looker>(*application, 1);
  ASSERT_GE(looker.shown_ms.size(), 5U);
  EXPECT_EQ(component<Judge>(*application, 2).ages_ms, looker.shown_ms);
  application->stop();
}

// Before its input came, the relay was itself the root of what it published.
TEST(OriginOfATimer, BelongsToNoRootThatNoPublisherSaysAnyMore) {
  const auto application = run(R"({"name": "t", "components": [
    {"name": "sensor", "library": "sensor", "serve_period_ms": 10, "params": {"from_ms": 100}},
    {"name": "first", "library": "relay", "serve_period_ms": 10,
     "remap": {"in": "measured", "out": "first"}},
    {"name": "second", "library": "relay", "serve_period_ms": 10, "remap": {"in": "first"}},
    {"name": "judge", "library": "judge", "remap": {"in": "out"}}]})",
                               400ms);

  const auto& judge = component<Judge>(*application, 3);
  ASSERT_GE(judge.ages_ms.size(), 35U);
  const PublisherId sensor = detail::publisher_id("sensor", "measured");
  EXPECT_NE(judge.roots.front(), sensor);
  EXPECT_EQ(judge.roots.back(), sensor);
  EXPECT_LE(judge.ages_ms.back(), 30);
  application->stop();
}

TEST(OriginOfATimer, IsNotThatOfItsOwnEcho) {
  const auto application = run(R"({"name": "t", "components": [
    {"name": "one", "library": "relay", "serve_period_ms": 10,
     "remap": {"in": "back", "out": "forth"}},
    {"name": "two", "library": "relay", "serve_period_ms": 10,
     "remap": {"in": "forth", "out": "back"}},
    {"name": "judge", "library": "judge", "remap": {"in": "forth"}}]})",
                               400ms);

  const auto& judge = component<Judge>(*application, 2);
  ASSERT_GE(judge.ages_ms.size(), 35U);
  EXPECT_LE(judge.ages_ms.back(), 20);
  application->stop();
}

TEST(OriginOfATimer, EndsWithTheLifespanOfWhatItComesFrom) {
  const auto application = run(R"({"name": "t", "components": [
    {"name": "sensor", "library": "sensor", "serve_period_ms": 1000, "serve_phase_ms": -990},
    {"name": "looker", "library": "looker", "serve_period_ms": 20,
     "remap": {"in": "measured"}, "subscribers": {"in": {"lifespan_ms": 50}}},
    {"name": "judge", "library": "judge", "remap": {"in": "out"}}]})",
                               400ms);

  const auto& judge = component<Judge>(*application, 2);
  const PublisherId looker = detail::publisher_id("looker", "out");
  ASSERT_GE(judge.roots.size(), 15U);
  EXPECT_EQ(judge.roots[0], detail::publisher_id("sensor", "measured"));
  EXPECT_EQ(judge.roots.back(), looker);
  EXPECT_EQ(judge.ages_ms.back(), 0);
  application->stop();
}

}  // namespace
}  // namespace fastcycle::host
