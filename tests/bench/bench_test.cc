// `fastcycle bench` as its users meet it. No test judges a time.

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "process/process.h"

namespace fastcycle::bench {
namespace {

using nlohmann::json;
using test::Process;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

/// The program, what it printed, and what it left in the folder for temporary files.
class Bench : public testing::Test {
 protected:
  int launch(std::vector<std::string> words) {
    Process program(started_with(std::move(words)));
    return take(program);
  }

  [[nodiscard]] test::ProcessOptions started_with(std::vector<std::string> words) const {
    words.insert(words.begin(), "bench");
    return {.program = FASTCYCLE_PROGRAM,
            .arguments = std::move(words),
            .environment = {"TMPDIR=" + temporary_.path().string()}};
  }

  int take(Process& program) {
    const test::Ending& ending = program.wait();
    output_ = program.output();
    errors_ = program.errors();
    return ending.signal != 0 ? 1000 + ending.signal : ending.exit_code;
  }

  /// Runs a mode with --json; the rows that it prints.
  std::vector<json> rows(std::vector<std::string> words) {
    std::vector<json> result = rows_and_log(std::move(words));
    EXPECT_THAT(errors_, IsEmpty());
    return result;
  }

  /// The same of a mode whose applications have something to say.
  std::vector<json> rows_and_log(std::vector<std::string> words) {
    words.emplace_back("--json");
    EXPECT_EQ(launch(std::move(words)), 0) << errors_;
    std::vector<json> result;
    std::istringstream lines(output_);
    for (std::string line; std::getline(lines, line);) {
      result.push_back(json::parse(line));
    }
    return result;
  }

  [[nodiscard]] std::vector<std::string> left_behind() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(temporary_.path())) {
      names.push_back(entry.path().filename());
    }
    return names;
  }

  test::Folder temporary_;
  std::string output_;
  std::string errors_;
};

/// What every row of a mode with durations has.
void expect_times(const json& row, std::int64_t count) {
  for (const char* key :
       {"peer", "mode", "size", "round", "mean_us", "std_us", "p50_us", "p90_us", "p99_us",
        "p999_us", "max_us", "cpu_us_per_msg", "minor_faults", "voluntary_switches"}) {
    EXPECT_TRUE(row.contains(key)) << key << " in " << row;
  }
  EXPECT_EQ(row.at("n"), count) << row;
  EXPECT_EQ(row.at("lost"), 0) << row;
  EXPECT_LE(row.at("p50_us"), row.at("max_us"));
  if (row.at("peer").get<std::string>().starts_with("fastcycle-") && row.at("mode") != "timer" &&
      row.at("mode") != "deadline") {
    EXPECT_EQ(row.at("damaged"), 0) << row;
  }
}

std::multiset<std::string> peers_of(const std::vector<json>& rows) {
  std::multiset<std::string> peers;
  for (const json& row : rows) {
    peers.insert(row.at("peer").get<std::string>());
  }
  return peers;
}

/// Few messages, and so slow that a busy machine loses none in front of a queue of 64.
std::vector<std::string> few(std::vector<std::string> words) {
  words.insert(words.end(), {"--count", "50", "--warmup", "5", "--interval-us", "2000"});
  return words;
}

// ---- The modes ----

TEST_F(Bench, LatencyStandsBesideItsFloors) {
  const auto found = rows(few({"latency", "--size", "64,32K", "--wait", "park,spin,adaptive",
                               "--floors", "all", "--rounds", "2"}));

  ASSERT_EQ(found.size(), 2U * 2 * 6);
  for (const json& row : found) {
    expect_times(row, 50);
    EXPECT_TRUE(row.contains("e2e_p50_us"));
    EXPECT_TRUE(row.contains("e2e_p99_us"));
  }
  for (const char* peer : {"floor-futex", "floor-spin", "floor-malloc", "fastcycle-park",
                           "fastcycle-spin", "fastcycle-adaptive"}) {
    EXPECT_EQ(peers_of(found).count(peer), 4U) << peer;
  }
  // Who comes first in a round is last in the next.
  EXPECT_EQ(found[0].at("peer"), found[17].at("peer"));
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, ATimeSliceIsThatOfTheSubscriber) {
  ASSERT_EQ(launch({"latency", "--slice-us", "100", "--print-application"}), 0) << errors_;

  const json executors = json::parse(output_).at("executors");
  EXPECT_FALSE(executors.at(0).contains("slice_us"));
  EXPECT_EQ(executors.at(1).at("slice_us"), 100);
}

