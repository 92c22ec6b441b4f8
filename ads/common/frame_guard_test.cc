#include "common/frame_guard.h"

#include <array>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

namespace ads {
namespace {

using Payload = std::array<std::uint8_t, 4>;
using Verdict = FrameGuard::Verdict;

Dbc bus(std::string_view counter_bits = "4", std::string_view address = "257") {
  return Dbc::parse("BO_ " + std::string(address) +
                        " M: 4 X\n SG_ VALUE : 0|16@1+ (1,0) [0|0] \"\" X\n SG_ COUNTER : 16|" +
                        std::string(counter_bits) +
                        "@1+ (1,0) [0|0] \"\" X\n SG_ CHECKSUM : 24|8@1+ (1,0) [0|0] \"\" X\n",
                    "x.dbc");
}

Payload sealed(FrameGuard& sender, std::uint8_t value) {
  Payload payload{value, 0, 0, 0};
  sender.seal(payload);
  return payload;
}

TEST(FrameGuard, ChecksumIsTheOneOfTheStandard) {
  const std::string text = "123456789";

  EXPECT_EQ(crc8({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}), 0x4b);
}

TEST(FrameGuard, ChecksumGoesOnFromBytesBefore) {
  const std::array<std::uint8_t, 5> bytes{1, 2, 3, 4, 5};

  EXPECT_EQ(crc8(std::span(bytes).last(3), crc8(std::span(bytes).first(2))), crc8(bytes));
}

TEST(FrameGuard, SealedFramesAreGood) {
  FrameGuard sender(bus().message("M"));
  FrameGuard receiver(bus().message("M"));

  for (std::uint8_t value = 0; value < 100; ++value) {
    ASSERT_EQ(receiver.check(sealed(sender, value)), Verdict::kGood);
  }
  EXPECT_EQ(receiver.lost(), 0U);
}

TEST(FrameGuard, EveryBitThatFlipsIsSeen) {
  FrameGuard sender(bus().message("M"));
  FrameGuard receiver(bus().message("M"));
  const Payload payload = sealed(sender, 77);

  for (std::size_t bit = 0; bit < 32; ++bit) {
    Payload changed = payload;
    changed[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    EXPECT_EQ(receiver.check(changed), Verdict::kWrongChecksum);
  }
  EXPECT_EQ(receiver.check(payload), Verdict::kGood);
}

TEST(FrameGuard, FrameOfAnotherAddressIsWrong) {
  FrameGuard sender(bus("4", "258").message("M"));
  FrameGuard receiver(bus().message("M"));

  EXPECT_EQ(receiver.check(sealed(sender, 1)), Verdict::kWrongChecksum);
}

TEST(FrameGuard, RepeatedFrameIsRefusedAndLostOnesAreCounted) {
  FrameGuard sender(bus().message("M"));
  FrameGuard receiver(bus().message("M"));
  const Payload first = sealed(sender, 1);

  EXPECT_EQ(receiver.check(first), Verdict::kGood);
  EXPECT_EQ(receiver.check(first), Verdict::kRepeated);
  sealed(sender, 2);
  sealed(sender, 3);
  EXPECT_EQ(receiver.check(sealed(sender, 4)), Verdict::kGood);
  EXPECT_EQ(receiver.lost(), 2U);
}

TEST(FrameGuard, LengthHasToFit) {
  FrameGuard receiver(bus().message("M"));

  EXPECT_EQ(receiver.check({}), Verdict::kWrongLength);
  EXPECT_EQ(receiver.check(std::array<std::uint8_t, 8>{}), Verdict::kWrongLength);
}

TEST(FrameGuard, MessageNeedsCounterAndChecksum) {
  const Dbc bare = Dbc::parse("BO_ 1 M: 8 X\n", "x.dbc");

  EXPECT_THROW(FrameGuard(bare.message("M")), std::runtime_error);
  EXPECT_THROW(FrameGuard(bus("1").message("M")), std::runtime_error);
}

}  // namespace
}  // namespace ads
