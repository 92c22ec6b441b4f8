// The search for faults that matter.

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "campaign/test_runs.h"

namespace fastcycle {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::Process;
using testing::HasSubstr;
using testing::Not;

class Campaign : public test::TrackingRuns {
 protected:
  void SetUp() override {
    folder_.write("app.json", kApplication);
    folder_.write("plan.json", R"({
        // Several of these at once.
        "at_once": [1, 2],
        "faults": [
          {"kind": "drop", "topic": "sweeps", "from_s": [0, 8], "for_s": [0.2, 1.5],
           "probability": [0.05, 0.3]},
          {"kind": "delay", "topic": "sweeps", "from_s": [0, 8], "for_s": [0.2, 1],
           "by_ms": [5, 60]},
          {"kind": "duplicate", "topic": "tracks", "from_s": [0, 8], "for_s": 1}
        ]})");
  }

  [[nodiscard]] test::ProcessOptions campaign(const std::vector<std::string>& more = {},
                                              const std::string& judge = "tracks_lost == 0",
                                              const std::string& out = "found") const {
    std::vector<std::string> words{"campaign", "app.json", "--plan", "plan.json", "--judge",
                                   judge,      "--for",    "15s",    "--out",     out};
    words.insert(words.end(), more.begin(), more.end());
    return program(words);
  }

  [[nodiscard]] json summary() const {
    return json::parse(test::read_file(folder_ / "found/summary.json"), nullptr, false);
  }
};

TEST_F(Campaign, FindsABugThatNeedsTwoSweepsInARowAndNamesThese) {
  Process process(campaign({"--seeds", "60", "--junit", "found/junit.xml"}));

  EXPECT_EQ(process.wait().exit_code, 1) << process.errors();

  const json said = summary();
  EXPECT_EQ(said["ran"], 60);
  EXPECT_GT(said["failed"].get<int>(), 0);
  EXPECT_LT(said["failed"].get<int>(), 60);
  ASSERT_EQ(said["failures"].size(), 1U) << said["failures"].dump(1);
  const json& failure = said["failures"][0];
  EXPECT_EQ(failure["way"], "tracks_lost == 0");
  EXPECT_EQ(failure["is_smallest"], true);
  ASSERT_EQ(failure["faults"].size(), 1U) << failure.dump(1);
  EXPECT_EQ(failure["faults"][0]["kind"], "drop");
  const auto messages = failure["faults"][0]["messages"].get<std::vector<int>>();
  ASSERT_EQ(messages.size(), 2U) << failure.dump(1);
  EXPECT_EQ(messages[1], messages[0] + 1);
  EXPECT_THAT(process.output(), HasSubstr("drop sweeps, messages"));
  EXPECT_THAT(test::read_file(folder_ / "found/junit.xml"),
              HasSubstr("<failure message=\"tracks_lost is"));
  EXPECT_THAT(test::read_file(folder_ / "found/index.html"), HasSubstr("class=\"fail\""));
  EXPECT_THAT(test::read_file(folder_ / "found/index.html"), Not(HasSubstr("http")));
}

TEST_F(Campaign, LeavesAnOverlayThatRepeatsTheFailureByteForByte) {
  Process process(campaign({"--seeds", "40", "--quiet"}));
  ASSERT_EQ(process.wait().exit_code, 1) << process.errors();

  std::vector<std::string> messages;
  for (const char* workers : {"1", "4"}) {
    const std::string log = std::string("again_") + workers + ".mcap";
    Process again(program({"run", "app.json", "--overlay", "found/failure_1.json", "--clock",
                           "simulated", "--for", "15s", "--workers", workers, "--quiet", "--record",
                           log, "--report", "report.json"}));
    EXPECT_EQ(again.wait().exit_code, 0) << again.errors();
    const json report = json::parse(test::read_file(folder_ / "report.json"));
    EXPECT_EQ("tracks_lost is " + report["results"]["tracks_lost"].dump(),
              summary()["failures"][0]["how"].get<std::string>());
    Process echo(program({"echo", log, "sweeps", "tracks"}));
    EXPECT_EQ(echo.wait().exit_code, 0) << echo.errors();
    messages.push_back(echo.output());
  }
  Process echo(program({"echo", "found/failure_1.mcap", "sweeps", "tracks"}));
  EXPECT_EQ(echo.wait().exit_code, 0) << echo.errors();

  EXPECT_THAT(messages[0], HasSubstr("range_m"));
  EXPECT_EQ(messages[0], messages[1]);
  EXPECT_EQ(messages[0], echo.output());
}