TEST_F(Bench, OptionsMayStandBeforeTheMode) {
  const auto found = rows({"--size", "64", "--wait", "park", "--count", "5", "--warmup", "0",
                           "--floors", "none", "latency"});

  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found.front().at("n"), 5);
}

TEST_F(Bench, RoundTripsAreMeasuredWhereTheyBegan) {
  const auto found =
      rows({"rtt", "--size", "4M", "--count", "50", "--warmup", "5", "--interval-us", "20000"});

  ASSERT_EQ(found.size(), 2U);
  for (const json& row : found) {
    expect_times(row, 50);
    EXPECT_EQ(row.at("size"), 4 << 20);
    EXPECT_EQ(row.at("mode"), "rtt");
  }
}

TEST_F(Bench, FloodLosesNothingWithCredits) {
  const auto found =
      rows({"flood", "--count", "5001", "--window", "16", "--wait", "park,adaptive"});

  EXPECT_EQ(peers_of(found), (std::multiset<std::string>{"fastcycle-adaptive", "fastcycle-park",
                                                         "floor-mutex-deque"}));
  for (const json& row : found) {
    EXPECT_EQ(row.at("sent"), 5001);
    EXPECT_EQ(row.at("received"), 5001);
    EXPECT_EQ(row.at("lost"), 0);
    EXPECT_EQ(row.at("damaged"), 0);
    EXPECT_GT(row.at("rate_per_s"), 0);
  }
}

TEST_F(Bench, FloodWithoutCreditsAccountsForEveryLoss) {
  const auto found = rows({"flood", "--count", "20000", "--window", "8", "--no-credits"});

  ASSERT_EQ(found.size(), 1U);
  const json& row = found.front();
  std::int64_t dropped = 0;
  for (const auto& [reason, count] : row.at("dropped").items()) {
    dropped += count.get<std::int64_t>();
  }
  EXPECT_EQ(row.at("sent"), 20000);
  EXPECT_EQ(row.at("lost"), dropped + row.at("queued").get<std::int64_t>());
  EXPECT_EQ(row.at("received"), 20000 - row.at("lost").get<std::int64_t>());
  EXPECT_EQ(row.at("damaged"), 0);
}

TEST_F(Bench, FanoutSaysWhatOneMoreSubscriberCosts) {
  const auto found = rows(few({"fanout", "--subs", "1,3", "--wait", "park"}));

  ASSERT_EQ(found.size(), 2U);
  for (const json& row : found) {
    expect_times(row, 50);
    EXPECT_TRUE(row.contains("publish_ns_per_subscriber"));
    EXPECT_TRUE(row.contains("last_p50_us"));
  }
  EXPECT_EQ(found[0].at("subscribers"), 1);
  EXPECT_EQ(found[1].at("subscribers"), 3);
}

TEST_F(Bench, FanoutToOneNumberHasNoSlope) {
  const auto found = rows(few({"fanout", "--subs", "2", "--wait", "park"}));

  ASSERT_EQ(found.size(), 1U);
  EXPECT_FALSE(found.front().contains("publish_ns_per_subscriber"));
}

TEST_F(Bench, TimersDoNotDrift) {
  const auto found = rows(few({"timer", "--wait", "park,adaptive"}));

  ASSERT_EQ(found.size(), 3U);
  for (const json& row : found) {
    expect_times(row, 50);
    if (row.at("peer") != "floor-timer") {
      EXPECT_EQ(row.at("drift_us"), 0);
      EXPECT_TRUE(row.contains("overruns"));
    }
  }
}

TEST_F(Bench, TheDeadlineOfAStalledPublisherStandsBesideItsFloor) {
  const auto found = rows(few({"deadline", "--wait", "park"}));

  ASSERT_EQ(found.size(), 2U);
  for (const json& row : found) {
    expect_times(row, 50);
    EXPECT_GE(row.at("min_us"), 0) << "no event comes before its deadline is over";
  }
}

