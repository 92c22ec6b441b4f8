#include "common/dbc.h"

#include <array>
#include <filesystem>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

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

TEST(Dbc, EncodedSignalLeavesItsNeighboursAlone) {
  const Dbc dbc = Dbc::parse(kText, "x.dbc");
  std::array<std::uint8_t, 8> big{0xf0, 0x00, 0xff, 0xff, 0x0f, 0xff, 0xff, 0xff};
  dbc.message("STEER").signal("ANGLE").encode(-3.0, big);
  dbc.message("STEER").signal("FRACTION").encode(-0.3, big);

  EXPECT_EQ(big, (std::array<std::uint8_t, 8>{0xff, 0xfe, 0xff, 0xff, 0xdf, 0xff, 0xff, 0xff}));

  std::array<std::uint8_t, 4> little{0x0f, 0x00, 0xff, 0xff};
  dbc.message("EXTENDED").signal("SPEED").encode(0x3f5 * 0.01 - 67.67, little);

  EXPECT_EQ(little, (std::array<std::uint8_t, 4>{0x5f, 0x3f, 0xff, 0xff}));
}

TEST(Dbc, ValueBeyondTheBitsBecomesTheNearestThatTheyHold) {
  const Dbc dbc = Dbc::parse(kText, "x.dbc");
  const DbcSignal& angle = dbc.message("STEER").signal("ANGLE");
  const DbcSignal& speed = dbc.message("EXTENDED").signal("SPEED");
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto there_and_back = [](const DbcSignal& signal, double value) {
    std::array<std::uint8_t, 8> payload{};
    signal.encode(value, payload);
    return signal.decode(payload);
  };

  EXPECT_EQ(there_and_back(angle, 1e9), 2047 * 1.5);
  EXPECT_EQ(there_and_back(angle, -kInfinity), -2048 * 1.5);
  EXPECT_EQ(there_and_back(angle, 2.3), 3.0);
  EXPECT_EQ(there_and_back(speed, -1e9), -67.67);
  EXPECT_EQ(there_and_back(speed, kInfinity), 1023 * 0.01 - 67.67);
}

TEST(Dbc, SignalOf64BitsIsEncoded) {
  for (const bool is_signed : {false, true}) {
    const DbcSignal all{
        .name = "X", .start_bit = 0, .bit_count = 64, .is_signed = is_signed, .unit = ""};
    std::array<std::uint8_t, 8> payload{};
    for (const double value : {0.0, 1.0, 4503599627370497.0, 9.2e18, is_signed ? -1.0 : 1.8e19}) {
      all.encode(value, payload);
      EXPECT_EQ(all.decode(payload), value);
    }
    all.encode(1e30, payload);
    EXPECT_EQ(all.decode(payload), is_signed ? 0x1p63 : 0x1p64);
  }
}

TEST(Dbc, EverySignalOfARealFileComesBackFromItsBits) {
  const Dbc dbc =
      Dbc::read(std::filesystem::path(ADS_DIR) / "applications/rav4/dbc/toyota_2017.dbc");
  std::mt19937 random;  // NOLINT(bugprone-random-generator-seed): the same bits in each run
  std::size_t signals = 0;
  for (const DbcMessage& message : dbc.messages()) {
    for (const DbcSignal& signal : message.signals) {
      if (signal.byte_count() > message.byte_count || signal.bit_count > 48) {
        continue;  // more bits than a double keeps beside an offset
      }
      for (int repeat = 0; repeat < 20; ++repeat) {
        std::vector<std::uint8_t> payload(message.byte_count);
        for (std::uint8_t& byte : payload) {
          byte = static_cast<std::uint8_t>(random());
        }
        const std::vector<std::uint8_t> original = payload;
        const double value = signal.decode(payload);
        signal.encode(0.0, payload);
        signal.encode(value, payload);
        ASSERT_EQ(payload, original) << message.name << "." << signal.name;
      }
      ++signals;
    }
  }
  EXPECT_GT(signals, 100U);
}

TEST(Dbc, MissingNamesAreNamed) {
  const Dbc dbc = Dbc::parse(kText, "x.dbc");

  EXPECT_THROW((void)dbc.message("WHEELS"), std::runtime_error);
  EXPECT_THROW((void)dbc.message("STEER").signal("WHEEL"), std::runtime_error);
}

TEST(Dbc, ErrorsAreReportedWithTheirLine) {
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
