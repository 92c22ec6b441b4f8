#include "campaign/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::campaign {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

Plan plan_of(const std::string& text) {
  std::vector<std::string> errors;
  const auto plan = Plan::read(text, "plan.json", errors);
  EXPECT_THAT(errors, ElementsAre());
  return plan.value();
}

constexpr const char* kPlan = R"({"at_once": [1, 3], "faults": [
    {"kind": "drop", "topic": "a", "from_s": [2, 4], "for_s": [0.5, 1], "probability": [0.1, 0.2]},
    {"kind": "restart", "component": "b", "from_s": 3}]})";

TEST(Plan, DrawsTheSameForASeedAndOthersForOthers) {
  const Plan plan = plan_of(kPlan);
  const auto text_of = [&](std::uint64_t seed) { return overlay_of(plan.draw(seed), seed).dump(); };

  EXPECT_EQ(text_of(5), text_of(5));
  EXPECT_NE(text_of(5), text_of(6));
}

TEST(Plan, DrawsWithinTheRanges) {
  const Plan plan = plan_of(kPlan);
  std::size_t drops = 0;
  std::size_t restarts = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const auto faults = plan.draw(seed);
    EXPECT_GE(faults.size(), 1U);
    EXPECT_LE(faults.size(), 3U);
    for (std::size_t i = 0; i < faults.size(); ++i) {
      const auto& json = faults[i].json;
      EXPECT_EQ(json["name"], "fault_" + std::to_string(i + 1));
      if (faults[i].source == 1) {
        ++restarts;
        EXPECT_EQ(json["from_s"], 3.0);
        continue;
      }
      ++drops;
      const double from = json["from_s"];
      const double span = json["to_s"].get<double>() - from;
      EXPECT_GE(from, 2);
      EXPECT_LE(from, 4);
      EXPECT_GE(span, 0.499);
      EXPECT_LE(span, 1.001);
      EXPECT_GE(json["probability"], 0.1);
      EXPECT_LE(json["probability"], 0.2);
      EXPECT_FALSE(json.contains("for_s"));
    }
  }
  EXPECT_GT(drops, 200U);
  EXPECT_GT(restarts, 200U);
}

TEST(Plan, ReportsEachErrorWithItsPlace) {
  std::vector<std::string> errors;
  EXPECT_FALSE(Plan::read(R"({"at_once": [3, 1], "fault": 1, "faults": [
      3, {"kind": "drop", "from_s": "x", "topc": "a"}, {"from_s": [1, 2]},
      {"kind": "dorp", "from_s": 1}, {"kind": "suspend", "process": "p", "from_s": 1, "for_s": 2}]})",
                          "plan.json", errors));

  EXPECT_THAT(errors, ElementsAre(HasSubstr("plan.json: /at_once: expected a number of faults"),
                                  HasSubstr("/fault: unknown key \"fault\""),
                                  HasSubstr("/faults/0: expected an object, found 3"),
                                  HasSubstr("/faults/1/from_s: expected a number, or a range"),
                                  HasSubstr("/faults/1/topc: unknown key \"topc\""),
                                  HasSubstr("/faults/1: \"drop\" needs the key \"topic\""),
                                  HasSubstr("/faults/2: the key \"kind\" is missing"),
                                  AllOf(HasSubstr("/faults/3/kind: expected one of \"drop\", "),
                                        HasSubstr("found \"dorp\"; did you mean \"drop\"?")),
                                  HasSubstr("/faults/4/for_s: a \"for_s\" has no meaning with the "
                                            "kind \"suspend\"")));
  errors.clear();
  EXPECT_FALSE(Plan::read("{", "plan.json", errors));
  EXPECT_THAT(errors, ElementsAre(HasSubstr("plan.json: this is not JSON")));
}

TEST(Plan, RefusesNumbersThatNoRunAccepts) {
  std::vector<std::string> errors;
  EXPECT_FALSE(Plan::read(R"({"at_once": [1, 18446744073709551615], "faults": [
      {"kind": "drop", "topic": "a", "from_s": 1e306},
      {"kind": "drop", "topic": "a", "from_s": [-1, 2], "for_s": 86401, "probability": [0.5, 1.5]},
      {"kind": "drop", "topic": "a", "from_s": [0, 86000], "for_s": [1, 500]},
      {"kind": "delay", "topic": "a", "from_s": 0, "by_ms": 0},
      {"kind": "leak", "component": "c", "from_s": 0, "by_mb": 1000001}]})",
                          "plan.json", errors));

  EXPECT_THAT(
      errors,
      ElementsAre(HasSubstr("plan.json: /at_once: expected a number of faults"),
                  "plan.json: /faults/0/from_s: expected a number in [0, 86400], or a range of "
                  "these, found 1e+306",
                  HasSubstr("/faults/1/from_s: expected a number in [0, 86400], or a range"),
                  HasSubstr("/faults/1/for_s: expected a number in [0, 86400], or a range"),
                  HasSubstr("/faults/1/probability: expected a number in [0, 1], or a range"),
                  "plan.json: /faults/2/for_s: expected an end, which is from_s + for_s, of at "
                  "most 86400 s, found [1,500]",
                  HasSubstr("/faults/3/by_ms: expected a number in [0.001, 86400000], or a range"),
                  HasSubstr("/faults/4/by_mb: expected a number in [1, 1000000], or a range")));
}

TEST(Plan, DrawsNumbersEvenFromTheWidestRange) {
  const Plan plan = plan_of(R"({"faults": [{"kind": "corrupt", "topic": "a", "field": "x",
      "as": "value", "value": [-1.7e308, 1.7e308], "from_s": [86399, 86400]}]})");

  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const auto json = nlohmann::json::parse(overlay_of(plan.draw(seed), seed).dump());
    EXPECT_TRUE(json["faults"]["list"][0]["value"].is_number()) << json;
    EXPECT_LE(json["faults"]["list"][0]["from_s"], 86400) << json;
  }
}

TEST(Plan, RefusesAKindThatDoesNothingInSimulatedTime) {
  std::vector<std::string> errors;
  EXPECT_FALSE(Plan::read(R"({"faults": [
      {"kind": "hang", "component": "c", "from_s": 1, "by_ms": 100},
      {"kind": "slow", "component": "c", "from_s": 1, "by_ms": 100}]})",
                          "plan.json", errors));

  EXPECT_THAT(errors, ElementsAre(HasSubstr("plan.json: /faults/0/kind: \"hang\" has no effect in "
                                            "simulated time")));
}

}  // namespace
}  // namespace fastcycle::campaign
