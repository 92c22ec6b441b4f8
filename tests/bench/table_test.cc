#include "bench/table.h"

#include <gtest/gtest.h>

namespace fastcycle::tool::bench {
namespace {

TEST(Table, ShowsMediansOverRoundsAndSumsOfLosses) {
  Table table({{"size", "size"}, {"peer", "peer"}, {"p50", "p50_us"}, {"lost", "lost", 0}});
  for (const double p50_us : {3.0, 1.0, 2.0}) {
    table.add({0, 1}, {{"size", 32768}, {"peer", "ours"}, {"p50_us", p50_us}, {"lost", 1}});
  }
  table.add({0, 0}, {{"size", 64}, {"peer", "floor"}, {"p50_us", 1.25}});

  EXPECT_EQ(table.to_text(),
            "  size  peer   p50  lost\n"
            "  64 B  floor  1.2     -\n"
            "32 KiB  ours   2.0     3\n");
}

TEST(Table, ShowsQuartilesOverRoundsWhereTheyAreAskedFor) {
  Table table({{"size", "size"}, {"cost", "cost_ns", 0, true}});
  for (const double cost_ns : {40.0, 10.0, 30.0, 20.0, 1000.0}) {
    table.add({0, 0}, {{"size", 64}, {"cost_ns", cost_ns}});
  }
  table.add({0, 1}, {{"size", 64}, {"cost_ns", 7}});

  EXPECT_EQ(table.to_text(),
            "size         cost\n"
            "64 B  30 [20, 40]\n"
            "64 B            7\n");
}

TEST(Table, StandsUprightWithALineForEachColumn) {
  Table table({{"time, µs", "time_us"}, {"bytes a topic", "bytes", 0}}, true);
  table.add({0, 0}, {{"time_us", 4.04}, {"bytes", 1000}});

  EXPECT_EQ(table.to_text(),
            "time, µs        4.0\n"
            "bytes a topic  1000\n");
}

TEST(Median, OfAnEvenNumberIsBetweenTheTwoInTheMiddle) {
  EXPECT_DOUBLE_EQ(median({4, 1, 3, 2}), 2.5);
  EXPECT_DOUBLE_EQ(median({7}), 7);
}

TEST(SizeText, HasTheLargestWholeUnit) {
  EXPECT_EQ(size_text(64), "64 B");
  EXPECT_EQ(size_text(32 << 10), "32 KiB");
  EXPECT_EQ(size_text(4 << 20), "4 MiB");
  EXPECT_EQ(size_text(1500), "1500 B");
}

}  // namespace
}  // namespace fastcycle::tool::bench