TEST_F(Bench, SimulatedPeriodsEndExactly) {
  const auto found =
      rows({"timer", "--clock", "simulated", "--count", "10000", "--interval-us", "7"});

  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found.front().at("periods"), 10000);
  EXPECT_EQ(found.front().at("end_us"), 70000);
  EXPECT_EQ(found.front().at("drift_us"), 0);
  EXPECT_EQ(found.front().at("overruns"), 0);
}

TEST_F(Bench, ChainGoesOverOneExecutorAndOverTwo) {
  const auto found = rows(few({"chain", "--hops", "1,3"}));

  ASSERT_EQ(found.size(), 6U);
  std::set<std::pair<int, int>> seen;
  for (const json& row : found) {
    expect_times(row, 50);
    if (row.at("peer") == "fastcycle-park") {
      seen.emplace(row.at("hops").get<int>(), row.at("executors").get<int>());
    }
  }
  EXPECT_EQ(seen, (std::set<std::pair<int, int>>{{1, 1}, {1, 2}, {3, 1}, {3, 2}}));
}

TEST_F(Bench, StartupReachesEverySubscriber) {
  const auto found = rows({"startup", "--components", "3", "--topics", "70", "--for", "200ms"});

  ASSERT_EQ(found.size(), 1U);
  const json& row = found.front();
  EXPECT_EQ(row.at("n"), 70);
  EXPECT_EQ(row.at("lost"), 0);
  EXPECT_GT(row.at("idle_s"), 0.0);  // A machine with other things to do begins late.
  for (const char* key :
       {"startup_ms", "rss_before_kib", "rss_after_kib", "bytes_per_topic",
        "bytes_per_subscription", "publish_us", "publish_alone_us", "idle_cpu_percent"}) {
    EXPECT_TRUE(row.contains(key)) << key;
  }
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, RecordingStandsBesideTheSameWithoutIt) {
  const auto found = rows(few({"record", "--size", "64K,200K", "--dir", temporary_.path()}));

  ASSERT_EQ(found.size(), 10U);
  EXPECT_EQ(peers_of(found),
            (std::multiset<std::string>{"background-park", "background-park", "floor-copy-park",
                                        "floor-copy-park", "messages-only-park",
                                        "messages-only-park", "recorded-park", "recorded-park",
                                        "without-park", "without-park"}));
  for (const json& row : found) {
    expect_times(row, 50);
    EXPECT_TRUE(row.contains("publish_p99_us"));
    EXPECT_EQ(row.contains("publish_p99_us_ratio"), row.at("peer") != "without-park");
    if (row.at("peer") == "recorded-park" || row.at("peer") == "background-park") {
      EXPECT_EQ(row.at("published"), 55);
      EXPECT_EQ(row.at("recorded").get<int>() + row.at("record_lost").get<int>(), 55);
      EXPECT_EQ(row.at("in_file"), row.at("recorded"));
      EXPECT_TRUE(row.contains("p99_us_ratio"));
    }
  }
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, InspectStandsBesideTheSameWithoutIt) {
  const auto found = rows_and_log(few({"inspect", "--size", "64K"}));

  EXPECT_EQ(peers_of(found),
            (std::multiset<std::string>{"asked-park", "echoed-park", "without-park"}));
  EXPECT_THAT(errors_, HasSubstr("tools may look at this run"));
  for (const json& row : found) {
    expect_times(row, 50);
    EXPECT_TRUE(row.contains("publish_p99_us"));
    EXPECT_TRUE(row.contains("echoing"));
    EXPECT_EQ(row.contains("publish_p99_us_ratio"), row.at("peer") != "without-park");
  }
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, TraceStandsBesideTheSameWithoutIt) {
  const auto found = rows(few({"trace", "--wait", "park,adaptive", "--rounds", "2"}));

  ASSERT_EQ(found.size(), 8U);
  EXPECT_EQ(peers_of(found),
            (std::multiset<std::string>{"traced-adaptive", "traced-adaptive", "traced-park",
                                        "traced-park", "without-adaptive", "without-adaptive",
                                        "without-park", "without-park"}));
  for (const json& row : found) {
    expect_times(row, 50);
    EXPECT_TRUE(row.contains("publish_p50_us"));
    const bool is_traced = row.at("peer").get<std::string>().starts_with("traced");
    EXPECT_EQ(row.contains("cost_ns"), is_traced);
    EXPECT_EQ(row.contains("publish_cost_ns"), is_traced);
    if (is_traced) {
      EXPECT_GE(row.at("slices"), 2 * 55);  // Of the source's timer, and of the sink.
      EXPECT_EQ(row.at("trace_lost"), 0);
      EXPECT_GT(row.at("trace_bytes"), 0);
    }
  }
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, DiskComparesARecordingWithBareWritesOfTheSameBlocks) {
  const auto found = rows({"disk", "--size", "1M", "--count", "8"});

  EXPECT_EQ(peers_of(found), (std::multiset<std::string>{"dd", "floor-write", "recorded"}));
  for (const json& row : found) {
    EXPECT_GE(row.at("bytes"), 8 << 20);
    EXPECT_GT(row.at("mb_per_s"), 0);
    if (row.at("peer") == "recorded") {
      EXPECT_EQ(row.at("in_file"), 8);
      EXPECT_EQ(row.at("record_lost"), 0);
    }
  }
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, DiskThatIsTooSmallIsSaidBefore) {
  EXPECT_EQ(launch({"disk", "--size", "64M", "--count", "100000000"}), 1);

  EXPECT_THAT(errors_, AllOf(HasSubstr("MB left"), HasSubstr("use a smaller --count")));
  EXPECT_THAT(left_behind(), IsEmpty());
}

