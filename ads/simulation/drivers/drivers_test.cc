#include "drivers.h"

#include <cmath>
#include <cstring>
#include <set>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

constexpr double kSpeed_mps = 20.0;

// A vehicle that drives along +x, and a body ahead of it that does so as well.
class DriversTest : public ::testing::Test {
 protected:
  void add(const std::string& params) {
    bench_.add<Drivers>("drivers", R"({"params": {)" + params + "}}");
  }

  void drive(int milliseconds) {
    for (int end = elapsed_ms_ + milliseconds; elapsed_ms_ < end; elapsed_ms_ += 10) {
      world::Scene scene;
      scene.mutable_header()->set_taken_ns(bench_.now().time_since_epoch().count());
      scene.mutable_ego()->set_x_m(kSpeed_mps * 1e-3 * elapsed_ms_);
      scene.mutable_ego()->set_speed_mps(kSpeed_mps);
      auto& body = *scene.add_bodies();
      body.set_id(7);
      body.set_x_m(scene.ego().x_m() + 12.0);
      body.set_length_m(4.0);
      body.set_width_m(2.0);
      body.set_height_m(1.5);
      scenes_.publish(scene);
      bench_.advance(10ms);
    }
  }

  int elapsed_ms_ = 0;
  Bench bench_;
  Bench::Input<world::Scene> scenes_ = bench_.input<world::Scene>("world/scene");
  Bench::Output<lidar::Sweep> sweeps_ = bench_.output<lidar::Sweep>("lidar/points");
  Bench::Output<gnss::Position> positions_ = bench_.output<gnss::Position>("gnss/position");
  Bench::Output<motion::Imu> motions_ = bench_.output<motion::Imu>("imu/motion");
};

// Sweeps are large: few columns do for most tests.
constexpr const char* kSmall = R"("lidar": {"columns": 90})";

TEST_F(DriversTest, EachSensorHasItsRate) {
  add(kSmall);
  bench_.start();
  drive(1010);

  EXPECT_EQ(sweeps_.take().size(), 10U);
  EXPECT_EQ(positions_.take().size(), 11U);
  EXPECT_EQ(motions_.take().size(), 101U);
}

TEST_F(DriversTest, SweepSaysHowItWasTaken) {
  add(R"("lidar": {"mount_forward_m": 0.5})");
  bench_.start();
  drive(210);

  const auto sweeps = sweeps_.take();
  ASSERT_EQ(sweeps.size(), 2U);
  EXPECT_EQ(sweeps[1].header().taken_ns() - sweeps[0].header().taken_ns(), 100'000'000);
  EXPECT_EQ(sweeps[0].header().frame(), "lidar");
  EXPECT_EQ(sweeps[0].points().size(), 16U * sweeps[0].columns() * sweeps[0].rings());
  EXPECT_EQ(sweeps[0].points().size(), 1'843'200U);
  EXPECT_EQ(sweeps[0].mount_forward_m(), 0.5);
  // The body keeps its distance: all of its face is at one place.
  for (std::size_t offset = 0; offset < sweeps[1].points().size(); offset += sizeof(SweepPoint)) {
    SweepPoint point;
    std::memcpy(&point, sweeps[1].points().data() + offset, sizeof point);
    if (point.intensity > 100 && point.z_m < -0.4F) {
      ASSERT_NEAR(point.x_m, 9.5F, 0.11F);
    }
  }
}

TEST_F(DriversTest, PositionIsThatOfTheVehicleWithItsError) {
  add(kSmall);
  bench_.start();
  drive(5000);

  double square = 0.0;
  const auto positions = positions_.take();
  for (const auto& position : positions) {
    const double passed_s =
        static_cast<double>(position.header().taken_ns() - positions[0].header().taken_ns()) * 1e-9;
    square += std::pow(position.x_m() - kSpeed_mps * passed_s, 2.0) + std::pow(position.y_m(), 2.0);
    EXPECT_NEAR(position.stddev_m(), 0.18, 0.01);
  }
  const double stddev = std::sqrt(0.5 * square / static_cast<double>(positions.size()));
  EXPECT_GT(stddev, 0.05);
  EXPECT_LT(stddev, 0.6);
}

