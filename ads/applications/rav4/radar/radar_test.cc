#include "radar.h"

#include <fstream>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "applications/rav4/drive/small_drive.h"

namespace rav4 {
namespace {

using fastcycle::testing::Bench;

std::string slot_message(int address, const std::string& name) {
  return "BO_ " + std::to_string(address) + " " + name + ": 8 XXX\n" +
         " SG_ LAT_DIST : 31|11@0- (0.04,0) [-50|50] \"m\" XXX\n"
         " SG_ LONG_DIST : 15|15@0+ (0.01,0) [0|300] \"m\" XXX\n"
         " SG_ NEW_TRACK : 36|1@0+ (1,0) [0|1] \"\" XXX\n"
         " SG_ REL_SPEED : 47|12@0- (0.025,0) [-100|100] \"m/s\" XXX\n"
         " SG_ VALID : 48|1@0+ (1,0) [0|1] \"\" XXX\n\n";
}

can::Frame frame(std::uint32_t address, bool is_valid) {
  can::Frame message;
  message.mutable_header()->set_taken_ns(address);
  message.set_address(address);
  message.set_bus(1);
  message.set_data(std::string("\x00\x0f\xa0\x0c\x90\xfb", 6) + (is_valid ? '\x01' : '\x00') +
                   '\0');
  return message;
}

class RadarTest : public ::testing::Test {
 protected:
  RadarTest() {
    const auto dbc = drive_.folder() / "radar.dbc";
    std::ofstream(dbc) << slot_message(528, "TRACK_A_0") << slot_message(529, "TRACK_A_1");
    bench_.add<Radar>("radar", R"({"params": {"dbc": ")" + dbc.string() + R"("}})");
  }

  testing::SmallDrive drive_{"radar"};
  Bench bench_;
  Bench::Input<can::Frame> frames_ = bench_.input<can::Frame>("can/frames");
  Bench::Output<radar::Tracks> scans_ = bench_.output<radar::Tracks>("radar/tracks");
};

TEST_F(RadarTest, ScanIsPublishedWhenEachSlotCame) {
  bench_.start();

  frames_.publish(frame(529, true));
  EXPECT_TRUE(scans_.take().empty());
  frames_.publish(frame(528, false));

  const auto scans = scans_.take();
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0].header().taken_ns(), 528);
  ASSERT_EQ(scans[0].tracks_size(), 1);
  EXPECT_EQ(scans[0].tracks(0).slot(), 1U);
  EXPECT_DOUBLE_EQ(scans[0].tracks(0).forward_m(), 20.0);
  EXPECT_DOUBLE_EQ(scans[0].tracks(0).left_m(), -4.0);
  EXPECT_DOUBLE_EQ(scans[0].tracks(0).relative_speed_mps(), -2.0);
}

TEST_F(RadarTest, ScanWithAMissingSlotIsPublishedWhenTheNextBegins) {
  bench_.start();

  frames_.publish(frame(529, true));
  frames_.publish(frame(529, false));

  const auto scans = scans_.take();
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0].tracks_size(), 1);
}

TEST_F(RadarTest, ValidTracksAreCounted) {
  bench_.start();
  frames_.publish(frame(528, true));
  frames_.publish(frame(529, false));
  frames_.publish(frame(529, true));
  bench_.stop();

  EXPECT_EQ(std::get<std::int64_t>(bench_.result("radar", "radar_tracks")), 2);
}

}  // namespace
}  // namespace rav4
