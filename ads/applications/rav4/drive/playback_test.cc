#include "applications/rav4/drive/playback.h"

#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace rav4 {
namespace {

using std::chrono_literals::operator""ms;

TEST(DriveClock, BeginsWithTheFirstSensorRow) {
  const DriveClock clock(100.0);

  EXPECT_EQ(clock.offset_of(100.25), 250ms);
  EXPECT_EQ(clock.offset_of(99.75), -250ms);
}

TEST(DriveClock, AbsurdTimesAreRefused) {
  const DriveClock clock(100.0);

  EXPECT_THROW((void)clock.offset_of(std::numeric_limits<double>::quiet_NaN()), std::runtime_error);
  EXPECT_THROW((void)clock.offset_of(1e300), std::runtime_error);
}

TEST(DriveClock, MissingFolderIsNamed) {
  EXPECT_THROW(DriveClock::read("no/such/drive"), std::runtime_error);
}

TEST(Playback, RowsAreTakenOnceWhenDue) {
  Playback playback(DriveClock(100.0), {100.0, 100.1, 100.1, 100.2}, "t");

  EXPECT_EQ(playback.take_due(0ms)->index, 0U);
  EXPECT_FALSE(playback.take_due(0ms));
  EXPECT_EQ(playback.next_due(), 100ms);
  EXPECT_EQ(playback.take_due(150ms)->index, 1U);
  EXPECT_EQ(playback.take_due(150ms)->offset, 100ms);
  EXPECT_FALSE(playback.take_due(150ms));
  EXPECT_EQ(playback.take_due(1000ms)->index, 3U);
  EXPECT_FALSE(playback.next_due());
}

TEST(Playback, StreamWithoutRowsIsNeverDue) {
  Playback playback(DriveClock(100.0), {}, "t");

  EXPECT_FALSE(playback.next_due());
  EXPECT_FALSE(playback.take_due(1000ms));
}

TEST(Playback, TimesThatDecreaseAreRefused) {
  EXPECT_THROW(Playback(DriveClock(0.0), {1.0, 0.5}, "t"), std::runtime_error);
}

TEST(Playback, EarlierOfTwoTimesMayBeTheOnlyOne) {
  EXPECT_EQ(earlier(1ms, 2ms), 1ms);
  EXPECT_EQ(earlier(std::nullopt, 2ms), 2ms);
  EXPECT_EQ(earlier(std::nullopt, std::nullopt), std::nullopt);
}

}  // namespace
}  // namespace rav4
