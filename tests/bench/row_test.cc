#include "measure/row.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace fastcycle::measure {
namespace {

using nlohmann::json;

TEST(Row, IsOneObjectOnOneLine) {
  Row row{.peer = "fastcycle-park", .mode = "latency", .size = 64, .round = 2, .warmup = 1};
  measure_into(row,
               {{.number = 0, .made_ns = 0, .sent_ns = 0, .arrived_ns = 9000},
                {.number = 1, .made_ns = 100, .sent_ns = 1100, .arrived_ns = 3100},
                {.number = 2, .made_ns = 200, .sent_ns = 1200, .arrived_ns = 5200}},
               3, {.cpu_us = 30});
  row.more = R"("damaged":0,"hops":4)";

  const std::string text = to_json(row);
  const json parsed = json::parse(text);

  EXPECT_EQ(text.find('\n'), std::string::npos);
  EXPECT_EQ(parsed.at("peer"), "fastcycle-park");
  EXPECT_EQ(parsed.at("mode"), "latency");
  EXPECT_EQ(parsed.at("size"), 64);
  EXPECT_EQ(parsed.at("round"), 2);
  EXPECT_EQ(parsed.at("n"), 2);
  EXPECT_EQ(parsed.at("lost"), 1);
  EXPECT_EQ(parsed.at("mean_us"), 3.0);
  EXPECT_EQ(parsed.at("std_us"), 1.0);
  EXPECT_EQ(parsed.at("p50_us"), 2.0);
  EXPECT_EQ(parsed.at("max_us"), 4.0);
  EXPECT_EQ(parsed.at("e2e_p50_us"), 3.0);
  EXPECT_EQ(parsed.at("e2e_p99_us"), 5.0);
  EXPECT_EQ(parsed.at("cpu_us_per_msg"), 10.0);
  EXPECT_EQ(parsed.at("hops"), 4);
  for (const char* key : {"p90_us", "p99_us", "p999_us", "histogram_us", "minor_faults"}) {
    EXPECT_TRUE(parsed.contains(key)) << key;
  }
}

TEST(Row, LeavesOutWhatTheModeDoesNotMeasure) {
  const json parsed = json::parse(
      to_json({.peer = "x", .mode = "flood", .sent = 10, .received = 9, .rate_per_s = 1e6}));

  EXPECT_EQ(parsed.at("sent"), 10);
  EXPECT_EQ(parsed.at("received"), 9);
  EXPECT_EQ(parsed.at("rate_per_s"), 1e6);
  EXPECT_FALSE(parsed.contains("p50_us"));
  EXPECT_FALSE(parsed.contains("cpu_us_per_msg"));
}

}  // namespace
}  // namespace fastcycle::measure