TEST_F(Campaign, IsTheSameWithAnyNumberOfJobs) {
  std::vector<json> found;
  for (const char* jobs : {"1", "3"}) {
    Process process(
        campaign({"--seeds", "20", "--no-logs", "--jobs", jobs}, "tracks_lost == 0", jobs));
    EXPECT_EQ(process.wait().exit_code, 1) << process.errors();
    json said = json::parse(test::read_file(folder_ / jobs / "summary.json"));
    for (json& result : said["results"]) {
      result.erase("wall_s");
    }
    for (json& failure : said["failures"]) {
      failure = failure["faults"];
    }
    found.push_back({said["results"], said["failures"]});
  }

  EXPECT_EQ(found[0], found[1]);
}

TEST_F(Campaign, GoesOnWhereItWasEnded) {
  Process first(campaign({"--seeds", "2000", "--jobs", "1"}));
  ASSERT_TRUE(first.wait_for("seed "));  // The first that failed.
  first.send(SIGINT);
  EXPECT_EQ(first.wait().exit_code, 1);
  EXPECT_THAT(first.errors(), HasSubstr("repeat the command to continue"));
  const auto done = summary()["ran"].get<int>();
  EXPECT_LT(done, 2000);

  Process second(campaign({"--seeds", std::to_string(done + 3), "--no-logs"}));
  EXPECT_EQ(second.wait().exit_code, 1) << second.errors();
  EXPECT_THAT(second.errors(), HasSubstr(std::to_string(done) + " of " + std::to_string(done + 3) +
                                         " seeds are done already"));
  EXPECT_EQ(summary()["ran"], done + 3);

  Process other(campaign({"--seeds", "3"}, "tracks_lost < 2"));
  EXPECT_EQ(other.wait().exit_code, 2);
  EXPECT_THAT(other.errors(), HasSubstr("found contains another campaign: its judges differ"));
}

TEST_F(Campaign, DoesNotGoOnWithAnotherLibraryOrAnotherIncludedFile) {
  const fs::path libraries = fs::path(FASTCYCLE_PROGRAM).parent_path().parent_path() / "lib";
  fs::copy_file(libraries / "fastcycle/libcampaign_parts.so", folder_ / "libcampaign_parts.so");
  folder_.write("more.json", R"({"name": "more", "components": []})");
  std::string including = kApplication;
  including.replace(including.find('{'), 1, R"({"include": [{"file": "more.json"}], )");
  folder_.write("app.json", including);
  test::ProcessOptions options =
      campaign({"--seeds", "2", "--no-logs", "--library-path", "."}, "tracks_lost < 100");
  options.environment.push_back("LD_LIBRARY_PATH=" + libraries.string());
  Process first(options);
  ASSERT_EQ(first.wait().exit_code, 0) << first.errors();
  Process again(options);
  ASSERT_EQ(again.wait().exit_code, 0) << again.errors();
  EXPECT_THAT(again.errors(), HasSubstr("2 of 2 seeds are done already"));

  std::ofstream(folder_ / "libcampaign_parts.so", std::ios::app) << "built anew";
  Process other(options);
  EXPECT_EQ(other.wait().exit_code, 2);
  EXPECT_THAT(other.errors(), HasSubstr("found contains another campaign: its libraries differ"));

  folder_.write("more.json", R"({"name": "more", "components": [], "shared_params": {"a": 1}})");
  Process included(options);
  EXPECT_EQ(included.wait().exit_code, 2);
  EXPECT_THAT(included.errors(),
              HasSubstr("found contains another campaign: its application differs"));
}

TEST_F(Campaign, FindsCrashes) {
  folder_.write("plan.json", R"({"faults": [{"kind": "corrupt", "topic": "sweeps",
      "field": "objects.range_m", "as": "nan", "from_s": [0, 20], "for_s": 0.5}]})");
  Process process(campaign({"--seeds", "12", "--set", "tracker.crashes_on_nan=true", "--no-logs"}));

  EXPECT_EQ(process.wait().exit_code, 1) << process.errors();
  const json said = summary();
  EXPECT_GT(said["failed"].get<int>(), 0) << said.dump(1);
  EXPECT_LT(said["failed"].get<int>(), 12) << said.dump(1);  // Some begin after the last sweep.
  EXPECT_THAT(said["failures"][0]["way"].get<std::string>(), HasSubstr("signal"));
}

