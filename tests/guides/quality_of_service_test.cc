// The code of docs/guides/quality_of_service.md.

#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "demo/speed.pb.h"
#include "fastcycle/testing.h"

namespace {

using namespace std::chrono_literals;

// [snippet limiter]
class Limiter final : public fastcycle::Component {
 public:
  explicit Limiter(fastcycle::Context& context)
      : Component(context), limited_(context.create_publisher<demo::Speed>("limited")) {
    context.create_subscriber<demo::Speed>(
        "planned",
        {.depth = 4,
         .deadline = 100ms,
         .lifespan = 50ms,
         .on_event = [this](const fastcycle::QosEvent& event) { on_event(event); }},
        [this](const demo::Speed& planned) { send(planned.mps()); });
  }

 private:
  void on_event(const fastcycle::QosEvent& event) {
    switch (event.kind) {
      case fastcycle::QosKind::kDeadlineMissed:
      case fastcycle::QosKind::kLivelinessLost:
        health(fastcycle::Health::kDegraded, "no plan");
        send(0.0);
        break;
      case fastcycle::QosKind::kLivelinessGained:
        health(fastcycle::Health::kOk);
        break;
      default:
        break;
    }
  }

  void send(double mps) {
    auto out = limited_.loan();
    out->set_mps(mps);
    limited_.publish(std::move(out));
  }

  fastcycle::Publisher<demo::Speed> limited_;
};
// [end]

// [snippet planner]
class Planner final : public fastcycle::Component {
 public:
  explicit Planner(fastcycle::Context& context)
      : Component(context),
        planned_(context.create_publisher<demo::Speed>(
            "planned", {.deadline = 100ms, .on_event = [this](const fastcycle::QosEvent&) {
                          health(fastcycle::Health::kDegraded, "planning takes too long");
                        }})) {}

 private:
  fastcycle::Publisher<demo::Speed> planned_;
};
// [end]

// [snippet display]
class Display final : public fastcycle::Component {
 public:
  explicit Display(fastcycle::Context& context) : Component(context) {}

  void serve() override {
    if (!map_) {
      map_ = context().create_subscriber<demo::Speed>(
          "map", {.history = 1}, [this](const demo::Speed& map) { report("map", map.mps()); });
    }
  }

 private:
  std::optional<fastcycle::Subscriber> map_;
};
// [end]

// [snippet configuration]
constexpr const char* kApplication = R"(
{
  "topics": {"map": {"latched": 1}, "planned": {"lifespan_ms": 200}},
  "components": [
    {"name": "limiter", "library": "speed_limiter",
     "subscribers": {"planned": {"deadline_ms": 80, "liveliness_ms": 500}}},
    {"name": "planner", "library": "speed_planner", "publishers": {"planned": {"deadline_ms": 80}}}
  ]
}
)";
// [end]

std::string speeds(const std::vector<demo::Speed>& messages) {
  std::string text;
  for (const demo::Speed& message : messages) {
    text += std::to_string(static_cast<int>(message.mps())) + " ";
  }
  return text;
}

TEST(QualityOfServiceGuide, TheLimiterStopsTheCarWhenNoPlanComes) {
  fastcycle::testing::Bench bench;
  bench.add<Limiter>("limiter");
  auto planned = bench.input<demo::Speed>("planned");
  auto limited = bench.output<demo::Speed>("limited");
  bench.start();

  demo::Speed speed;
  speed.set_mps(9);
  planned.publish(speed);
  bench.advance(101ms);

  EXPECT_EQ(speeds(limited.take()), "9 0 ");
}

TEST(QualityOfServiceGuide, ThePlannerAndTheDisplayRun) {
  fastcycle::testing::Bench bench;
  bench.configure(R"({"topics": {"map": {"latched": 1}}})");
  bench.add<Planner>("planner");
  bench.add<Display>("display", R"({"serve_period_ms": 10})");
  auto map = bench.input<demo::Speed>("map");
  bench.start();
  demo::Speed message;
  message.set_mps(4);
  map.publish(message);
  bench.advance(150ms);

  EXPECT_EQ(bench.result("display", "map"), fastcycle::ReportValue(4.0));
}

TEST(QualityOfServiceGuide, ItsFileIsJson) {
  fastcycle::testing::Bench bench;
  bench.configure(kApplication);
  SUCCEED() << "else it would have thrown; what the keys mean is tested with the components";
}

}  // namespace
