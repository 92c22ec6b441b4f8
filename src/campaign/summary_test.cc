#include "campaign/summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "campaign/page.h"

namespace fastcycle::campaign {
namespace {

using testing::HasSubstr;
using testing::Not;

DrawnFault fault(const char* kind, const char* topic, double from_s) {
  return {{{"name", "f"}, {"kind", kind}, {"topic", topic}, {"from_s", from_s}}, 0};
}

/// Three seeds: the second failed, which two others were not at the same time.
Summary summary() {
  Summary summary{.application = "app <1>.json",
                  .plan = "plan.json",
                  .seeds = 4,
                  .judges = {"a < 3"},
                  .results = {},
                  .failures = {},
                  .wall_s = 3};
  summary.results = {{1, {fault("drop", "a", 0)}, "", "", 1},
                     {2, {fault("drop", "a", 8), fault("delay", "b", 1)}, "a < 3", "a is \"3\"", 1},
                     {3, {fault("drop", "a", 7.9)}, "", "", 1}};
  summary.failures = {{.seed = 2,
                       .faults = {fault("drop", "a", 8)},
                       .way = "a < 3",
                       .how = "a is \"3\"",
                       .runs = 9,
                       .is_smallest = true,
                       .overlay = "o.json",
                       .log = "",
                       .command = "fastcycle run x"}};
  return summary;
}

TEST(CampaignSummary, CountsByFaultAndTime) {
  const FaultTable table = make_table(summary(), 8);

  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_EQ(table.rows[0].name, "delay b");
  EXPECT_EQ(table.rows[0].all.failed, 1U);
  EXPECT_EQ(table.rows[1].name, "drop a");
  EXPECT_EQ(table.rows[1].all.ran, 3U);
  EXPECT_EQ(table.rows[1].cells.front().ran, 1U);
  EXPECT_EQ(table.rows[1].cells.front().failed, 0U);
  EXPECT_EQ(table.rows[1].cells.back().ran, 2U);
  EXPECT_EQ(table.rows[1].cells.back().failed, 1U);
}

TEST(CampaignSummary, IsReadByPeopleAndPrograms) {
  const std::string text = to_text(summary());
  EXPECT_THAT(text, HasSubstr("1 of 3 seeds failed (of 4 that were asked for), 1.000 s a seed"));
  EXPECT_THAT(text, HasSubstr("failure 1: a is \"3\" (seed 2, 9 runs to shrink it)"));
  EXPECT_THAT(text, HasSubstr("drop a, from 8 s"));
  const auto json = to_json(summary());
  EXPECT_EQ(json["failed"], 1);
  EXPECT_EQ(json["results"][1]["passed"], false);
}

TEST(CampaignSummary, IsXmlAndHtmlWhateverNamesContain) {
  const std::string junit = to_junit(summary());
  EXPECT_THAT(junit, HasSubstr("campaign of app &lt;1&gt;.json"));
  EXPECT_THAT(junit, HasSubstr("tests=\"4\" failures=\"1\" errors=\"0\" skipped=\"1\""));
  EXPECT_THAT(junit, HasSubstr("message=\"a is &quot;3&quot;\""));
  const std::string page = to_page(summary());
  EXPECT_THAT(page, HasSubstr("Fault campaign of app &lt;1&gt;.json"));
  EXPECT_THAT(page, Not(HasSubstr("<1>")));
  EXPECT_THAT(page, HasSubstr("class=\"fail\""));
}

TEST(CampaignSummary, SaysThatARunFailsWithoutAnyFault) {
  Summary without = summary();
  without.failures[0].faults.clear();
  const std::string words = "fails without any fault";

  EXPECT_THAT(to_text(without), HasSubstr("to shrink it)\n  " + words + "\n  fastcycle run x\n"));
  EXPECT_THAT(to_page(without), HasSubstr("<li>" + words + "</li>"));
  EXPECT_THAT(to_junit(without), HasSubstr("message=\"a is &quot;3&quot;; " + words + "\""));
  EXPECT_EQ(to_json(without)["failures"][0]["fails_without_faults"], true);

  EXPECT_THAT(to_text(summary()), Not(HasSubstr(words)));
  EXPECT_THAT(to_page(summary()), Not(HasSubstr(words)));
  EXPECT_THAT(to_junit(summary()), Not(HasSubstr(words)));
  EXPECT_EQ(to_json(summary())["failures"][0]["fails_without_faults"], false);
}

TEST(CampaignSummary, KeepsAResultInALine) {
  const SeedResult result = summary().results[1];
  const SeedResult again = result_of(to_line(result));

  EXPECT_EQ(to_line(again), to_line(result));
  EXPECT_EQ(again.faults.size(), 2U);
  EXPECT_THROW(static_cast<void>(result_of("{\"seed\": 3, ")), nlohmann::json::exception);
}

TEST(CampaignSummary, TellsFailuresApartByWayKindAndMessages) {
  const Failure one = summary().failures[0];
  Failure later = one;
  later.faults[0].json["from_s"] = 3;
  Failure other_way = one;
  other_way.way = "signal 11";
  Failure more = one;
  more.faults[0].json["messages"] = {1, 2};

  EXPECT_TRUE(is_alike(one, later));
  EXPECT_FALSE(is_alike(one, other_way));
  EXPECT_FALSE(is_alike(one, more));
}

}  // namespace
}  // namespace fastcycle::campaign
