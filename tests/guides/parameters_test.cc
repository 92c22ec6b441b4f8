// The code of docs/guides/parameters.md.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "demo/speed.pb.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace {

using fastcycle::Component;
using fastcycle::Context;
using fastcycle::Param;
using fastcycle::ParamsResult;
using fastcycle::ProposedParams;
using google::protobuf::DoubleValue;

// [snippet declare]
enum class Mode { kEco, kSport };

class SpeedLimiter final : public Component {
 public:
  explicit SpeedLimiter(Context& context)
      : Component(context),
        mode_(context.param<Mode>("mode", {.fallback = Mode::kSport,
                                           .names = {{"eco", Mode::kEco}, {"sport", Mode::kSport}},
                                           .is_tunable = true})),
        limit_mps_(context.param<double>("limit_mps", {.fallback = 13.9,
                                                       .min = 0.0,
                                                       .max = 60.0,
                                                       .unit = "m/s",
                                                       .description = "Nothing faster passes",
                                                       .is_tunable = true})),
        limited_(context.create_publisher<demo::Speed>("control/speed")) {
    context.create_subscriber<demo::Speed>("planning/speed", [this](const demo::Speed& planned) {
      const double limit_mps = limit_mps_.get() * (mode_.get() == Mode::kEco ? 0.5 : 1.0);
      auto out = limited_.loan();
      out->set_mps(std::min(planned.mps(), limit_mps));
      limited_.publish(std::move(out));
    });
  }

 private:
  Param<Mode> mode_;
  Param<double> limit_mps_;
  fastcycle::Publisher<demo::Speed> limited_;
};
// [end]

class Smoother final : public Component {
 public:
  // [snippet on_change]
  explicit Smoother(Context& context)
      : Component(context),
        window_(context.param<std::size_t>(
            "window", {.fallback = 8, .min = 1, .max = 1000, .is_tunable = true})) {
    context.on_change(window_, [this](const std::size_t& window) { buffer_.resize(window, 0.0); });
  }

  void start() override { buffer_.resize(window_.get(), 0.0); }
  // [end]

  void stop() override { report("size", static_cast<std::int64_t>(buffer_.size())); }

 private:
  Param<std::size_t> window_;
  std::vector<double> buffer_;
};

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
              health(fastcycle::Health::kDegraded, result.errors.front());
            }
          });
    });
  }
};
// [end]

demo::Speed speed(double mps) {
  demo::Speed message;
  message.set_mps(mps);
  return message;
}

DoubleValue value(double number) {
  DoubleValue message;
  message.set_value(number);
  return message;
}

// [snippet bench]
TEST(SpeedLimiter, TakesANewLimit) {
  fastcycle::testing::Bench bench;
  bench.add<SpeedLimiter>("limiter", R"({"params": {"limit_mps": 20}})");
  auto planned = bench.input<demo::Speed>("planning/speed");
  auto limited = bench.output<demo::Speed>("control/speed");
  bench.start();

  EXPECT_TRUE(bench.change_params({{"limiter.limit_mps", "10"}}).has_changed());
  planned.publish(speed(33.0));

  EXPECT_EQ(limited.take().at(0).mps(), 10.0);
  EXPECT_THAT(bench.change_params({{"limiter.limit_mps", "70"}}).errors,
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
  EXPECT_THAT(bench.change_params({{"band.low_mps", "3"}}).errors,
              testing::ElementsAre("band: low_mps must be below high_mps"));
}

TEST(RainWatch, LowersTheLimitWhenItRains) {
  fastcycle::testing::Bench bench;
  bench.add<SpeedLimiter>("limiter");
  bench.add<RainWatch>("rain_watch");
  auto rain = bench.input<DoubleValue>("rain");
  auto planned = bench.input<demo::Speed>("planning/speed");
  auto limited = bench.output<demo::Speed>("control/speed");
  bench.start();

  rain.publish(value(5.0));
  planned.publish(speed(33.0));

  EXPECT_EQ(limited.take().at(0).mps(), 4.0);
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
