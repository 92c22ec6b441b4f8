// The code of docs/guides/parameters.md, built and run.

#include <algorithm>
#include <cstdint>
#include <string>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace {

using fastcycle::Component;
using fastcycle::Context;
using fastcycle::Param;
using fastcycle::ParamsResult;
using fastcycle::ProposedParams;
using fastcycle::Publisher;
using google::protobuf::DoubleValue;

// [snippet declare]
enum class Mode { kEco, kSport };

class SpeedLimiter final : public Component {
 public:
  explicit SpeedLimiter(Context& context)
      : Component(context),
        topic_(context.param<std::string>("topic", {.fallback = "control/speed"}).get()),
        mode_(context.param<Mode>("mode", {.fallback = Mode::kEco,
                                           .names = {{"eco", Mode::kEco}, {"sport", Mode::kSport}},
                                           .is_tunable = true})),
        limit_mps_(context.param<double>("limit_mps", {.fallback = 13.9,
                                                       .min = 0.0,
                                                       .max = 60.0,
                                                       .unit = "m/s",
                                                       .description = "Nothing faster passes",
                                                       .is_tunable = true})),
        limited_(context.create_publisher<DoubleValue>(topic_)) {
    context.create_subscriber<DoubleValue>("planning/speed", [this](const DoubleValue& planned) {
      auto out = limited_.loan();
      out->set_value(std::min(planned.value(), limit_mps_.get()));
      limited_.publish(std::move(out));
    });
  }

 private:
  std::string topic_;
  Param<Mode> mode_;
  Param<double> limit_mps_;
  Publisher<DoubleValue> limited_;
};
// [end]

// [snippet on_change]
class Smoother final : public Component {
 public:
  explicit Smoother(Context& context)
      : Component(context),
        window_(context.param<std::int64_t>(
            "window", {.fallback = 8, .min = 1, .max = 1000, .is_tunable = true})) {
    context.on_change(window_, [this](const std::int64_t& window) { buffer_.resize(window, 0.0); });
  }

  void start() override { buffer_.resize(window_.get(), 0.0); }
  void stop() override { report("size", static_cast<std::int64_t>(buffer_.size())); }

 private:
  Param<std::int64_t> window_;
  std::vector<double> buffer_;
};
// [end]

class Band final : public Component {
 public:
  explicit Band(Context& context)
      : Component(context),
        low_mps_(context.param<double>("low_mps", {.fallback = 1.0, .is_tunable = true})),
        high_mps_(context.param<double>("high_mps", {.fallback = 2.0, .is_tunable = true})) {
    // [snippet check]
    context.check_params([low = low_mps_, high = high_mps_](const ProposedParams& proposed) {
      const bool is_right = proposed.get(low) < proposed.get(high);
      return is_right ? std::string() : "low_mps must be below high_mps";
    });
    // [end]
  }

 private:
  Param<double> low_mps_;
  Param<double> high_mps_;
};

// [snippet supervisor]
class RainWatch final : public Component {
 public:
  explicit RainWatch(Context& context) : Component(context) {
    context.create_subscriber<DoubleValue>("rain", [this](const DoubleValue& mm_per_h) {
      const double limit_mps = mm_per_h.value() > 4.0 ? 8.0 : 13.9;
      this->context().change_params(
          {{"limiter.limit_mps", fastcycle::param_json(limit_mps)}, {"limiter.mode", "\"eco\""}},
          [this](const ParamsResult& result) {
            if (!result.has_changed()) {
              health(fastcycle::Health::kDegraded, result.mistakes.front());
            }
          });
    });
  }
};
// [end]

DoubleValue value(double number) {
  DoubleValue message;
  message.set_value(number);
  return message;
}

// [snippet bench]
TEST(SpeedLimiter, TakesANewLimit) {
  fastcycle::testing::Bench bench;
  bench.add<SpeedLimiter>("limiter", R"({"params": {"limit_mps": 20}})");
  auto planned = bench.input<DoubleValue>("planning/speed");
  auto limited = bench.output<DoubleValue>("control/speed");
  bench.start();

  EXPECT_TRUE(bench.change_params({{"limiter.limit_mps", "10"}}).has_changed());
  planned.publish(value(33.0));

  EXPECT_EQ(limited.take().at(0).value(), 10.0);
  EXPECT_THAT(bench.change_params({{"limiter.limit_mps", "70"}}).mistakes,
              testing::ElementsAre("limiter.limit_mps: expected a number in [0, 60], found 70"));
}
// [end]

TEST(Smoother, ResizesItsBufferWhenTheWindowChanges) {
  fastcycle::testing::Bench bench;
  bench.add<Smoother>("smoother");
  bench.start();
  EXPECT_TRUE(bench.change_params({{"smoother.window", "12"}}).has_changed());
  bench.stop();
  EXPECT_EQ(bench.result("smoother", "size"), fastcycle::ReportValue(std::int64_t{12}));
}

TEST(Band, RefusesALowEndAboveTheHighEnd) {
  fastcycle::testing::Bench bench;
  bench.add<Band>("band");
  bench.start();
  EXPECT_THAT(bench.change_params({{"band.low_mps", "3"}}).mistakes,
              testing::ElementsAre("band: low_mps must be below high_mps"));
}

TEST(RainWatch, LowersTheLimitWhenItRains) {
  fastcycle::testing::Bench bench;
  bench.add<SpeedLimiter>("limiter");
  bench.add<RainWatch>("rain_watch");
  auto rain = bench.input<DoubleValue>("rain");
  auto planned = bench.input<DoubleValue>("planning/speed");
  auto limited = bench.output<DoubleValue>("control/speed");
  bench.start();

  rain.publish(value(5.0));
  planned.publish(value(33.0));

  EXPECT_EQ(limited.take().at(0).value(), 8.0);
}

// What the guide's JSON is.
TEST(SharedParams, OfTheGuideAreReadByBoth) {
  class Wheels final : public Component {
   public:
    explicit Wheels(Context& context)
        : Component(context),
          wheelbase_m_(context.param<double>("wheelbase_m", {.is_tunable = true})) {}
    void stop() override { report("wheelbase_m", wheelbase_m_.get()); }

   private:
    Param<double> wheelbase_m_;
  };
  fastcycle::testing::Bench bench;
  bench.configure(R"({"shared_params": {"wheelbase_m": 2.66}})");
  bench.add<Wheels>("a");
  bench.add<Wheels>("b");
  bench.start();
  EXPECT_TRUE(bench.change_params({{"shared_params.wheelbase_m", "2.7"}}).has_changed());
  bench.stop();
  EXPECT_EQ(bench.result("a", "wheelbase_m"), fastcycle::ReportValue(2.7));
  EXPECT_EQ(bench.result("b", "wheelbase_m"), fastcycle::ReportValue(2.7));
}

}  // namespace
