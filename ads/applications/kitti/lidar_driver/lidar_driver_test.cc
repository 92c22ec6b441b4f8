#include "lidar_driver.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "applications/kitti/drive/small_drive.h"

namespace kitti {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

TEST(LidarDriver, SweepsComeWhenTheirTurnIsOver) {
  const testing::SmallDrive drive("lidar_driver");
  drive.sweep(5, {{10.0F, 1.0F, 0.5F, 1.0F}});
  drive.sweep(7, {{0.0F, -10.0F, 0.5F, 0.0F}});
  Bench bench;
  bench.add<LidarDriver>("lidar_driver", drive.configuration());
  auto sweeps = bench.output<lidar::Sweep>("lidar/points");
  bench.start();

  bench.advance(99ms);
  EXPECT_TRUE(sweeps.take().empty());
  bench.advance(2ms);
  const auto first = sweeps.take();
  bench.advance(150ms);
  EXPECT_TRUE(sweeps.take().empty()) << "frame 6 is missing";
  bench.advance(50ms);
  const auto second = sweeps.take();

  ASSERT_EQ(first.size(), 1U);
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(second[0].header().taken_ns() - first[0].header().taken_ns(), 2 * kFrame_ns);
  const std::string& points = second[0].points();
  ASSERT_EQ(points.size(), std::size_t{16} * second[0].columns() * second[0].rings());
  int returns = 0;
  for (std::size_t offset = 0; offset < points.size(); offset += 16) {
    float place[3];
    std::uint16_t time = 0;
    std::memcpy(place, points.data() + offset, sizeof place);
    std::memcpy(&time, points.data() + offset + 12, sizeof time);
    if (place[1] == -10.0F) {
      ++returns;
      EXPECT_EQ(time, 49152) << "to the right after three quarters of a turn";
    }
  }
  EXPECT_EQ(returns, 1);
}

TEST(LidarDriver, EachSecondPassGoesBackInTime) {
  const testing::SmallDrive drive("lidar_driver_passes");
  drive.sweep(5, {{10.0F, 1.0F, 0.5F, 1.0F}});
  drive.sweep(7, {{0.0F, -10.0F, 0.5F, 0.0F}});
  Bench bench;
  bench.add<LidarDriver>(
      "lidar_driver", R"({"params": {"passes": 2, "data": ")" + drive.folder().string() + R"("}})");
  auto sweeps = bench.output<lidar::Sweep>("lidar/points");
  bench.start();

  bench.advance(650ms);

  const auto all = sweeps.take();
  ASSERT_EQ(all.size(), 4U);
  std::vector<std::int64_t> frames;
  for (const lidar::Sweep& sweep : all) {
    frames.push_back((sweep.header().taken_ns() - all[0].header().taken_ns()) / kFrame_ns);
  }
  EXPECT_EQ(frames, (std::vector<std::int64_t>{0, 2, 3, 5}));
  const auto time_of = [](const std::string& points) {
    std::uint16_t time = 0;
    for (std::size_t offset = 0; offset < points.size(); offset += 16) {
      std::uint16_t its_time = 0;
      std::memcpy(&its_time, points.data() + offset + 12, sizeof its_time);
      time = std::max(time, its_time);
    }
    return time;
  };
  EXPECT_EQ(time_of(all[1].points()), 49152) << "to the right after three quarters of a turn";
  EXPECT_NEAR(time_of(all[2].points()), 16384, 1) << "and backwards after one";
}

TEST(LidarDriver, MissingDriveIsNamed) {
  Bench bench;
  bench.add<LidarDriver>("lidar_driver", R"({"params": {"data": "/no/such/drive"}})");
  bench.start();

  const auto faults = bench.faults("lidar_driver");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("/no/such/drive"), std::string::npos) << faults[0];
}

}  // namespace
}  // namespace kitti