TEST_F(DriversTest, EveryThirdFixIsMissing) {
  add(std::string(kSmall) + R"(, "gnss": {"fix_dropout": 3})");
  bench_.start();
  drive(3000);
  EXPECT_EQ(positions_.take().size(), 20U);

  bench_.stop();
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("drivers", "fixes_dropped")), 10);
}

TEST_F(DriversTest, OtherSeedMakesOtherNoiseAndTheSameSeedTheSame) {
  const auto first_fix = [](const char* seed) {
    Bench bench;
    bench.add<Drivers>(
        "drivers", std::string(R"({"params": {"lidar": {"columns": 90}, "seed": )") + seed + "}}");
    auto scenes = bench.input<world::Scene>("world/scene");
    auto positions = bench.output<gnss::Position>("gnss/position");
    bench.start();
    scenes.publish({});
    return positions.take().at(0).x_m();
  };

  EXPECT_EQ(first_fix("1"), first_fix("1"));
  EXPECT_NE(first_fix("1"), first_fix("2"));
}

TEST_F(DriversTest, SweepsAreSpoiledFromATimeOn) {
  add(std::string(kSmall) + R"(, "lidar_fault": "nan", "lidar_fault_after_s": 0.35)");
  bench_.start();
  drive(610);

  const auto sweeps = sweeps_.take();
  ASSERT_EQ(sweeps.size(), 6U);
  const auto first_x = [](const lidar::Sweep& sweep) {
    SweepPoint point;
    std::memcpy(&point, sweep.points().data(), sizeof point);
    return point.x_m;
  };
  EXPECT_FALSE(std::isnan(first_x(sweeps[2])));
  EXPECT_TRUE(std::isnan(first_x(sweeps[3])));
  EXPECT_TRUE(std::isnan(first_x(sweeps[5])));
}

TEST_F(DriversTest, SweepsAreEmptyFromATimeOn) {
  add(std::string(kSmall) + R"(, "lidar_fault": "empty", "lidar_fault_after_s": 0.15)");
  bench_.start();
  drive(310);

  const auto sweeps = sweeps_.take();
  ASSERT_EQ(sweeps.size(), 3U);
  EXPECT_FALSE(sweeps[0].points().empty());
  EXPECT_TRUE(sweeps[1].points().empty());
  EXPECT_TRUE(sweeps[2].points().empty());
}

TEST_F(DriversTest, AfterAGapTheTurnBeginsAnew) {
  add(kSmall);
  bench_.start();
  drive(150);
  bench_.advance(1000ms);
  drive(110);

  const auto sweeps = sweeps_.take();
  ASSERT_EQ(sweeps.size(), 2U);
  EXPECT_EQ(sweeps[1].header().taken_ns() - sweeps[0].header().taken_ns(), 1'150'000'000);
}

TEST_F(DriversTest, ValuesInUseAreInTheReport) {
  add(std::string(kSmall) + R"(, "gnss": {"noise_m": 0.25})");
  bench_.start();
  bench_.stop();

  EXPECT_EQ(std::get<double>(bench_.result("drivers", "gnss_noise_m")), 0.25);
  EXPECT_EQ(std::get<double>(bench_.result("drivers", "lidar_range_stddev_m")), 0.02);
}

TEST_F(DriversTest, ErrorsMayBeLargerAndSmallerThanTheyAreSaidToBe) {
  add(std::string(kSmall) + R"(, "noise_deviation": 1.0, "seed": 5)");
  bench_.start();
  bench_.stop();

  for (const char* name :
       {"gnss_noise_size", "gnss_bias_size", "imu_noise_size", "imu_bias_size"}) {
    const double size = std::get<double>(bench_.result("drivers", name));
    EXPECT_GE(size, 0.5) << name;
    EXPECT_LE(size, 2.0) << name;
    EXPECT_NE(size, 1.0) << name;
  }
  EXPECT_EQ(std::get<double>(bench_.result("drivers", "gnss_noise_m")), 0.1);
}

TEST_F(DriversTest, ElevationsForOtherRingsAreRefused) {
  add(R"("lidar": {"rings": 3, "elevations_deg": [-3, -2]})");
  bench_.start();

  const auto faults = bench_.faults("drivers");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("expected one for each of the 3 rings, found 2"), std::string::npos);
}

}  // namespace
}  // namespace ads