// ---- What all modes have ----

TEST_F(Bench, PeopleGetATableWithTheRatioToTheFloor) {
  EXPECT_EQ(launch(few({"latency", "--size", "64"})), 0) << errors_;

  EXPECT_THAT(output_, AllOf(HasSubstr("floor-futex"), HasSubstr("fastcycle-park"),
                             HasSubstr("p50/floor"), HasSubstr("64 B")));
}

TEST_F(Bench, RawStampsAreThoseOfEveryMessage) {
  const auto file = temporary_ / "raw.csv";

  EXPECT_EQ(launch(few({"latency", "--size", "64", "--raw", file.string()})), 0) << errors_;

  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  EXPECT_EQ(line, "peer,mode,size,round,number,made_ns,sent_ns,arrived_ns");
  int lines = 0;
  while (std::getline(stream, line)) {
    ++lines;
  }
  EXPECT_EQ(lines, 2 * 55);
}

TEST_F(Bench, ItsApplicationIsOneThatRuns) {
  for (const std::string mode :
       {"latency", "rtt", "flood", "fanout", "timer", "deadline", "chain", "trace"}) {
    ASSERT_EQ(launch({mode, "--count", "20", "--print-application"}), 0) << errors_;
    const auto file = temporary_.write("app.json", output_);

    Process program(
        {.program = FASTCYCLE_PROGRAM, .arguments = {"run", file.string(), "--debuggable"}});

    EXPECT_EQ(program.wait().exit_code, 0) << mode << "\n" << program.errors();
  }
}

TEST_F(Bench, LoadEndsWithIt) {
  Process program(started_with(few({"latency", "--size", "64", "--load", "1"})));

  EXPECT_EQ(take(program), 0) << errors_;
  EXPECT_EQ(test::processes_of_session(program.pid()), 0);
}

TEST_F(Bench, OneControlCEndsItAndLeavesNothingBehind) {
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"latency", "--size", "64", "--count", "20", "--warmup", "0"},
        {"flood", "--count", "5000"},
        {"timer", "--count", "20", "--warmup", "0"},
        {"startup", "--for", "10ms"}}) {
    const std::string& mode = words.front();
    auto options = started_with(words);
    options.arguments.insert(options.arguments.end(), {"--json", "--rounds", "10000"});
    Process program(options);
    ASSERT_TRUE(program.wait_for("\"round\":2")) << program.errors();
    program.send(SIGINT);

    EXPECT_EQ(take(program), 1) << mode << errors_;

    EXPECT_THAT(errors_, HasSubstr("stopped after")) << mode;
    EXPECT_THAT(left_behind(), IsEmpty()) << mode;
  }
}

