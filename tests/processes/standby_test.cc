// Processes with a standby, as a user runs them.

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fastcycle/version.h"
#include "process/process.h"

namespace fastcycle {
namespace {

using nlohmann::json;
using test::Process;
using testing::HasSubstr;
using testing::Not;
using namespace std::chrono_literals;

/// Runs an application whose process "summing" has a standby.
class AStandby : public testing::Test {
 protected:
  [[nodiscard]] static std::string application(
      int count, const std::string& params = "{}",
      const std::string& process = R"(, "heartbeat_ms": 5000)") {
    return R"({"name": "pair", "state_period_s": 0.1,
               "processes": [{"name": "summing", "restart": {"limit": 1000}, "standby": true)" +
           process + R"(}],
               "components": [
             {"name": "source", "library": "processes_parts", "class": "Sensor",
              "serve_period_ms": 5, "params": {"count": )" +
           std::to_string(count) + R"(}},
             {"name": "accumulator", "library": "processes_parts", "class": "Accumulator",
              "process": "summing", "params": )" +
           params + R"(},
             {"name": "auditor", "library": "processes_parts", "class": "Auditor"}]})";
  }

  [[nodiscard]] test::ProcessOptions options(const std::string& text) const {
    const auto file = folder_.write("pair.json", text);
    std::vector<std::string> words{"run", file.string(), "--report", (folder_ / "report").string()};
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");
    }
    return {.program = FASTCYCLE_PROGRAM, .arguments = words, .folder = folder_.path()};
  }

  [[nodiscard]] json results() const {
    return json::parse(test::read_file(folder_ / "report"), nullptr, false)["results"];
  }

  void expect_ledgers() const {
    const json said = json::parse(test::read_file(folder_ / "report"), nullptr, false);
    for (const auto& [name, topic] : said["topics"].items()) {
      for (const auto& [component, subscriber] : topic["subscribers"].items()) {
        EXPECT_EQ(subscriber["adds_up"], true) << name << " at " << component << subscriber.dump();
      }
    }
  }

  void expect_each_sum_once(const Process& run, int count) const {
    const json said = results();
    EXPECT_EQ(said["sums"], count) << run.errors();
    EXPECT_EQ(said["missing"], 0) << run.errors();
    EXPECT_EQ(said["twice"], 0) << run.errors();
    EXPECT_EQ(said["wrong"], 0) << run.errors();
  }

  static pid_t find(const Process& run, const std::string& name) {
    return test::process_of_session(run.pid(), name);
  }
  static pid_t await(const Process& run, const std::string& name, pid_t other_than = 0) {
    for (int i = 0; i < 3000; ++i) {
      if (const pid_t found = find(run, name); found != 0 && found != other_than) {
        return found;
      }
      std::this_thread::sleep_for(10ms);
    }
    ADD_FAILURE() << "no process " << name << ": " << run.errors();
    return 0;
  }
  test::Folder folder_;
};

TEST_F(AStandby, DoesWhatItFollowsAndPublishesNothing) {
  Process run(options(application(200)));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(), HasSubstr("process \"summing.standby\" is on standby"));
  EXPECT_THAT(run.errors(), Not(HasSubstr("cannot be on standby")));
  expect_each_sum_once(run, 200);
}

TEST_F(AStandby, TakesThePlaceOfAProcessThatWasKilledWithoutLossOrRepetition) {
  Process run(options(application(600)));
  const pid_t first = await(run, "summing");
  ASSERT_TRUE(run.wait_for("is on standby")) << run.errors();
  std::this_thread::sleep_for(500ms);

  kill(first, SIGKILL);

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  EXPECT_THAT(run.errors(), HasSubstr("process \"summing.standby\" has taken over"));
  expect_each_sum_once(run, 600);
}

TEST_F(AStandby, GoesOnInTheLogWhereTheOtherOneEnds) {
  const auto log = folder_ / "log.mcap";
  test::ProcessOptions recorded = options(application(600));
  recorded.arguments.insert(recorded.arguments.end(), {"--record", log.string()});
  Process run(recorded);
  ASSERT_TRUE(run.wait_for("is on standby")) << run.errors();
  std::this_thread::sleep_for(500ms);
  kill(await(run, "summing"), SIGKILL);
  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const auto report = folder_ / "verified";
  Process verify({.program = FASTCYCLE_PROGRAM,
                  .arguments = {"verify", log.string(), "--report", report.string()}});

  EXPECT_EQ(verify.wait().exit_code, 0) << verify.output() << verify.errors();
  const json accumulator =
      json::parse(test::read_file(report), nullptr, false)["components"]["accumulator"];
  EXPECT_GT(accumulator["activations"], 600) << verify.output();
  EXPECT_GE(accumulator["equal"], 600) << verify.output();
}

