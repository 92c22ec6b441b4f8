#include "campaign/shrink.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

namespace fastcycle::campaign {
namespace {

using nlohmann::ordered_json;
using Messages = std::set<std::uint64_t>;

/// A run of 100 messages, one each 0.1 s: which of them `fault` takes.
Messages taken_by(const ordered_json& fault) {
  if (fault.contains("messages")) {
    return fault["messages"].get<Messages>();
  }
  Messages all;
  for (std::uint64_t i = 1; i <= 100; ++i) {
    const double time_s = 0.1 * static_cast<double>(i);
    if (time_s >= fault.value("from_s", 0.0) && time_s < fault.value("to_s", 100.0) &&
        (fault.value("probability", 1.0) == 1.0 || i % 3 != 0)) {
      all.insert(i);
    }
  }
  return all;
}

/// Fails as `fails` says of what is lost of topic "a".
TryAll runs_that_fail(const std::function<bool(const Messages&)>& fails, bool reports = true) {
  return [fails, reports](const std::vector<Faults>& lists) {
    std::vector<Verdict> verdicts;
    for (const Faults& faults : lists) {
      Verdict verdict;
      Messages lost;
      auto listed = ordered_json::array();
      for (const DrawnFault& fault : faults) {
        const Messages taken = taken_by(fault.json);
        listed.push_back(
            {{"name", fault.json["name"]}, {"count", taken.size()}, {"messages", taken}});
        if (fault.json["topic"] == "a") {
          lost.insert(taken.begin(), taken.end());
        }
      }
      verdict.way = fails(lost) ? "lost" : "";
      if (reports) {
        verdict.report = {{"time_s", 10.0}, {"faults", listed}};
      }
      verdicts.push_back(std::move(verdict));
    }
    return verdicts;
  };
}

DrawnFault drop(const char* name, const char* topic, double from, double to, double probability) {
  return {{{"name", name},
           {"kind", "drop"},
           {"topic", topic},
           {"from_s", from},
           {"to_s", to},
           {"probability", probability}},
          0};
}

TEST(Shrink, LeavesTheTwoMessagesInARowThatMatter) {
  const TryAll try_all =
      runs_that_fail([](const Messages& lost) { return lost.contains(43) && lost.contains(44); });
  const Faults faults = {drop("x", "b", 0, 9, 1), drop("y", "a", 3, 6, 0.5),
                         drop("z", "a", 7, 8, 1)};

  const Shrunk shrunk = shrink(faults, try_all({faults}).front(), try_all, 200);

  EXPECT_TRUE(shrunk.is_smallest);
  ASSERT_EQ(shrunk.faults.size(), 1U);
  const ordered_json& left = shrunk.faults[0].json;
  EXPECT_EQ(left["name"], "y");
  EXPECT_EQ(left["messages"], (Messages{43, 44}));
  EXPECT_FALSE(left.contains("from_s"));
  EXPECT_FALSE(left.contains("probability"));
  EXPECT_LT(shrunk.runs, 60U);
}

TEST(Shrink, KeepsTwoFaultsThatMatterTogether) {
  const TryAll try_all =
      runs_that_fail([](const Messages& lost) { return lost.contains(10) && lost.contains(90); });
  const Faults faults = {drop("x", "a", 0.5, 2, 1), drop("y", "a", 8, 9.5, 1),
                         drop("z", "b", 1, 2, 1)};

  const Shrunk shrunk = shrink(faults, try_all({faults}).front(), try_all, 200);

  ASSERT_EQ(shrunk.faults.size(), 2U);
  EXPECT_EQ(shrunk.faults[0].json["messages"], Messages{10});
  EXPECT_EQ(shrunk.faults[1].json["messages"], Messages{90});
}

TEST(Shrink, ShortensTheTimeWhereNoReportNamesMessages) {
  const TryAll try_all =
      runs_that_fail([](const Messages& lost) { return lost.contains(43); }, false);
  const Faults faults = {drop("x", "a", 1, 9, 1)};

  const Shrunk shrunk = shrink(faults, try_all({faults}).front(), try_all, 200);

  const ordered_json& left = shrunk.faults[0].json;
  EXPECT_LE(left["from_s"].get<double>(), 4.3);
  EXPECT_GT(left["to_s"].get<double>(), 4.3);
  EXPECT_LT(left["to_s"].get<double>() - left["from_s"].get<double>(), 0.1);
}

TEST(Shrink, LeavesNoFaultWhereTheRunFailsWithoutAny) {
  const TryAll try_all = runs_that_fail([](const Messages&) { return true; });
  const Faults faults = {drop("x", "a", 1, 3, 1), drop("y", "b", 1, 3, 1)};

  const Shrunk shrunk = shrink(faults, try_all({faults}).front(), try_all, 200);

  EXPECT_TRUE(shrunk.faults.empty());
  EXPECT_EQ(shrunk.verdict.way, "lost");
  EXPECT_TRUE(shrunk.is_smallest);
  EXPECT_EQ(shrunk.runs, 1U);
}

TEST(Shrink, KeepsTheFaultOfARunThatFailsOtherwiseWithoutAny) {
  const TryAll try_all = [](const std::vector<Faults>& lists) {
    std::vector<Verdict> verdicts;
    for (const Faults& faults : lists) {
      verdicts.push_back({.way = faults.empty() ? "other" : "lost", .how = {}});
    }
    return verdicts;
  };
  const Faults faults = {drop("x", "a", 1, 3, 1)};

  const Shrunk shrunk = shrink(faults, try_all({faults}).front(), try_all, 200);

  EXPECT_EQ(shrunk.faults.size(), 1U);
  EXPECT_EQ(shrunk.verdict.way, "lost");
}

TEST(Shrink, StopsWhereItTookTooManyRunsOrIsEnded) {
  const TryAll try_all = runs_that_fail([](const Messages& lost) { return lost.size() > 20; });
  const Faults faults = {drop("x", "a", 0, 9, 1)};
  const Verdict verdict = try_all({faults}).front();

  EXPECT_FALSE(shrink(faults, verdict, try_all, 3).is_smallest);
  const TryAll ended = [](const std::vector<Faults>&) { return std::vector<Verdict>(); };
  const Shrunk shrunk = shrink(faults, verdict, ended, 100);
  EXPECT_FALSE(shrunk.is_smallest);
  EXPECT_EQ(shrunk.faults[0].json, faults[0].json);
}

TEST(Shrink, DoesNotTakeOneFailureForAnother) {
  // Fewer than five of them fail as well, in another way.
  const TryAll try_all = [](const std::vector<Faults>& lists) {
    std::vector<Verdict> verdicts;
    for (const Faults& faults : lists) {
      const Messages taken = faults.empty() ? Messages() : taken_by(faults[0].json);
      verdicts.push_back(
          {.way = taken.size() < 5 ? "other" : "lost",
           .how = {},
           .report = {
               {"faults", {{{"name", "x"}, {"count", taken.size()}, {"messages", taken}}}}}});
    }
    return verdicts;
  };
  const Faults faults = {drop("x", "a", 1, 3, 1)};

  const Shrunk shrunk = shrink(faults, try_all({faults}).front(), try_all, 200);

  EXPECT_EQ(shrunk.verdict.way, "lost");
  EXPECT_EQ(shrunk.faults[0].json["messages"].size(), 5U);
}

}  // namespace
}  // namespace fastcycle::campaign
