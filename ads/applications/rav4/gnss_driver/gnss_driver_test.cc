#include "gnss_driver.h"

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "applications/rav4/drive/small_drive.h"

namespace rav4 {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

TEST(GnssDriver, FixesComeWhenTheyArrived) {
  const testing::SmallDrive drive("gnss_driver");
  drive.can({0.0}, {0xaa}, {0}, {"12345678"});
  drive.stream("GNSS/live_gnss_ublox", 6, {0.05, 0.15, 1.0},
               {37.7, -122.4, 8.0, 1.5e12, 33.0, 2.0, 37.8, -122.5, 9.0, 1.5e12 + 100.0, 34.0, 3.0,
                0.0, 0.0, 0.0, 0.0, 0.0, 0.0});
  Bench bench;
  bench.add<GnssDriver>("gnss_driver", drive.configuration());
  auto fixes = bench.output<gnss::Fix>("gnss/fix");
  bench.start();

  bench.advance(40ms);
  EXPECT_TRUE(fixes.take().empty());
  bench.advance(20ms);
  const auto first = fixes.take();
  bench.advance(100ms);
  const auto second = fixes.take();

  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].latitude_deg(), 37.7);
  EXPECT_EQ(first[0].longitude_deg(), -122.4);
  EXPECT_EQ(first[0].speed_mps(), 8.0);
  EXPECT_EQ(first[0].utc_ms(), 1.5e12);
  EXPECT_EQ(first[0].altitude_m(), 33.0);
  EXPECT_EQ(first[0].course_deg(), 2.0);
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(second[0].latitude_deg(), 37.8);
}

TEST(GnssDriver, GoesOnAfterATunnelWithoutTheFixesOfIt) {
  const testing::SmallDrive drive("gnss_driver_tunnel");
  drive.can({0.0}, {0xaa}, {0}, {"12345678"});
  drive.stream(
      "GNSS/live_gnss_ublox", 6, {0.05, 0.15, 0.25},
      {1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0});
  Bench bench;
  bench.add<GnssDriver>("gnss_driver", drive.configuration());
  auto fixes = bench.output<gnss::Fix>("gnss/fix");
  bench.start();

  bench.advance(100ms);
  bench.deactivate("gnss_driver");
  bench.advance(100ms);
  bench.activate("gnss_driver");
  bench.advance(100ms);

  const auto received = fixes.take();
  ASSERT_EQ(received.size(), 2U);
  EXPECT_EQ(received[0].latitude_deg(), 1.0);
  EXPECT_EQ(received[1].latitude_deg(), 3.0);
}

TEST(GnssDriver, MissingDriveIsNamed) {
  Bench bench;
  bench.add<GnssDriver>("gnss_driver", R"({"params": {"data": "/no/such/drive"}})");
  bench.start();

  const auto faults = bench.faults("gnss_driver");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("/no/such/drive"), std::string::npos) << faults[0];
}

}  // namespace
}  // namespace rav4
