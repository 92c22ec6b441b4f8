#include "gnss_receiver.h"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include <fastcycle/testing.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using namespace std::chrono_literals;

// The receiver's end of a serial line.
class Line {
 public:
  Line() : end_(checked_descriptor(::posix_openpt(O_RDWR | O_NOCTTY), "posix_openpt")) {
    EXPECT_EQ(::grantpt(end_.get()), 0);
    EXPECT_EQ(::unlockpt(end_.get()), 0);
    path = ::ptsname(end_.get());
  }
  void send(const std::string& bytes) {
    EXPECT_EQ(::write(end_.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  void hang_up() { end_.reset(); }

  std::string path;

 private:
  Descriptor end_;
};

class GnssReceiverTest : public ::testing::Test {
 protected:
  void start(const std::string& more) {
    bench_.add<GnssReceiver>(
        "gnss", fmt::format(R"({{"params": {{"device": "{}", "baud": 115200, "retry_first_s": 0.01,
                            "origin_latitude_deg": 48.0, "origin_longitude_deg": 11.0 {}}}}})",
                            line_.path, more));
    bench_.start();
  }

  bool advance_until(const std::function<bool()>& holds) {
    const auto limit = std::chrono::steady_clock::now() + 60s;
    while (!holds()) {
      if (std::chrono::steady_clock::now() > limit) {
        return false;
      }
      bench_.advance(10ms);
      for (gnss::Position& position : positions_.take()) {
        received_.push_back(std::move(position));
      }
      std::this_thread::sleep_for(1ms);
    }
    return true;
  }

  // What is sent before the line is open is lost.
  bool send_until_received(const GnssFix& fix, bool is_ubx) {
    return advance_until([&] {
      line_.send(is_ubx ? encode_nav_pvt(fix) : encode_nmea(fix));
      return !received_.empty();
    });
  }

  [[nodiscard]] static GnssFix fix_at(double x_m, double y_m) {
    const LocalFrame map(GeodeticPosition{.latitude_deg = 48.0, .longitude_deg = 11.0});
    return {.position = map.geodetic_from_enu({x_m, y_m, 0.0}),
            .stddev_m = 0.25,
            .second_of_day = 100.0};
  }

  Line line_;
  Bench bench_;
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Output<gnss::Position> positions_ = bench_.output<gnss::Position>("gnss/position");
  std::vector<gnss::Position> received_;
};

TEST_F(GnssReceiverTest, SentencesBecomePositionsInTheMap) {
  start(R"(, "latency_s": 0.5)");

  ASSERT_TRUE(send_until_received(fix_at(123.4, -56.7), false));

  EXPECT_NEAR(received_[0].x_m(), 123.4, 2e-3);
  EXPECT_NEAR(received_[0].y_m(), -56.7, 2e-3);
  EXPECT_NEAR(received_[0].stddev_m(), 0.25, 1e-6);
  EXPECT_EQ(received_[0].header().frame(), "map");
  const auto age_ns = bench_.now().time_since_epoch().count() - received_[0].header().taken_ns();
  EXPECT_GE(age_ns, 500'000'000);
}

TEST_F(GnssReceiverTest, FramesOfUbxToo) {
  start("");

  ASSERT_TRUE(send_until_received(fix_at(-10.0, 20.0), true));

  EXPECT_NEAR(received_[0].x_m(), -10.0, 0.02);
  EXPECT_NEAR(received_[0].y_m(), 20.0, 0.02);
}

TEST_F(GnssReceiverTest, PositionsAreThoseOfTheVehiclesCentre) {
  start(R"(, "antenna_forward_m": -1.5, "antenna_left_m": 0.5)");
  localization::Ego ego;
  ego.set_quality(localization::GOOD);
  ego.set_heading_rad(0.5 * std::numbers::pi);
  egos_.publish(ego);

  ASSERT_TRUE(send_until_received(fix_at(10.0, 20.0), false));

  EXPECT_NEAR(received_[0].x_m(), 10.5, 2e-3);
  EXPECT_NEAR(received_[0].y_m(), 21.5, 2e-3);
}

TEST_F(GnssReceiverTest, PositionsAreLessCertainUntilTheHeadingIsKnown) {
  start(R"(, "antenna_forward_m": -1.5)");

  ASSERT_TRUE(send_until_received(fix_at(10.0, 20.0), false));

  EXPECT_NEAR(received_[0].x_m(), 10.0, 2e-3);
  EXPECT_NEAR(received_[0].stddev_m(), std::hypot(0.25, 1.5), 1e-6);
}

TEST_F(GnssReceiverTest, ALineThatIsHungUpDoesNotEndTheRun) {
  start("");
  ASSERT_TRUE(send_until_received(fix_at(0.0, 0.0), false));

  line_.hang_up();
  bench_.advance(200ms);
  std::this_thread::sleep_for(50ms);
  bench_.advance(200ms);
  bench_.stop();

  EXPECT_TRUE(bench_.faults("gnss").empty());
  EXPECT_GE(std::get<std::int64_t>(bench_.result("gnss", "positions")), 1);
}

}  // namespace
}  // namespace ads