TEST_F(Campaign, EndsRunsThatTakeTooLong) {
  Process process(campaign({"--seeds", "2", "--limit", "1ms", "--no-logs", "--shrink-runs", "1"}));

  EXPECT_EQ(process.wait().exit_code, 1) << process.errors();
  const json said = summary();
  EXPECT_EQ(said["failed"], 2);
  EXPECT_EQ(said["results"][0]["way"], "no end within 1ms");
}

TEST_F(Campaign, BeginsNothingWithoutAnApplication) {
  Process process(program({"campaign", "nope.json", "--plan", "plan.json", "--out", "nothing"}));

  EXPECT_EQ(process.wait().exit_code, 2);
  EXPECT_THAT(process.errors(), HasSubstr("cannot read \"nope.json\""));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "nothing"));
}

TEST_F(Campaign, BlamesNoFaultForAFailureWithoutAny) {
  Process process(campaign({"--seeds", "2", "--no-logs"}, "tracks_lost == -1"));

  EXPECT_EQ(process.wait().exit_code, 1) << process.errors();
  EXPECT_THAT(process.output() + process.errors(), HasSubstr("fails without any fault"));
  const json said = summary();
  ASSERT_EQ(said["failures"].size(), 1U) << said.dump(1);
  EXPECT_EQ(said["failures"][0]["fails_without_faults"], true);
}

TEST_F(Campaign, LeavesWhatIsNotItsOwnAlone) {
  std::filesystem::create_directories(folder_ / "found/runs/seed_1");
  folder_.write("found/runs/seed_1/mine.txt", "precious");
  Process folder(campaign({"--seeds", "2"}));

  EXPECT_EQ(folder.wait().exit_code, 2) << folder.errors();
  EXPECT_THAT(folder.errors(), HasSubstr("contains no campaign"));
  EXPECT_EQ(test::read_file(folder_ / "found/runs/seed_1/mine.txt"), "precious");

  const std::string plan = test::read_file(folder_ / "plan.json");
  Process file(campaign({"--seeds", "2", "--junit", "plan.json"}, "tracks_lost == 0", "other"));
  EXPECT_EQ(file.wait().exit_code, 2) << file.errors();
  EXPECT_EQ(test::read_file(folder_ / "plan.json"), plan);
}

TEST_F(Campaign, EndsWhereItsFolderCannotBeWrittenAndBlamesNoSeed) {
  folder_.write("found", "a file, where the campaign wants its folder");
  Process process(campaign({"--seeds", "5"}, "tracks_lost == 0", "found"));

  EXPECT_NE(process.wait().exit_code, 0);
  EXPECT_THAT(process.errors(), HasSubstr("found"));
  EXPECT_THAT(process.errors(), testing::Not(HasSubstr("do not fit the application")));
}

TEST_F(Campaign, SaysWhatIsWrongWithAPlan) {
  folder_.write("plan.json", R"({"at_once": 0, "faults": [
      {"kind": "drop", "topc": "sweeps", "from_s": [3, 1]}, {"topic": 3, "from_s": 1}]})");
  Process plan(campaign());
  EXPECT_EQ(plan.wait().exit_code, 2);
  EXPECT_THAT(plan.errors(), HasSubstr("plan.json: /at_once: expected a number of faults"));
  EXPECT_THAT(plan.errors(), HasSubstr("/faults/0/topc: unknown key \"topc\""));
  EXPECT_THAT(plan.errors(), HasSubstr("/faults/0/from_s: expected a number, or a range"));
  EXPECT_THAT(plan.errors(), HasSubstr("/faults/1: the key \"kind\" is missing"));

  folder_.write("plan.json", R"({"faults": [{"kind": "drop", "topic": "sweep", "from_s": 1}]})");
  Process topic(campaign({}, "tracks_lost == 0", "other"));
  EXPECT_EQ(topic.wait().exit_code, 2);
  EXPECT_THAT(topic.errors(), HasSubstr("did you mean \"sweeps\"?"));

  Process judge(campaign({}, "tracks_lost"));
  EXPECT_EQ(judge.wait().exit_code, 2);
  EXPECT_THAT(judge.errors(), HasSubstr("expected a condition such as"));
}

}  // namespace
}  // namespace fastcycle