TEST_F(AStandby, CompletesInTheLogTheActivationInWhichTheOtherOneEnded) {
  const auto log = folder_ / "log.mcap";
  const auto stopped = folder_ / "stopped";
  test::ProcessOptions recorded = options(
      application(600, R"({"stops_at": 200, "stops_once": ")" + stopped.string() + R"("})"));
  recorded.arguments.insert(recorded.arguments.end(), {"--record", log.string()});
  Process run(recorded);
  ASSERT_TRUE(run.wait_for("is on standby")) << run.errors();
  const pid_t process = await(run, "summing");
  for (int i = 0; i < 3000 && !std::filesystem::exists(stopped); ++i) {
    std::this_thread::sleep_for(10ms);
  }
  kill(process, SIGKILL);
  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  expect_each_sum_once(run, 600);

  Process verify({.program = FASTCYCLE_PROGRAM, .arguments = {"verify", log.string()}});
  EXPECT_EQ(verify.wait().exit_code, 0) << verify.output() << verify.errors();
}

TEST_F(AStandby, IsMadeAnewAndTakesOverAgainAndAgain) {
  constexpr int kKills = 6;
  Process run(options(application(4000)));
  ASSERT_TRUE(run.wait_for("\"summing.standby\" is on standby, in its run 1")) << run.errors();
  for (int i = 0; i < kKills; ++i) {
    const std::string active = i % 2 == 0 ? "summing" : "summing.standby";
    const pid_t process = await(run, active);

    kill(process, SIGKILL);

    ASSERT_TRUE(
        run.wait_for("\"" + active + "\" is on standby, in its run " + std::to_string(i / 2 + 2)))
        << run.errors();
  }
  run.send(SIGINT);

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  const json said = results();
  EXPECT_GT(said["sums"], kKills) << run.errors();
  expect_ledgers();
  EXPECT_EQ(said["missing"], 0) << run.errors();
  EXPECT_EQ(said["twice"], 0) << run.errors();
  EXPECT_EQ(said["wrong"], 0) << run.errors();
}

