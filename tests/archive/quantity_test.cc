#include "quantity.h"

#include <limits>

#include <gtest/gtest.h>

namespace fastcycle::tool {
namespace {

TEST(Bytes, AreReadWithTheirUnit) {
  EXPECT_EQ(parse_bytes("100MB"), 100'000'000U);
  EXPECT_EQ(parse_bytes("64KiB"), 65536U);
  EXPECT_EQ(parse_bytes("1.5GB"), 1'500'000'000U);
  EXPECT_EQ(parse_bytes("7B"), 7U);
  for (const char* wrong : {"", "MB", "5", "0MB", "-1MB", "5 MB", "5mb", "1e9B", "99999999TB"}) {
    EXPECT_FALSE(parse_bytes(wrong)) << wrong;
  }
}

TEST(Bytes, AreWrittenForPeople) {
  EXPECT_EQ(bytes_text(0), "0 B");
  EXPECT_EQ(bytes_text(999), "999 B");
  EXPECT_EQ(bytes_text(12'345'678), "12.3 MB");
  EXPECT_EQ(bytes_text(std::numeric_limits<std::uint64_t>::max()), "18446744.1 TB");
}

TEST(Times, AreWrittenWithAllTheirDigits) {
  EXPECT_EQ(utc_text(0), "1970-01-01T00:00:00.000000000Z");
  EXPECT_EQ(utc_text(1'700'000'000'000'000'007), "2023-11-14T22:13:20.000000007Z");
  EXPECT_EQ(utc_text(std::numeric_limits<std::uint64_t>::max()), "2554-07-21T23:34:33.709551615Z");
  EXPECT_EQ(seconds_text(12'345'678'000), "12.345678 s");
  EXPECT_EQ(seconds_text(1), "0.000000001 s");
}

TEST(Offsets, MayBeZero) {
  EXPECT_EQ(parse_offset("0s"), 0U);
  EXPECT_EQ(parse_offset("1.5s"), 1'500'000'000U);
  EXPECT_FALSE(parse_offset("soon"));
  EXPECT_FALSE(parse_offset("-1s"));
}

}  // namespace
}  // namespace fastcycle::tool
