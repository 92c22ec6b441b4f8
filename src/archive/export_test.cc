#include "archive/export.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/test_log.h"
#include "mcap/error.h"

namespace fastcycle::archive {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct Exported {
  std::string csv;
  Table table;
};

Exported exported(const std::string& file, TableOptions options = {.topic = "scene"}) {
  const mcap::MemorySource source(mcap::bytes_of(file), "test.mcap");
  const mcap::Reader reader(source);
  Exported result;
  result.table =
      export_table(reader, "test.mcap", options, [&](std::string_view row) { result.csv += row; });
  return result;
}

std::string problem_of(const std::string& file, const TableOptions& options) {
  try {
    (void)exported(file, options);
  } catch (const mcap::Error& error) {
    return error.what();
  }
  return "";
}

TEST(Export, HasAColumnForEachFieldThatIsNoMessage) {
  const Exported result = exported(scenes(
      {"name: 'a' origin { x: 0.1 }", "image: 'xyz' kind: YARD ranges: 5", "ranges: [1, 2]"}));

  EXPECT_EQ(result.csv,
            "log_time_ns,publish_time_ns,sequence,name,origin.x,origin.y,ranges[0],ranges[1],image,"
            "kind,stamp\r\n"
            "1000,1000,1,a,0.1,0,,,0,ROAD,0\r\n"
            "1010,1010,2,,,,5,,3,YARD,0\r\n"
            "1020,1020,3,,,,1,2,0,ROAD,0\r\n");
  EXPECT_EQ(result.table.rows, 3U);
  EXPECT_EQ(result.table.columns, 11U);
  EXPECT_TRUE(result.table.cut.empty());
}

TEST(Export, RepeatedMessagesHaveTheColumnsOfAllOfThem) {
  const Exported result = exported(scenes({"points { x: 1 } points { y: 2 }", "points { x: 3 }"}));

  EXPECT_THAT(result.csv, HasSubstr("points[0].x,points[0].y,points[1].x,points[1].y"));
  EXPECT_THAT(result.csv, HasSubstr("1000,1000,1,,1,0,0,2,0,ROAD,0\r\n"));
  EXPECT_THAT(result.csv, HasSubstr("1010,1010,2,,3,0,,,0,ROAD,0\r\n"));
}

TEST(Export, MoreElementsThanColumnsAreSaid) {
  const Exported result = exported(scenes({"ranges: [1, 2, 3] parts { ranges: [1, 2, 3] }"}),
                                   {.topic = "scene", .most_elements = 2});

  EXPECT_THAT(result.table.cut, ElementsAre("ranges (up to 3 elements, 2 columns)",
                                            "parts.ranges (up to 3 elements, 2 columns)"));
  EXPECT_THAT(result.csv, HasSubstr("parts[0].ranges[1]"));
  EXPECT_EQ(result.csv.find("ranges[2]"), std::string::npos);
}

TEST(Export, TextsAreQuotedWhereTheyMust) {
  const Exported result = exported(scenes({R"(name: 'say "x", or\ny')"}));

  EXPECT_THAT(result.csv, HasSubstr("1000,1000,1,\"say \"\"x\"\", or\ny\","));
}

TEST(Export, WhatIsNoTableSaysWhy) {
  EXPECT_THAT(problem_of(good_log(), {.topic = "scenes"}),
              HasSubstr("expected a topic \"scenes\", found none"));
  EXPECT_THAT(problem_of(good_log(), {.topic = "camera/front"}),
              HasSubstr("expected messages of protobuf"));
  EXPECT_THAT(problem_of(mcap::drive(mcap::small_chunks()), {.topic = "control/speed"}),
              HasSubstr("found"));
}

TEST(Export, TooManyColumnsAreRefused) {
  std::string text;
  for (int i = 0; i < 70; ++i) {
    text += "parts { ";
    for (int k = 0; k < 70; ++k) {
      text += "ranges: 1 ";
    }
    text += "} ";
  }

  EXPECT_THAT(problem_of(scenes({text}), {.topic = "scene", .most_elements = 100}),
              HasSubstr("more than 4096 columns"));
}

}  // namespace
}  // namespace fastcycle::archive
