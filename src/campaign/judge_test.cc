#include "campaign/judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace fastcycle::campaign {
namespace {

using nlohmann::ordered_json;

const ordered_json& report() {
  static const ordered_json it = ordered_json::parse(R"({
      "time_s": 16.0, "end": "time is over",
      "components": {
        "world": {"faults": 0, "results": {"collisions": 1, "goal_reached": false, "gap_m": null}},
        "control": {"faults": 2, "results": {"verdict": "failed", "goal_reached": true}},
        "gateway": {"faults": 0, "results": {"parameters lost": 3, "deviation.gain": 0.5}}},
      "topics": {"can/command": {"published": 800}},
      "results": {"collisions": 1, "verdict": "failed", "goal_reached": true,
        "world.goal_reached": false, "gap_m": null, "parameters lost": 3, "deviation.gain": 0.5}})");
  return it;
}

std::string fault_of(const std::string& text) {
  std::string why;
  const auto judge = Judge::parse(text, why);
  return judge ? judge->find_fault(report()) : why;
}

TEST(Judge, FindsResultsByNameWithAndWithoutTheirComponent) {
  EXPECT_EQ(fault_of("collisions == 1"), "");
  EXPECT_EQ(fault_of("world.collisions==1"), "");
  EXPECT_EQ(fault_of("world.goal_reached == false"), "");
  EXPECT_EQ(fault_of("results.collisions <= 1"), "");
}

TEST(Judge, TakesNoResultOfAnotherComponent) {
  EXPECT_EQ(fault_of("control.gap_m == null"), "the report has no control.gap_m");
  EXPECT_THAT(fault_of("control.collisions == 1"),
              testing::StartsWith("the report has no control.collisions"));
  EXPECT_EQ(fault_of("control.goal_reached == true"), "");
  EXPECT_EQ(fault_of("world.goal_reached == true"), "world.goal_reached is false");
  EXPECT_EQ(fault_of("world.colisions == 1"),
            "the report has no world.colisions; did you mean \"world.collisions\"?");
}

TEST(Judge, TakesNamesWithDotsAndWithBlanksInQuotes) {
  EXPECT_EQ(fault_of("deviation.gain <= 0.5"), "");
  EXPECT_EQ(fault_of("gateway.deviation.gain <= 0.5"), "");
  EXPECT_EQ(fault_of("\"parameters lost\" == 0"), "parameters lost is 3");
  EXPECT_EQ(fault_of("\"gateway.parameters lost\" == 3"), "");
  EXPECT_EQ(fault_of("\"a == \\\" 1\" == 3"), "the report has no a == \" 1");
}

TEST(Judge, ComparesWithTheFirstComparisonInTheText) {
  EXPECT_EQ(fault_of("collisions<=1"), "");
  EXPECT_EQ(fault_of("verdict != \"a == 1 && b, c\""), "");
  EXPECT_EQ(fault_of("collisions > -1e3"), "");
}

TEST(Judge, FindsWhateverElseTheReportHas) {
  EXPECT_EQ(fault_of("components.control.faults < 3"), "");
  EXPECT_EQ(fault_of("topics.can/command.published >= 800"), "");
  EXPECT_EQ(fault_of("end == \"time is over\""), "");
  EXPECT_EQ(fault_of("verdict != reached"), "");
}

TEST(Judge, SaysWhatIsNotAsItShouldBe) {
  EXPECT_EQ(fault_of("collisions == 0"), "collisions is 1");
  EXPECT_EQ(fault_of("components.control.faults < 2"), "components.control.faults is 2");
  EXPECT_EQ(fault_of("gap_m > 0.5"), "gap_m is null");
  EXPECT_EQ(fault_of("colisions == 0"),
            "the report has no colisions; did you mean \"collisions\"?");
  EXPECT_EQ(fault_of("whatever == 0"), "the report has no whatever");
}

TEST(Judge, RefusesWhatIsNoCondition) {
  for (const char* text : {"",
                           "collisions",
                           "== 3",
                           "collisions ==",
                           "verdict < failed",
                           "a == [1]",
                           "collisions != 5 && got > 100000",
                           "collisions !== 0",
                           "collisions === 0",
                           "collisions => 0",
                           "collisions = 0",
                           "collisions <> 0",
                           "collisions == 1, got > 3",
                           "collisions == 1;",
                           "collisions != 1||got",
                           "collisions == one or two",
                           "a b == 1",
                           "a,b == 1",
                           "\"a == 1",
                           "verdict == \"a",
                           "\"\" == 1"}) {
    EXPECT_THAT(fault_of(text), testing::AllOf(testing::HasSubstr("expected a condition"),
                                               testing::HasSubstr("its own --judge")))
        << text;
  }
}

}  // namespace
}  // namespace fastcycle::campaign
