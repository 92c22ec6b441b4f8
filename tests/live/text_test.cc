#include "live/text.h"

#include <algorithm>
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

namespace fastcycle::tool::live {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;

TEST(LiveText, SpansHaveThreeDigits) {
  EXPECT_EQ(span_text(0), "0 ns");
  EXPECT_EQ(span_text(850), "850 ns");
  EXPECT_EQ(span_text(1'000), "1.00 µs");
  EXPECT_EQ(span_text(12'345), "12.3 µs");
  EXPECT_EQ(span_text(4'560'000), "4.56 ms");
  EXPECT_EQ(span_text(1.23e9), "1.23 s");
  EXPECT_EQ(span_text(4711e9), "4711 s");
  EXPECT_EQ(span_text(-2'500), "-2.50 µs") << "a clock was set";
}

TEST(LiveText, SpansThatRoundUpDoSoIntoTheNextUnit) {
  EXPECT_EQ(span_text(999.4), "999 ns");
  EXPECT_EQ(span_text(999.6), "1.00 µs");
  EXPECT_EQ(span_text(9'996), "10.0 µs");
  EXPECT_EQ(span_text(99'960), "100 µs");
  EXPECT_EQ(span_text(999'600), "1.00 ms");
  EXPECT_EQ(span_text(999.6e6), "1.00 s");
}

TEST(LiveText, UptimesHaveTwoUnitsAtMost) {
  EXPECT_EQ(uptime_text(0), "0 s");
  EXPECT_EQ(uptime_text(60 * kSecond - 1), "59 s");
  EXPECT_EQ(uptime_text(303 * kSecond), "5 min 3 s");
  EXPECT_EQ(uptime_text(7'440 * kSecond), "2 h 4 min");
  EXPECT_EQ(uptime_text((3 * 86'400 + 3'600) * kSecond), "3 d 1 h");
}

TEST(LiveText, RatesAreWholeWhereTheyAreLarge) {
  EXPECT_EQ(rate_text(0.0), "-");
  EXPECT_EQ(rate_text(-1.0), "-");
  EXPECT_EQ(rate_text(0.5), "0.50 Hz");
  EXPECT_EQ(rate_text(99.81), "99.8 Hz");
  EXPECT_EQ(rate_text(2245.4), "2245 Hz");
}

TEST(LiveText, CountsKnowOneFromMany) {
  EXPECT_EQ(count_text(0, "message"), "0 messages");
  EXPECT_EQ(count_text(1, "message"), "1 message");
  EXPECT_EQ(count_text(2, "message"), "2 messages");
}

TEST(LiveText, TablesHaveNumbersAtTheRight) {
  EXPECT_EQ(table_text({{"topic", "rate", "from"}, {"a", "99.8 Hz", "imu"}, {"abcdefg", "-", ""}}),
            "topic       rate  from\n"
            "a        99.8 Hz  imu\n"
            "abcdefg        -\n");
}

TEST(LiveText, TablesAlignLettersOfSeveralBytes) {
  EXPECT_EQ(table_text({{"p50", "x"}, {"1 µs", "größe"}, {"100 µs", "b"}}, "  "),
            "     p50  x\n"
            "    1 µs  größe\n"
            "  100 µs  b\n");
}

TEST(LiveText, TablesMayLackCells) {
  EXPECT_EQ(table_text({}), "");
  EXPECT_EQ(table_text({{"name", "pid"}, {"car"}}),
            "name  pid\n"
            "car\n");
}

TEST(LiveText, TablesHaveNothingThatATerminalWouldObey) {
  const std::string text = table_text({{"name"}, {"a\x1b[2J\n"}});
  EXPECT_EQ(text.find('\x1b'), std::string::npos);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2);
}

}  // namespace
}  // namespace fastcycle::tool::live
