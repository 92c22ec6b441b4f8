#include "can_driver.h"

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "applications/rav4/drive/small_drive.h"

namespace rav4 {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

constexpr std::int64_t kMillisecond_ns = 1'000'000;

TEST(CanDriver, FramesComeAtTheirTimesWithAllOfTheirContent) {
  const testing::SmallDrive drive("can_driver_times");
  drive.can({0.0, 0.010, 0.010, 0.030, 1.0}, {0xaa, 0x25, 0x210, 0x7ff, 1}, {0, 128, 1, 0, 0},
            {"12345678", std::string(8, '\0'), "abcdefgh", "xxxxxxxx", "87654321"});
  Bench bench;
  bench.add<CanDriver>("can_driver", drive.configuration());
  auto frames = bench.output<can::Frame>("can/frames");
  bench.start();
  const std::int64_t start_ns = nanoseconds_of(bench.now());
  bench.advance(20ms);

  const auto early = frames.take();
  bench.advance(20ms);
  const auto late = frames.take();

  ASSERT_EQ(early.size(), 3U);
  EXPECT_EQ(early[0].header().taken_ns(), start_ns);
  EXPECT_EQ(early[0].address(), 0xaaU);
  EXPECT_EQ(early[0].data(), "12345678");
  EXPECT_NEAR(static_cast<double>(early[2].header().taken_ns() - start_ns), 10.0 * kMillisecond_ns,
              20.0);
  EXPECT_EQ(early[1].bus(), 128U);
  EXPECT_EQ(early[1].data(), std::string(8, '\0'));
  ASSERT_EQ(late.size(), 1U);
  EXPECT_EQ(late[0].address(), 0x7ffU);
}

TEST(CanDriver, DamagedFileIsNamed) {
  const testing::SmallDrive drive("can_driver_damaged");
  drive.can({0.0}, {0xaa}, {0}, {"12345678"});
  drive.truncate("processed_log/CAN/raw_can/data.npy");
  Bench bench;
  bench.add<CanDriver>("can_driver", drive.configuration());
  bench.start();

  const auto faults = bench.faults("can_driver");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("data.npy: expected 1 rows of 8 bytes, found 7 bytes"),
            std::string::npos)
      << faults[0];
}

TEST(CanDriver, StreamsOfDifferentLengthAreRefused) {
  const testing::SmallDrive drive("can_driver_lengths");
  drive.can({0.0, 0.1}, {0xaa}, {0, 0}, {"12345678", "12345678"});
  Bench bench;
  bench.add<CanDriver>("can_driver", drive.configuration());
  bench.start();

  EXPECT_EQ(bench.faults("can_driver").size(), 1U);
}

TEST(CanDriver, AddressThatIsNoneIsRefused) {
  const testing::SmallDrive drive("can_driver_address");
  drive.can({0.0}, {-1}, {0}, {"12345678"});
  Bench bench;
  bench.add<CanDriver>("can_driver", drive.configuration());
  bench.start();

  EXPECT_EQ(bench.faults("can_driver").size(), 1U);
}

}  // namespace
}  // namespace rav4
