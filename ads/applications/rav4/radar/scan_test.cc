#include "scan.h"

#include <array>
#include <stdexcept>

#include <gtest/gtest.h>

namespace rav4 {
namespace {

const RadarNames kNames{.message_prefix = "TRACK_",
                        .forward = "LONG",
                        .right = "LAT",
                        .relative_speed = "SPEED",
                        .is_new = "NEW",
                        .is_valid = "VALID"};

std::string message(int address, const std::string& name) {
  return "BO_ " + std::to_string(address) + " " + name + ": 8 XXX\n" +
         " SG_ LAT : 31|11@0- (0.04,0) [-50|50] \"m\" XXX\n"
         " SG_ LONG : 15|15@0+ (0.01,0) [0|300] \"m\" XXX\n"
         " SG_ NEW : 36|1@0+ (1,0) [0|1] \"\" XXX\n"
         " SG_ SPEED : 47|12@0- (0.025,0) [-100|100] \"m/s\" XXX\n"
         " SG_ VALID : 48|1@0+ (1,0) [0|1] \"\" XXX\n\n";
}

ads::Dbc two_slots() {
  return ads::Dbc::parse(message(528, "TRACK_0") + message(529, "TRACK_1") + message(544, "OTHER"),
                         "radar.dbc");
}

RadarTrack track(std::size_t slot, bool is_valid = true) {
  return {.slot = slot, .is_valid = is_valid};
}

TEST(TrackDecoder, TrackIsDecodedByTheFile) {
  const TrackDecoder decoder(two_slots(), kNames);
  // 20 m ahead, 4 m to the right, 2 m/s closing, new and valid.
  const std::array<std::uint8_t, 8> payload{0, 0x0f, 0xa0, 0x0c, 0x90, 0xfb, 0x01, 0};

  const auto decoded = decoder.decode(529, payload);

  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->slot, 1U);
  EXPECT_DOUBLE_EQ(decoded->forward_m, 20.0);
  EXPECT_DOUBLE_EQ(decoded->left_m, -4.0);
  EXPECT_TRUE(decoded->is_new);
  EXPECT_TRUE(decoded->is_valid);
  EXPECT_DOUBLE_EQ(decoded->relative_speed_mps, -2.0);
}

TEST(TrackDecoder, OtherAndShortFramesHaveNoTrack) {
  const TrackDecoder decoder(two_slots(), kNames);
  const std::array<std::uint8_t, 8> payload{};

  EXPECT_EQ(decoder.slots(), 2U);
  EXPECT_FALSE(decoder.decode(544, payload));
  EXPECT_FALSE(decoder.decode(528, std::span(payload).first(7)));
}

TEST(TrackDecoder, FileWithoutTheMessagesIsRefused) {
  EXPECT_THROW(TrackDecoder(ads::Dbc::parse("", "x"), kNames), std::runtime_error);
  EXPECT_THROW(TrackDecoder(ads::Dbc::parse(message(1, "TRACK_1"), "x"), kNames),
               std::runtime_error);
  EXPECT_THROW(TrackDecoder(ads::Dbc::parse("BO_ 1 TRACK_0: 8 X\n", "x"), kNames),
               std::runtime_error);
}

TEST(ScanCollector, ScanIsCompleteWhenEachSlotCame) {
  ScanCollector scan(3);
  scan.add(track(2));
  scan.add(track(0, false));
  EXPECT_FALSE(scan.is_complete());

  scan.add(track(1));

  EXPECT_TRUE(scan.is_complete());
  ASSERT_EQ(scan.tracks().size(), 2U);
  EXPECT_EQ(scan.tracks()[0].slot, 2U);
}

TEST(ScanCollector, SlotThatComesAgainBeginsTheNextScan) {
  ScanCollector scan(3);
  scan.add(track(1));
  EXPECT_TRUE(scan.begins_next_scan(track(1)));
  EXPECT_FALSE(scan.begins_next_scan(track(2)));

  scan.clear();

  EXPECT_FALSE(scan.begins_next_scan(track(1)));
  EXPECT_TRUE(scan.tracks().empty());
}

}  // namespace
}  // namespace rav4
