// Testing components without a process, as a component's author does it.

#include <algorithm>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace fastcycle::testing {
namespace {

using google::protobuf::DoubleValue;
using namespace std::chrono_literals;

/// Caps a speed; says every 100 ms how many it capped.
class SpeedLimiter final : public Component {
 public:
  explicit SpeedLimiter(Context& context)
      : Component(context),
        limit_mps_(context.param<double>("limit_mps", {.fallback = 13.9, .min = 0.0, .max = 60.0})),
        limited_(context.create_publisher<DoubleValue>("control/speed")),
        capped_total_(context.create_publisher<DoubleValue>("control/capped")) {
    context.create_subscriber<DoubleValue>("planning/speed", [this](const DoubleValue& planned) {
      if (planned.value() < 0) {
        throw std::invalid_argument("a speed is not negative");
      }
      auto out = limited_.loan();
      out->set_value(std::min(planned.value(), limit_mps_.get()));
      capped_ += planned.value() > limit_mps_.get() ? 1 : 0;
      limited_.publish(std::move(out));
    });
  }

  void serve() override {
    auto out = capped_total_.loan();
    out->set_value(capped_);
    capped_total_.publish(std::move(out));
  }

  void stop() override { report("capped", static_cast<std::int64_t>(capped_)); }

 private:
  Param<double> limit_mps_;
  Publisher<DoubleValue> limited_;
  Publisher<DoubleValue> capped_total_;
  int capped_ = 0;
};

DoubleValue speed(double mps) {
  DoubleValue message;
  message.set_value(mps);
  return message;
}

TEST(Bench, FeedsAComponentAndSeesWhatItPublished) {
  Bench bench;
  bench.add<SpeedLimiter>("limiter", R"({"params": {"limit_mps": 20}})");
  auto planned = bench.input<DoubleValue>("planning/speed");
  auto limited = bench.output<DoubleValue>("control/speed");
  bench.start();

  planned.publish(speed(33.0));
  planned.publish(speed(11.0));

  const auto messages = limited.take();
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].value(), 20.0);
  EXPECT_EQ(messages[1].value(), 11.0);
  EXPECT_TRUE(limited.take().empty());
}

TEST(Bench, MovesTheClockByHand) {
  Bench bench;
  bench.add<SpeedLimiter>("limiter", R"({"serve_period_ms": 100})");
  auto capped = bench.output<DoubleValue>("control/capped");
  bench.start();
  const Time begin = bench.now();

  bench.advance(350ms);

  EXPECT_EQ(capped.take().size(), 3U);
  EXPECT_EQ(bench.now(), begin + 350ms);
}

TEST(Bench, ShowsResultsAndFaults) {
  Bench bench;
  bench.add<SpeedLimiter>("limiter", R"({"on_fault": "restart"})");
  auto planned = bench.input<DoubleValue>("planning/speed");
  bench.start();

  planned.publish(speed(-1.0));
  planned.publish(speed(40.0));
  bench.stop();

  ASSERT_EQ(bench.faults("limiter").size(), 1U);
  EXPECT_NE(bench.faults("limiter")[0].find("a speed is not negative"), std::string::npos);
  EXPECT_EQ(bench.result("limiter", "capped"), ReportValue(std::int64_t{1}));
}

TEST(Bench, ReportsEveryErrorOfAConfiguration) {
  Bench bench;
  bench.add<SpeedLimiter>("limiter", R"({"params": {"limit_mps": 99, "limit_mp": 1}})");

  try {
    bench.start();
    FAIL() << "it has two errors";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("a number in [0, 60]"), std::string::npos)
        << error.what();
    EXPECT_NE(std::string(error.what()).find("did you mean \"limit_mps\"?"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace fastcycle::testing