TEST_F(Bench, ReaderThatGoesAwayEndsItAndLeavesNothingBehind) {
  const std::string pipeline = std::string(FASTCYCLE_PROGRAM) +
                               " bench latency --size 64 --count 20 --warmup 0 --floors none "
                               "--rounds 10000 --json | head -1";
  Process program({.program = "/bin/sh",
                   .arguments = {"-c", pipeline},
                   .environment = {"TMPDIR=" + temporary_.path().string()}});

  EXPECT_EQ(take(program), 0);

  EXPECT_THAT(output_, HasSubstr("\"round\":1"));
  EXPECT_THAT(errors_, HasSubstr("standard output: Broken pipe"));
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, OutputThatCannotBeWrittenIsAFailure) {
  EXPECT_EQ(launch(few({"latency", "--size", "64", "--raw", "/dev/full"})), 1);

  EXPECT_THAT(errors_, HasSubstr("--raw /dev/full: No space left on device"));
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, FolderForTemporaryFilesIsNamedIfItIsMissing) {
  auto options = started_with({"latency", "--size", "64"});
  options.environment = {"TMPDIR=/nonexistent"};
  Process program(options);

  EXPECT_EQ(take(program), 1);

  EXPECT_THAT(errors_, AllOf(HasSubstr("/nonexistent: No such file"), HasSubstr("TMPDIR")));
}

// ---- Wrong command lines ----

TEST_F(Bench, WrongWordsSayWhatIsRight) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{}, "mode is required"},
      {{"latancy"}, "did you mean \"latency\"?"},
      {{"xyz"},
       "chain, deadline, disk, fanout, flood, inspect, latency, record, rtt, startup, timer, "
       "trace"},
      {{"latency", "--size", "5X"}, "as 64, 32K or 4M"},
      {{"latency", "--size", "2G"}, "up to 1G"},
      {{"latency", "--count", "0"}, "--count expects a number from 1"},
      {{"latency", "--count", "many"}, "--count"},
      {{"latency", "--interval-us", "0"}, "--interval-us expects"},
      {{"fanout", "--subs", "1000"}, "--subs expects a number from 1 to 999, not 1000"},
      {{"chain", "--hops", "1000"}, "--hops expects a number from 1 to 999, not 1000"},
      {{"startup", "--components", "999"}, "--components expects a number from 1 to 998"},
      {{"latency", "--wait", "sleep"}, "--wait is \"park\", \"spin\" or \"adaptive\""},
      {{"latency", "--floors", "some"}, "--floors is"},
      {{"latency", "--subs", "3"}, "it is for fanout"},
      {{"startup", "--for", "10"}, "with its unit"},
      {{"timer", "--clock", "sundial"}, "--clock is"},
      {{"timer", "--clock", "simulated", "--fifo"}, "does not measure time"},
      {{"latency", "--slice-us", "100", "--fifo"}, "--slice-us has no effect with --fifo"},
      {{"latency", "--slice-us", "99"}, "--slice-us expects a number from 100 to 100000, not 99"},
      {{"timer", "--clock", "simulated", "--wait", "park"}, "--wait means nothing"},
      {{"fanout", "--floors", "all"}, "it is for chain"},
      {{"startup", "--floors", "none"}, "--floors means nothing"},
      {{"flood", "--size", "1G", "--window", "65536"}, "use a smaller --size"},
      {{"latency", "--raw", "/nonexistent/x.csv"}, "cannot be written"},
      {{"latency", "--sise", "64"}, "did you mean \"--size\"?"}};
  for (const auto& [words, hint] : cases) {
    EXPECT_EQ(launch(words), 2) << hint;
    EXPECT_THAT(errors_, HasSubstr(hint));
    EXPECT_THAT(output_, IsEmpty());
  }
  EXPECT_THAT(left_behind(), IsEmpty());
}

TEST_F(Bench, HelpShowsModesAndExamples) {
  EXPECT_EQ(launch({"--help"}), 0);

  EXPECT_THAT(output_, AllOf(HasSubstr("Modes:"), HasSubstr("Examples:"), HasSubstr("--wait")));
}

}  // namespace
}  // namespace fastcycle::bench
