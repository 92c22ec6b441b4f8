#include "imu_driver.h"

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "applications/rav4/drive/small_drive.h"

namespace rav4 {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

TEST(ImuDriver, BothSensorsComeAtTheirOwnTimes) {
  const testing::SmallDrive drive("imu_driver");
  drive.stream("IMU/gyro", 3, {0.0, 0.010, 0.030, 1.0},
               {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.0, 0.0, 0.0});
  drive.stream("IMU/accelerometer", 3, {0.020}, {1.0, 2.0, -9.8});
  Bench bench;
  bench.add<ImuDriver>("imu_driver", drive.configuration());
  auto gyro = bench.output<motion::Imu>("imu/gyro");
  auto accelerometer = bench.output<motion::Imu>("imu/accelerometer");
  bench.start();

  bench.advance(15ms);
  EXPECT_EQ(gyro.take().size(), 2U);
  EXPECT_TRUE(accelerometer.take().empty());
  bench.advance(20ms);
  const auto turns = gyro.take();
  const auto accelerations = accelerometer.take();

  ASSERT_EQ(turns.size(), 1U);
  EXPECT_EQ(turns[0].angular_rate_radps().z(), 0.9);
  ASSERT_EQ(accelerations.size(), 1U);
  EXPECT_EQ(accelerations[0].acceleration_mps2().x(), 1.0);
  EXPECT_EQ(accelerations[0].acceleration_mps2().z(), -9.8);
}

TEST(ImuDriver, TimesThatGoBackAreRefused) {
  const testing::SmallDrive drive("imu_driver_back");
  drive.stream("IMU/gyro", 3, {0.1, 0.0}, {0, 0, 0, 0, 0, 0});
  Bench bench;
  bench.add<ImuDriver>("imu_driver", drive.configuration());
  bench.start();

  EXPECT_EQ(bench.faults("imu_driver").size(), 1U);
}

}  // namespace
}  // namespace rav4
