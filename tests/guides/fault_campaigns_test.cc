// What docs/guides/fault_campaigns.md shows.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "campaign/test_runs.h"

namespace {

constexpr const char* kOverlay = R"(
{
  "faults": {
    "seed": 7,
    "list": [
      {"kind": "drop", "topic": "sweeps", "from_s": 2, "to_s": 6, "probability": 0.2},
      {"kind": "corrupt", "topic": "sweeps", "field": "objects.range_m", "as": "nan", "messages": [80]},
      {"kind": "slow", "component": "tracker", "by_ms": 40, "from_s": 7}
    ]
  }
}
)";

constexpr const char* kPlan = R"(
{
  "at_once": [1, 2],
  "faults": [
    {"kind": "drop", "topic": "sweeps", "from_s": [0, 8], "for_s": [0.2, 1.5], "probability": [0.05, 0.3]},
    {"kind": "delay", "topic": "sweeps", "from_s": [0, 8], "for_s": [0.2, 1], "by_ms": [5, 60]},
    {"kind": "slow", "component": "tracker", "from_s": [0, 8], "for_s": 1, "by_ms": [10, 80]}
  ]
}
)";

using FaultCampaignsGuide = fastcycle::test::TrackingRuns;

TEST_F(FaultCampaignsGuide, ShowsAnOverlayThatInjectsFaults) {
  const auto report = run(nlohmann::json::parse(kOverlay)["faults"].dump());

  EXPECT_EQ(ending_.exit_code, 0) << errors_;
  ASSERT_EQ(report["faults"].size(), 3U);
  for (const auto& fault : report["faults"]) {
    EXPECT_GT(fault["count"].get<int>(), 0) << fault;
  }
}

TEST_F(FaultCampaignsGuide, ShowsAPlanThatFindsSomething) {
  folder_.write("app.json", kApplication);
  folder_.write("plan.json", kPlan);
  fastcycle::test::Process process(
      program({"campaign", "app.json", "--plan", "plan.json", "--for", "15s", "--seeds", "30",
               "--judge", "tracks_lost == 0", "--out", "found"}));

  EXPECT_EQ(process.wait().exit_code, 1) << process.errors();
  EXPECT_THAT(process.output(), testing::HasSubstr("failure 1: tracks_lost is"));
}

}  // namespace