TEST_F(AStandby, TakesThePlaceOfAProcessThatStandsStill) {
  Process run(options(application(100'000, "{}", R"(, "heartbeat_ms": 300)")));
  ASSERT_TRUE(run.wait_for("is on standby")) << run.errors();
  const pid_t first = await(run, "summing");

  kill(first, SIGSTOP);

  ASSERT_TRUE(run.wait_for("\"summing.standby\" has taken over")) << run.errors();
  kill(first, SIGCONT);
  ASSERT_TRUE(run.wait_for("\"summing\" is on standby, in its run 2")) << run.errors();
  run.send(SIGINT);
  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  const json said = results();
  EXPECT_EQ(said["missing"], 0) << run.errors();
  EXPECT_EQ(said["twice"], 0) << run.errors();
  EXPECT_EQ(said["wrong"], 0) << run.errors();
}

TEST_F(AStandby, LeavesOutTheActivationInWhichTheOtherOneCrashed) {
  Process run(options(application(300, R"({"crash_at": 100})")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(), HasSubstr("is left out: the other process crashed in it"));
  EXPECT_THAT(run.errors(), HasSubstr("\"summing\" is on standby, in its run 2"));
  const json said = results();
  EXPECT_EQ(said["sums"], 299) << run.errors();
  EXPECT_EQ(said["missing"], 0) << run.errors();
  EXPECT_EQ(said["twice"], 0) << run.errors();
}

TEST_F(AStandby, ThatPublishesSomethingElseIsMadeAnew) {
  Process run(options(application(400, R"({"drifts": true})")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(),
              HasSubstr("process \"summing.standby\" cannot be on standby: message 50 of \"sums\" "
                        "differs: field text is "));
  EXPECT_THAT(run.errors(), HasSubstr("\"summing.standby\" is on standby, in its run 2"));
  expect_each_sum_once(run, 400);
}

TEST_F(AStandby, ThatIsNotRestartedAnyMoreLeavesTheOthersAlone) {
  std::string text = application(400, R"({"drifts": true})");
  text.replace(text.find("1000}"), 5, "0}");
  Process run(options(text));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(), HasSubstr("process \"summing.standby\" ended with exit code 1, after 0 "
                                      "restarts; the others go on without it"));
  expect_each_sum_once(run, 400);
}

TEST_F(AStandby, TakesOverWhenItIsAskedTo) {
  const std::vector<std::string> environment{"XDG_RUNTIME_DIR=" + folder_.path().string()};
  test::ProcessOptions watched = options(application(100'000));
  watched.arguments.insert(watched.arguments.end(), {"--inspect", "--inspect-allow", "lifecycle",
                                                     "--inspect-allow", "reload"});
  watched.environment = environment;
  Process run(watched);
  const auto tool = [&](std::vector<std::string> words) {
    words.insert(words.end(), {"--app", "pair"});
    Process asked({.program = FASTCYCLE_PROGRAM,
                   .arguments = words,
                   .folder = folder_.path(),
                   .environment = environment});
    const int code = asked.wait().exit_code;
    return std::pair(code, asked.output() + asked.errors());
  };
  ASSERT_TRUE(run.wait_for("is on standby")) << run.errors();
  const auto is_in_step = [&] {
    const json all = json::parse(tool({"standby", "--json"}).second, nullptr, false);
    return all.is_array() && std::ranges::any_of(all, [](const json& one) {
             return one["process"] == "summing.standby" && one["state"] == "in step" &&
                    one["compared"] > 0;
           });
  };
  for (int i = 0; i < 300 && !is_in_step(); ++i) {
    std::this_thread::sleep_for(50ms);
  }
  EXPECT_TRUE(is_in_step());

  const auto [code, said] = tool({"component", "switch", "accumulator"});

  EXPECT_EQ(code, 0) << said;
  EXPECT_THAT(said, HasSubstr("the standby of component \"accumulator\" takes over"));
  ASSERT_TRUE(run.wait_for("\"summing.standby\" has taken over")) << run.errors();
  ASSERT_TRUE(run.wait_for("\"summing\" is on standby, in its run 2")) << run.errors();
  EXPECT_NE(tool({"component", "switch", "source"}).first, 0);
  const auto reloaded =
      tool({"component", "reload", "accumulator", "--library", "processes_parts"});
  EXPECT_NE(reloaded.first, 0);
  EXPECT_THAT(reloaded.second, HasSubstr("another process follows it"));
  run.send(SIGINT);
  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  EXPECT_EQ(results()["missing"], 0) << run.errors();
  EXPECT_EQ(results()["twice"], 0) << run.errors();
}

/// Runs an application with a shadow.
class AShadow : public AStandby {
 protected:
  [[nodiscard]] static std::string application(const std::string& shadow) {
    return R"({"name": "shadowed", "shadow": [)" + shadow + R"(],
               "components": [
             {"name": "source", "library": "processes_parts", "class": "Sensor",
              "serve_period_ms": 5, "params": {"count": 200}},
             {"name": "relay", "library": "processes_parts", "class": "Relay"},
             {"name": "sink", "library": "processes_parts", "class": "Sink"}]})";
  }

  [[nodiscard]] json topic_of(const std::string& shadow) const {
    const json said = json::parse(test::read_file(folder_ / "report"), nullptr, false);
    return said.contains(shadow) ? said[shadow]["topics"][0] : json::object();
  }
};

TEST_F(AShadow, OfTheSameLibraryDiffersInNothing) {
  Process run(options(application(R"({"of": "relay"})")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json topic = topic_of("shadow");
  EXPECT_EQ(topic["topic"], "relayed") << run.errors();
  EXPECT_GT(topic["compared"], 100) << run.errors();
  EXPECT_EQ(topic["different"], 0) << topic.dump();
  EXPECT_EQ(topic["missing"], 0) << topic.dump();
  EXPECT_EQ(topic["new"], 0) << topic.dump();
}

TEST_F(AShadow, WithAnotherParamDiffersInTheFieldThatFollowsFromIt) {
  Process run(options(application(R"({"of": "relay", "name": "twice", "params": {"gain": 2}})")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json topic = topic_of("twice");
  EXPECT_EQ(topic["different"], topic["compared"]) << topic.dump();
  ASSERT_EQ(topic["fields"].size(), 1U) << topic.dump();
  EXPECT_EQ(topic["fields"][0]["field"], "value");
  EXPECT_EQ(topic["fields"][0]["first"]["recorded"], "1");
  EXPECT_EQ(topic["fields"][0]["first"]["now"], "2");
  const json said = json::parse(test::read_file(folder_ / "report"), nullptr, false);
  EXPECT_EQ(said["topics"]["relayed"]["published"], 200);  // The shadow publishes nothing.
  EXPECT_EQ(said["results"]["whole"], 200);
}

TEST_F(AShadow, ThatPublishesNothingIsNotReportedAsEqual) {
  Process run(options(application(R"({"of": "relay", "params": {"is_silent": true}})")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json topic = topic_of("shadow");
  EXPECT_EQ(topic["compared"], 0) << topic.dump();
  EXPECT_GT(topic["not_compared"], 100) << topic.dump();
}

TEST_F(AShadow, WithOtherTopicsIsRefused) {
  Process run(options(application(R"({"of": "relay", "class": "Sink"})")));

  EXPECT_NE(run.wait().exit_code, 0);

  EXPECT_THAT(run.errors(),
              HasSubstr("process \"shadow\" cannot follow: its \"relay\" publishes on "
                        "other topics than the one that it follows"));
}

TEST_F(AShadow, IsReportedAsMissingInSimulatedTime) {
  test::ProcessOptions simulated = options(application(R"({"of": "relay"})"));
  simulated.arguments.insert(simulated.arguments.end(), {"--clock", "simulated"});
  Process run(simulated);

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(), HasSubstr("simulated time does not support standbys and shadows"));
}

TEST_F(AShadow, ThatEndsLeavesTheOthersAlone) {
  Process run(options(application(R"({"of": "relay", "params": {"crash_at": 50}})")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(), HasSubstr("process \"shadow\" ended by signal 11"));
  EXPECT_THAT(run.errors(), HasSubstr("the others go on without it"));
  const json said = json::parse(test::read_file(folder_ / "report"), nullptr, false);
  EXPECT_EQ(said["results"]["whole"], 200);
}

}  // namespace
}  // namespace fastcycle
