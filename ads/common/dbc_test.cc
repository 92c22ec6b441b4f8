#include "common/dbc.h"

#include <array>
#include <stdexcept>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr std::string_view kText = R"(VERSION ""

NS_ :
    BO_TX_BU_
    SG_MUL_VAL_

BU_: XXX

BO_ 37 STEER: 8 XXX
 SG_ ANGLE : 3|12@0- (1.5,0) [-500|500] "deg" XXX
 SG_ FRACTION : 39|4@0- (0.1,0) [-0.7|0.7] "deg" XXX

BO_ 2147483700 EXTENDED: 4 XXX
 SG_ SPEED m0 : 4|10@1+ (0.01,-67.67) [0|0] "km/h" A,B

CM_ BO_ 37 "a comment
BO_ this is no message
";
)";

std::string refusal(std::string_view text) {
  try {
    Dbc::parse(text, "x.dbc");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(Dbc, MessagesAndSignalsAreFoundByName) {
  const Dbc dbc = Dbc::parse(kText, "x.dbc");

  EXPECT_EQ(dbc.messages().size(), 2U);
  EXPECT_EQ(dbc.message("STEER").address, 37U);
  EXPECT_EQ(dbc.message("STEER").signal("FRACTION").bit_count, 4U);
  EXPECT_TRUE(dbc.message("EXTENDED").is_extended);
  EXPECT_EQ(dbc.message("EXTENDED").address, 52U);
}

TEST(Dbc, MotorolaSignalCrossesBytesDownwards) {
  const Dbc dbc = Dbc::parse(kText, "x.dbc");
  const std::array<std::uint8_t, 8> payload{0x0f, 0xfe, 0, 0, 0xd0, 0, 0, 0};

  EXPECT_DOUBLE_EQ(dbc.message("STEER").signal("ANGLE").decode(payload), -3.0);
  EXPECT_DOUBLE_EQ(dbc.message("STEER").signal("FRACTION").decode(payload), -0.3);
}

TEST(Dbc, IntelSignalCrossesBytesUpwards) {
  const Dbc dbc = Dbc::parse(kText, "x.dbc");
  const std::array<std::uint8_t, 4> payload{0x5f, 0xff, 0, 0};

  EXPECT_DOUBLE_EQ(dbc.message("EXTENDED").signal("SPEED").decode(payload), 0x3f5 * 0.01 - 67.67);
}

TEST(Dbc, SignalOf64BitsIsDecoded) {
  const DbcSignal big{.name = "X",
                      .start_bit = 7,
                      .bit_count = 64,
                      .is_big_endian = true,
                      .is_signed = true,
                      .unit = ""};
  const std::array<std::uint8_t, 8> payload{0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xfe};

  EXPECT_EQ(big.byte_count(), 8U);
  EXPECT_EQ(big.decode(payload), -2.0);
}

TEST(Dbc, SignalThatDoesNotFitItsMessageCannotBeUsed) {
  const Dbc dbc = Dbc::parse("BO_ 1 M: 2 X\n SG_ S : 15|12@0+ (1,0) [0|1] \"\" X\n", "x.dbc");

  EXPECT_THROW((void)dbc.message("M").signal("S"), std::runtime_error);
}

TEST(Dbc, MissingNamesAreNamed) {
  const Dbc dbc = Dbc::parse(kText, "x.dbc");

  EXPECT_THROW((void)dbc.message("WHEELS"), std::runtime_error);
  EXPECT_THROW((void)dbc.message("STEER").signal("WHEEL"), std::runtime_error);
}

TEST(Dbc, MistakesAreToldWithTheirLine) {
  EXPECT_EQ(refusal("\nBO_ x M: 8 X\n"),
            "x.dbc:2: expected a message's identifier, found 'x M: 8 X'");
  EXPECT_EQ(refusal(" SG_ S : 0|1@1+ (1,0) [0|1] \"\" X"),
            "x.dbc:1: expected a message (BO_) before its signals, found ' S : 0|1@1+ (1,0) [0|1] "
            "\"\" X'");
  EXPECT_NE(refusal("BO_ 1 M: 8 X\n SG_ S : 0|65@1+ (1,0) [0|1] \"\" X"), "");
  EXPECT_NE(refusal("BO_ 1 M: 8 X\n SG_ S : 9999|1@1+ (1,0) [0|1] \"\" X"), "");
  EXPECT_NE(refusal("BO_ 1 M: 8 X\n SG_ S : 0|1@1+ (nan,0) [0|1] \"\" X"), "");
  EXPECT_NE(refusal("BO_ 1 M: 8 X\nBO_ 2 M: 8 X\n"), "");
}

TEST(Dbc, NoPrefixOfAFileDoesHarm) {
  for (std::size_t size = 0; size < kText.size(); ++size) {
    refusal(kText.substr(0, size));
  }
}

TEST(Dbc, UnitsBecomeSi) {
  EXPECT_DOUBLE_EQ(36.0 * si_per_unit("km/h"), 10.0);
  EXPECT_EQ(si_per_unit("m"), 1.0);
  EXPECT_THROW(si_per_unit("furlong"), std::runtime_error);
}

}  // namespace
}  // namespace ads
