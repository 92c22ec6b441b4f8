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
      "components": {"world": {"faults": 0}, "control": {"faults": 2}},
      "topics": {"can/command": {"published": 800}},
      "results": {"collisions": 1, "verdict": "failed", "world.goal_reached": false, "gap_m": null}})");
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
  EXPECT_EQ(fault_of("colisions == 0"), "the report has no colisions");
}

TEST(Judge, RefusesWhatIsNoCondition) {
  for (const char* text :
       {"", "collisions", "== 3", "collisions ==", "verdict < failed", "a == [1]"}) {
    EXPECT_THAT(fault_of(text), testing::HasSubstr("expected a condition")) << text;
  }
}

}  // namespace
}  // namespace fastcycle::campaign
