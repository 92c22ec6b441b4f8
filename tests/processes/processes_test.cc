#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "fastcycle/version.h"
#include "process/process.h"

namespace fastcycle {
namespace {

using nlohmann::json;
using test::Process;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;
using namespace std::chrono_literals;

/// Runs applications, and reads their reports.
class ComponentsInProcesses : public testing::Test {
 protected:
  [[nodiscard]] std::string application(const std::string& relay, const std::string& more = "",
                                        int count = 200) const {
    return R"({"name": "several", )" + more +
           R"("components": [
             {"name": "source", "library": "processes_parts", "class": "Sensor",
              "serve_period_ms": 5, "params": {"count": )" +
           std::to_string(count) + R"(}},
             {"name": "relay", "library": "processes_parts", "class": "Relay", )" +
           relay + R"(},
             {"name": "sink", "library": "processes_parts", "class": "Sink"}]})";
  }

  [[nodiscard]] test::ProcessOptions options(const std::string& text,
                                             const std::vector<std::string>& more = {}) const {
    const auto file = folder_.write("several.json", text);
    std::vector<std::string> words{"run", file.string(), "--report", (folder_ / "report").string()};
    words.insert(words.end(), more.begin(), more.end());
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");
    }
    return {.program = FASTCYCLE_PROGRAM, .arguments = words, .folder = folder_.path()};
  }

  [[nodiscard]] json report() const {
    return json::parse(test::read_file(folder_ / "report"), nullptr, false);
  }

  /// As the environment of a run, makes `ask` find it.
  [[nodiscard]] std::vector<std::string> environment() const {
    return {"XDG_RUNTIME_DIR=" + folder_.path().string()};
  }

  /// What a tool prints of the application: its output, or its errors if it fails.
  [[nodiscard]] std::pair<int, std::string> ask(std::vector<std::string> words) const {
    words.insert(words.end(), {"--app", "several"});
    Process asked({.program = FASTCYCLE_PROGRAM,
                   .arguments = words,
                   .folder = folder_.path(),
                   .environment = environment()});
    const int code = asked.wait().exit_code;
    return {code, code == 0 ? asked.output() : asked.errors()};
  }

  test::Folder folder_;
};

void expect_ledgers(const json& report) {
  for (const auto& [name, topic] : report["topics"].items()) {
    for (const auto& [component, subscriber] : topic["subscribers"].items()) {
      EXPECT_TRUE(subscriber["adds_up"].get<bool>()) << name << " at " << component;
    }
  }
}

TEST_F(ComponentsInProcesses, GetTheMessagesOfTheOthersWhole) {
  Process run(options(application(R"("process": "relaying")")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  EXPECT_EQ(said["results"]["whole"], 200);
  EXPECT_GT(said["results"]["relayed"], 100);
  EXPECT_EQ(said["results"]["process_of_source"], said["results"]["process_of_sink"]);
  EXPECT_NE(said["results"]["process_of_source"], said["results"]["process_of_relay"]);
  EXPECT_EQ(said["topics"]["readings"]["published"], 200);
  EXPECT_EQ(said["topics"]["relayed"]["published"], 200);
  EXPECT_EQ(said["processes"].size(), 2U);
  for (const auto& [name, process] : said["processes"].items()) {
    for (const json& link : process["links"]) {
      EXPECT_EQ(link["given"], 200) << name;
      EXPECT_EQ(link["copied"], 0) << name;
    }
  }
  expect_ledgers(said);
}

// The relay's messages arrive as parsed copies, and it reads those of the source in place.
TEST_F(ComponentsInProcesses, GetCopiesOfWhatAProcessSendsThatIsNotTrusted) {
  Process run(options(application(R"("process": "relaying")",
                                  R"("processes": [{"name": "relaying", "trusted": false}], )")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  EXPECT_EQ(said["results"]["whole"], 200);
  EXPECT_GT(said["results"]["relayed"], 100);
  EXPECT_EQ(said["topics"]["relayed"]["published"], 200);
  const auto copied = [&](const char* process) {
    return said["processes"][process]["links"][0]["copied"].get<int>();
  };
  EXPECT_EQ(copied("relaying"), 200);
  EXPECT_EQ(copied("main"), 0);
  EXPECT_THAT(run.output() + run.errors(), HasSubstr("its process is not trusted"));
  expect_ledgers(said);
}

// A text that is not UTF-8 can be serialized, but not parsed.
TEST_F(ComponentsInProcesses, LogWhichProcessThatIsNotTrustedSentInvalidMessages) {
  const std::string text =
      R"({"name": "invalid", "processes": [{"name": "sensing", "trusted": false}], "components": [
          {"name": "source", "library": "processes_parts", "class": "Sensor", "process": "sensing",
           "serve_period_ms": 5, "params": {"count": 100, "invalid_at": 20}},
          {"name": "sink", "library": "processes_parts", "class": "Sink"}]})";
  for (const char* clock : {"live", "simulated"}) {
    Process run(options(text, {"--clock", clock}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    EXPECT_THAT(run.errors(),
                HasSubstr("1 message of \"readings\" from \"source\" in the process \"sensing\", "
                          "which is not trusted, was not of the topic's type: dropped"));
    const json said = report();
    EXPECT_EQ(said["results"]["whole"], 99) << clock;
    EXPECT_EQ(said["topics"]["readings"]["subscribers"][0]["dropped"]["process"], 1) << clock;
    expect_ledgers(said);
  }
}

TEST_F(ComponentsInProcesses, AreRecordedInOneLog) {
  const auto log = folder_ / "log.mcap";
  Process run(options(application(R"("process": "relaying")"),
                      {"--isolate", "all", "--record", log.string()}));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(), Not(HasSubstr("crash report")));
  Process info({.program = FASTCYCLE_PROGRAM, .arguments = {"info", "--json", log.string()}});
  EXPECT_EQ(info.wait().exit_code, 0) << info.errors();
  const json said = json::parse(info.output(), nullptr, false);
  for (const char* topic : {"readings", "relayed"}) {
    EXPECT_EQ(said["files"][0]["topics"][topic]["messages"], 200) << info.output();
  }
}

// The recorder's process gets no CPU for a while, as on a loaded machine. In the second run more
// waits for it than may.
TEST_F(ComponentsInProcesses, AreInTheLogOrCountedThereWhenTheRecorderStandsStill) {
  for (const int milliseconds : {300, 2000}) {
    const auto log = folder_ / (std::to_string(milliseconds) + ".mcap");
    const auto written = log.string() + ".active";
    Process run(options(application(R"("after": ["source"])", "", 100 + milliseconds / 5),
                        {"--isolate", "all", "--record", log.string()}));
    std::error_code missing;
    for (int i = 0; i < 60'000 && (!std::filesystem::exists(written, missing) ||
                                   std::filesystem::file_size(written, missing) < 10'000);
         ++i) {
      std::this_thread::sleep_for(1ms);
    }

    const pid_t recording = test::process_of_session(run.pid(), "main");
    ASSERT_NE(recording, 0);
    kill(recording, SIGSTOP);
    std::this_thread::sleep_for(milliseconds * 1ms);
    kill(recording, SIGCONT);

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
    Process info({.program = FASTCYCLE_PROGRAM, .arguments = {"info", "--json", log.string()}});
    EXPECT_EQ(info.wait().exit_code, 0) << info.errors();
    const json topics = json::parse(info.output(), nullptr, false)["files"][0]["topics"];
    for (const char* topic : {"readings", "relayed"}) {
      const json its = report()["recording"]["topics"][topic];
      EXPECT_EQ(its["published"], 100 + milliseconds / 5) << topic;
      std::uint64_t lost = 0;
      for (const auto& [reason, count] : its["lost"].items()) {
        lost += count.get<std::uint64_t>();
      }
      EXPECT_EQ(its["recorded"].get<std::uint64_t>() + lost, its["published"]) << topic << its;
      EXPECT_EQ(topics[topic]["messages"], its["recorded"]) << topic;
    }
  }
}

/// What `fastcycle verify` says of a log: its exit code, and by component what its report has.
struct Verified {
  int exit_code = 0;
  std::string output;
  json components;
};

Verified verify(const std::filesystem::path& log, const test::Folder& folder) {
  const auto report = folder / "verified";
  Process run({.program = FASTCYCLE_PROGRAM,
               .arguments = {"verify", log.string(), "--report", report.string()}});
  const int exit_code = run.wait().exit_code;
  return {exit_code, run.output() + run.errors(),
          json::parse(test::read_file(report), nullptr, false)["components"]};
}

TEST_F(ComponentsInProcesses, AreExecutedAgainFromTheirLogAsThoseOfOneProcess) {
  for (const char* clock : {"live", "simulated"}) {
    const auto log = folder_ / (std::string(clock) + ".mcap");
    Process run(options(application(R"("after": ["source"])"),
                        {"--isolate", "all", "--clock", clock, "--record", log.string()}));
    ASSERT_EQ(run.wait().exit_code, 0) << run.errors();

    const Verified verified = verify(log, folder_);

    EXPECT_EQ(verified.exit_code, 0) << verified.output;
    for (const char* name : {"source", "relay", "sink"}) {
      const json& component = verified.components[name];
      EXPECT_GT(component["activations"], 200) << name << verified.output;
      EXPECT_EQ(component["activations"], component["recorded_activations"])
          << name << verified.output;
    }
    EXPECT_EQ(verified.components["relay"]["equal"], 200) << verified.output;
  }
}

TEST_F(ComponentsInProcesses, AreExecutedAgainUpToTheEndOfTheirProcess) {
  const auto log = folder_ / "log.mcap";
  Process run(options(application(R"("process": "relaying", "params": {"crash_at": 50})",
                                  R"("processes": [{"name": "relaying", "on_exit": "restart"}], )"),
                      {"--record", log.string()}));
  ASSERT_EQ(run.wait().exit_code, 0) << run.errors();

  const Verified verified = verify(log, folder_);

  EXPECT_EQ(verified.exit_code, 0) << verified.output;
  EXPECT_EQ(verified.components["relay"]["equal"], 49) << verified.output;
  EXPECT_THAT(verified.output, HasSubstr("activation 5"));  // In which it crashed.
  EXPECT_THAT(verified.output, HasSubstr("had not ended"));
  EXPECT_EQ(verified.components["sink"]["activations"],
            verified.components["sink"]["recorded_activations"])
      << verified.output;
}

TEST_F(ComponentsInProcesses, AreNamedIfTheyCrashWhenTheyAreExecutedAgain) {
  const auto log = folder_ / "log.mcap";
  Process run(options(application(R"("process": "relaying")"), {"--record", log.string()}));
  ASSERT_EQ(run.wait().exit_code, 0) << run.errors();

  Process verify({.program = FASTCYCLE_PROGRAM,
                  .arguments = {"verify", log.string(), "--set", "relay.crash_at=50"}});

  EXPECT_NE(verify.wait().exit_code, 0);
  EXPECT_THAT(verify.errors(), HasSubstr("component \"relay\""));
  EXPECT_THAT(verify.errors(), HasSubstr("\"readings\""));
}

TEST_F(ComponentsInProcesses, AreEachInOneWhereThatIsAskedFor) {
  Process run(options(application(R"("after": ["source"])"), {"--isolate", "all"}));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  std::set<std::int64_t> processes;
  for (const char* name : {"process_of_source", "process_of_relay", "process_of_sink"}) {
    processes.insert(said["results"][name].get<std::int64_t>());
  }
  EXPECT_EQ(processes.size(), 3U);
  EXPECT_EQ(said["results"]["whole"], 200);
  EXPECT_EQ(said["processes"].size(), 4U);
  expect_ledgers(said);
}

TEST_F(ComponentsInProcesses, EndTheApplicationWithTheirProcessUnlessTheFileSaysElse) {
  Process run(options(application(R"("process": "relaying", "params": {"crash_at": 20})")));

  EXPECT_EQ(run.wait().exit_code, 1);

  EXPECT_THAT(run.errors(), HasSubstr("process \"relaying\" ended by signal 11"));
  EXPECT_THAT(run.errors(), HasSubstr("relay"));  // Its crash report.
  EXPECT_THAT(report()["end"].get<std::string>(), HasSubstr("relaying"));
}

TEST_F(ComponentsInProcesses, AreMadeAnewWithTheirProcessWhileTheOthersGoOn) {
  const std::string text =
      application(R"("process": "relaying", "params": {"crash_at": 50})",
                  R"("processes": [{"name": "relaying", "on_exit": "restart"}], )", 400);
  Process run(options(text));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  EXPECT_THAT(run.errors(), HasSubstr("it is restarted"));
  EXPECT_EQ(said["components"]["relay"]["state"], "stopped");
  EXPECT_EQ(said["components"]["relay"]["faults"], 1);
  EXPECT_EQ(said["components"]["relay"]["restarts"], 1);
  EXPECT_THAT(said["components"]["relay"]["fault_texts"][0].get<std::string>(),
              HasSubstr("its process \"relaying\" has ended"));
  EXPECT_EQ(said["processes"]["relaying"]["restarts"], 1);
  EXPECT_EQ(said["results"]["whole"], 400);    // Nobody else lost anything,
  EXPECT_GT(said["results"]["relayed"], 350);  // and it relays again.
  expect_ledgers(said);
}

TEST_F(ComponentsInProcesses, FailTheRunWithTheirProcessWhereFaultsDo) {
  for (const char* const then : {"restart", "continue"}) {
    const std::string text = application(
        R"("process": "relaying", "params": {"crash_at": 50})",
        R"("processes": [{"name": "relaying", "on_exit": ")" + std::string(then) + R"("}], )");
    Process run(options(text, {"--fail-on-fault"}));

    EXPECT_EQ(run.wait().exit_code, 1) << then << run.errors();
  }
  // The last one did not come back.
  const json said = report();
  EXPECT_EQ(said["components"]["relay"]["state"], "failed");
  EXPECT_EQ(said["components"]["relay"]["faults"], 1);
  EXPECT_GT(said["topics"]["relayed"]["published"], 0);
}

TEST_F(ComponentsInProcesses, LogTheTimeSinceTheFirstStartAlsoInARestartedProcess) {
  Process run(
      options(application(R"("process": "relaying", "params": {"crash_at": 50, "log_every": 1})",
                          R"("processes": [{"name": "relaying", "on_exit": "restart"}], )", 400)));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  std::istringstream lines(run.errors());
  std::vector<double> times;
  for (std::string line; std::getline(lines, line);) {
    if (line.find(" warning relay: reading ") != std::string::npos) {
      times.push_back(std::stod(line));
    }
  }
  EXPECT_GT(times.size(), 350U) << run.errors();
  EXPECT_TRUE(std::ranges::is_sorted(times)) << run.errors();
}

TEST_F(ComponentsInProcesses, AreMadeAnewWhenOneOfThemHangs) {
  Process run(
      options(application(R"("process": "relaying", "params": {"hang_at": 20},
                     "callback_limit_ms": 1000, "on_hang": "end_process")",
                          R"("processes": [{"name": "relaying", "on_exit": "restart"}], )", 400)));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(), HasSubstr("component \"relay\": its callback for \"readings\""));
  EXPECT_THAT(run.errors(), HasSubstr("its process ends now"));
  EXPECT_THAT(run.errors(), HasSubstr("it is restarted"));
  const json said = report();
  EXPECT_EQ(said["processes"]["relaying"]["restarts"], 1);
  EXPECT_EQ(said["results"]["whole"], 400);
  expect_ledgers(said);
}

TEST_F(ComponentsInProcesses, AreHelpedByStepsUntilTheOthersGoOnWithoutThem) {
  for (const char* clock : {"live", "simulated"}) {
    Process run(
        options(application(
                    R"("process": "relaying", "params": {"throws": true}, "on_fault": "restart",
               "restart": {"limit": 2, "within_s": 60, "then": "process"}, "fault_mode": "alone")",
                    R"("modes": {"all": {"components": ["relay"]}, "alone": {"components": []}},
               "initial_mode": "all",
               "processes": [{"name": "relaying", "on_exit": "restart",
                              "restart": {"limit": 2, "within_s": 60, "then": "continue"}}], )",
                    400),
                {"--clock", clock}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    EXPECT_THAT(run.errors(), HasSubstr("it always throws (restarting)"));
    EXPECT_THAT(run.errors(),
                HasSubstr("(restarted 2 times within 60 s: its process is restarted)"));
    EXPECT_THAT(run.errors(), HasSubstr("ended with exit code 1; it is restarted"));
    EXPECT_THAT(run.errors(), HasSubstr("after 2 restarts; the others go on without it"));
    const json said = report();
    EXPECT_EQ(said["topics"]["readings"]["published"], 400) << clock;
    ASSERT_EQ(said["modes"]["switches"].size(), 1U) << clock << run.errors();
    EXPECT_EQ(said["modes"]["switches"][0]["to"], "alone");
    EXPECT_THAT(said["modes"]["switches"][0]["why"].get<std::string>(),
                HasSubstr("its process \"relaying\" has ended"));
    expect_ledgers(said);
  }
}

TEST_F(ComponentsInProcesses, HaveTheFlightRecorderDumpWhatTheyAskForAndTheirFaults) {
  struct Case {
    const char* clock;
    const char* params;
    const char* reason;
  };
  const std::string ring = (folder_ / "drive.ring").string();
  for (const Case& one :
       {Case{"live", R"({"throw_at": 50})", "fault"}, Case{"live", R"({"crash_at": 50})", "fault"},
        Case{"live", R"({"dump_at": 50})", "hard braking"},
        Case{"simulated", R"({"throw_at": 50})", "fault"},
        Case{"simulated", R"({"crash_at": 50})", "fault"},
        Case{"simulated", R"({"dump_at": 50})", "hard braking"}}) {
    Process run(options(
        application(fmt::format(R"("process": "relaying", "params": {}, "on_fault": "restart")",
                                one.params),
                    R"("processes": [{"name": "relaying", "on_exit": "restart"}], )", 400),
        {"--clock", one.clock, "--flight-recorder", ring}));

    EXPECT_EQ(run.wait().exit_code, 0) << one.clock << one.params << run.errors();

    const json said = report()["flight_recorder"];
    EXPECT_EQ(said["file"], ring);
    ASSERT_EQ(said["dumps"].size(), 1U) << one.clock << one.params << said << run.errors();
    const json& dump = said["dumps"][0];
    EXPECT_EQ(dump["reason"], one.reason);
    EXPECT_EQ(dump["component"], "relay");
    EXPECT_TRUE(std::filesystem::exists(dump["file"].get<std::string>())) << dump;
    EXPECT_GT(dump["messages"], 100) << one.clock << one.params;
    EXPECT_EQ(dump["problem"], "");
  }
}

TEST_F(ComponentsInProcesses, StopTheApplicationWhereTheirProcessIsRestartedTooOften) {
  Process run(options(
      application(R"("process": "relaying", "params": {"throws": true}, "on_fault": "restart",
                     "restart": {"limit": 1, "then": "process"})",
                  R"("processes": [{"name": "relaying", "on_exit": "restart",
                                    "restart": {"limit": 1, "within_s": 60}}], )",
                  1'000'000)));

  EXPECT_EQ(run.wait().exit_code, 1) << run.errors();

  EXPECT_THAT(run.errors(), HasSubstr("after 1 restarts; the application stops"));
}

TEST_F(ComponentsInProcesses, AreMadeAnewWhenTheirProcessStandsStill) {
  Process run(options(application(
      R"("process": "relaying")",
      R"("processes": [{"name": "relaying", "on_exit": "restart", "heartbeat_ms": 2000}], )",
      1'000'000)));
  const auto find = [&] { return test::process_of_session(run.pid(), "relaying"); };
  while (find() == 0) {
    std::this_thread::sleep_for(10ms);
  }
  std::this_thread::sleep_for(1s);
  const pid_t first = find();

  kill(first, SIGSTOP);
  for (int i = 0; i < 2000 && (find() == first || find() == 0); ++i) {
    std::this_thread::sleep_for(10ms);
  }
  run.send(SIGINT);

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  EXPECT_THAT(run.errors(),
              HasSubstr("process \"relaying\" has given no sign of life for 2000 ms"));
  EXPECT_THAT(run.errors(), HasSubstr("it is restarted"));
}

TEST_F(ComponentsInProcesses, CannotWriteIntoWhatTheyReceived) {
  Process run(
      options(application(R"("process": "relaying", "params": {"write_at": 30})",
                          R"("processes": [{"name": "relaying", "on_exit": "continue"}], )", 100)));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(), HasSubstr("process \"relaying\" ended by signal 11"));
  EXPECT_THAT(run.errors(), HasSubstr("the others go on without it"));
  const json said = report();
  EXPECT_EQ(said["results"]["whole"], 100);
  EXPECT_TRUE(said["processes"]["relaying"]["cpu_s"].is_null()) << said["processes"];
  EXPECT_EQ(said["processes"]["relaying"]["restarts"], 0);
}

TEST_F(ComponentsInProcesses, MayOnlyComputeInASandbox) {
  if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
    GTEST_SKIP() << "a sanitizer does what a sandbox refuses";
  }
  Process run(
      options(application(R"("process": "relaying")",
                          R"("processes": [{"name": "relaying", "sandbox": "strict"}], )", 50)));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  EXPECT_EQ(said["results"]["may_open_sockets"], false);
  EXPECT_EQ(said["results"]["whole"], 50);
  EXPECT_GT(said["results"]["relayed"], 20);
  EXPECT_THAT(run.errors(),
              HasSubstr("its sandbox refused socket to component \"relay\" (1 time)"));
}

TEST_F(ComponentsInProcesses, EndWithTheSupervisor) {
  Process run(options(application(R"("process": "relaying")", "", 1'000'000)));
  while (test::processes_of_session(run.pid()) < 3) {
    std::this_thread::sleep_for(10ms);
  }

  run.send(SIGKILL);
  run.wait();

  for (int i = 0; i < 1000 && test::processes_of_session(run.pid()) > 0; ++i) {
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_EQ(test::processes_of_session(run.pid()), 0);
}

TEST_F(ComponentsInProcesses, EndAtOnceWhenAskedToAgainAlsoWhereAProcessStandsStill) {
  Process run(options(application(
      R"("process": "relaying")",
      R"("faults": {"list": [{"kind": "suspend", "process": "relaying", "from_s": 0.1}]}, )",
      1'000'000)));
  EXPECT_TRUE(run.wait_for("faults are injected into this run")) << run.errors();
  const auto stands_still = [&] {
    const pid_t process = test::process_of_session(run.pid(), "relaying");
    return process != 0 &&
           test::read_file("/proc/" + std::to_string(process) + "/stat").find(") T ") !=
               std::string::npos;
  };
  for (int i = 0; i < 6000 && !stands_still(); ++i) {
    std::this_thread::sleep_for(10ms);
  }

  run.send(SIGINT);
  // The main process ends. Later the supervisor would end the other one, with another exit code.
  for (int i = 0; i < 6000 && test::processes_of_session(run.pid()) > 2; ++i) {
    std::this_thread::sleep_for(10ms);
  }
  run.send(SIGINT);

  EXPECT_EQ(run.wait().exit_code, 130) << run.errors();
  EXPECT_THAT(run.errors(), HasSubstr("process \"relaying\" has not come to its end"));
}

TEST_F(ComponentsInProcesses, EndInOrderWhenAskedTo) {
  for (const int signal : {SIGINT, SIGHUP}) {  // By Ctrl-C, and when the terminal is closed.
    Process run(options(application(R"("process": "relaying")", "", 1'000'000)));
    while (test::processes_of_session(run.pid()) < 3) {
      std::this_thread::sleep_for(10ms);
    }
    std::this_thread::sleep_for(1s);

    run.send(signal);

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
    const json said = report();
    EXPECT_EQ(said["end"], "stopped on request");
    expect_ledgers(said);
  }
}

/// All messages of a log as text, then what the log says of their origins and rounds: this comes in
/// pieces as large as the recorder happens to make them.
std::string messages_of(const std::filesystem::path& log, const std::vector<std::string>& topics) {
  constexpr const char* kInfos = "fastcycle/message_infos";
  std::vector<std::string> words{"echo", "--json", "--full", log.string(), kInfos};
  words.insert(words.end(), topics.begin(), topics.end());
  Process echo({.program = FASTCYCLE_PROGRAM, .arguments = words});
  EXPECT_EQ(echo.wait().exit_code, 0) << echo.errors();
  std::string messages;
  std::string infos;
  std::istringstream lines(echo.output());
  for (std::string line; std::getline(lines, line);) {
    const json message = json::parse(line, nullptr, false);
    if (message["topic"] == kInfos) {
      for (const json& info : message["data"]["infos"]) {
        infos += info.dump() + "\n";
      }
    } else {
      messages += line + "\n";
    }
  }
  return messages + infos;
}

/// Whether two logs have the same messages.
testing::AssertionResult are_equal(const std::filesystem::path& one,
                                   const std::filesystem::path& other,
                                   const std::vector<std::string>& topics = {"readings",
                                                                             "relayed"}) {
  const std::string messages = messages_of(one, topics);
  const std::string others = messages_of(other, topics);
  const auto differs = std::ranges::mismatch(messages, others);
  if (differs.in1 == messages.end() && differs.in2 == others.end() && !messages.empty()) {
    return testing::AssertionSuccess();
  }
  const auto at = static_cast<std::size_t>(differs.in1 - messages.begin());
  const std::size_t from = at < 200 ? 0 : at - 200;
  return testing::AssertionFailure()
         << messages.size() << " and " << others.size() << " bytes of text, which differ from "
         << at << " on:\n  " << messages.substr(from, 400) << "\n  " << others.substr(from, 400);
}

/// Whether each process but the main one is not trusted.
class ComponentsInSimulatedTime : public ComponentsInProcesses,
                                  public testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(, ComponentsInSimulatedTime, testing::Bool(),
                         [](const auto& its) { return its.param ? "notTrusted" : "trusted"; });

TEST_P(ComponentsInSimulatedTime, ComputeTheSameAsInOneProcess) {
  constexpr const char* kUntrusted =
      R"("processes": [{"name": "source", "trusted": false}, {"name": "relay", "trusted": false},
                       {"name": "sink", "trusted": false}], )";
  const std::string text = application(R"("after": ["source"])", GetParam() ? kUntrusted : "", 300);
  const auto alone = folder_ / "alone.mcap";
  Process in_one(
      options(text, {"--clock", "simulated", "--workers", "1", "--record", alone.string()}));
  ASSERT_EQ(in_one.wait().exit_code, 0) << in_one.errors();
  const json report_of_one = report();

  for (const char* workers : {"1", "2", "4"}) {
    const auto log = folder_ / (std::string("workers_") + workers + ".mcap");
    Process run(options(text, {"--clock", "simulated", "--workers", workers, "--isolate", "all",
                               "--record", log.string()}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    EXPECT_TRUE(are_equal(alone, log));
    const json said = report();
    EXPECT_EQ(said["processes"].size(), 4U);
    for (const char* name : {"whole", "relayed"}) {
      EXPECT_EQ(said["results"][name], report_of_one["results"][name]) << name;
    }
    for (const char* topic : {"readings", "relayed"}) {
      EXPECT_EQ(said["topics"][topic]["published"], report_of_one["topics"][topic]["published"]);
    }
    EXPECT_EQ(said["end"], report_of_one["end"]);
    expect_ledgers(said);
  }
}

/// An application of which a component switches modes and changes params, each in the midst of the
/// run.
std::string steered(const std::string& steering, const std::string& more = "") {
  return R"({"name": "steered", )" + more + R"(
    "modes": {"nominal": {"components": ["relay"]}, "degraded": {"components": ["spare"]}},
    "initial_mode": "nominal",
    "components": [
      {"name": "source", "library": "processes_parts", "class": "Sensor",
       "serve_period_ms": 5, "params": {"count": 400}},
      {"name": "relay", "library": "processes_parts", "class": "Relay", "process": "relaying"},
      {"name": "spare", "library": "processes_parts", "class": "Observer", "process": "sparing"},
      {"name": "steering", "library": "processes_parts", "class": "Steering",
       "process": "steering", "params": {)" +
         steering + R"(}},
      {"name": "sink", "library": "processes_parts", "class": "Sink"}]})";
}

TEST_F(ComponentsInProcesses, SwitchModesTogether) {
  Process run(options(steered(R"("switch_at": 60, "back_at": 120)")));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  ASSERT_EQ(said["modes"]["switches"].size(), 2U) << run.errors();
  EXPECT_EQ(said["modes"]["switches"][0]["to"], "degraded");
  EXPECT_EQ(said["modes"]["switches"][0]["by"], "steering");
  EXPECT_EQ(said["modes"]["switches"][0]["why"], "it was asked to");
  EXPECT_EQ(said["modes"]["switches"][1]["to"], "nominal");
  EXPECT_THAT(run.errors(), HasSubstr("mode \"nominal\" → \"degraded\", requested by steering"));
  // The relay, in one process, had left before the spare, in another one, joined.
  EXPECT_GT(said["results"].value("first_of_spare", 0), 30);
  EXPECT_LT(said["results"].value("last_of_spare", 400), 400);
  EXPECT_LT(said["topics"]["relayed"]["published"], 400);
  EXPECT_GT(said["topics"]["relayed"]["published"], 30);
  EXPECT_GT(said["results"].value("relayed", 0), 120);
  expect_ledgers(said);
}

TEST_F(ComponentsInProcesses, ChangeParamsOfOthersAllOrNone) {
  Process good(options(steered(R"("change_at": 60, "gain": "3")")));
  EXPECT_EQ(good.wait().exit_code, 0) << good.errors();
  json said = report();
  ASSERT_TRUE(said["results"].contains("has_changed")) << good.errors();
  EXPECT_EQ(said["results"]["has_changed"], true);
  EXPECT_EQ(said["results"]["gain_of_relay"], 3);
  EXPECT_EQ(said["results"]["own_gain"], 7);
  EXPECT_THAT(good.errors(), HasSubstr("params: relay.gain: 1 → 3, steering.own_gain: 1 → 7"));

  Process bad(options(steered(R"("change_at": 60, "gain": "11")")));
  EXPECT_EQ(bad.wait().exit_code, 0) << bad.errors();
  said = report();
  ASSERT_TRUE(said["results"].contains("error")) << bad.errors();
  EXPECT_EQ(said["results"]["has_changed"], false);
  EXPECT_EQ(said["results"]["errors"], 1);
  EXPECT_THAT(said["results"]["error"].get<std::string>(), HasSubstr("relay.gain"));
  EXPECT_EQ(said["results"]["gain_of_relay"], 1);
  EXPECT_EQ(said["results"]["own_gain"], 1);
}

TEST_F(ComponentsInProcesses, SayThatMoreParamsHaveChangedThanARestartedProcessGets) {
  Process few(options(steered(R"("change_at": 60, "note_bytes": 10000)")));
  EXPECT_EQ(few.wait().exit_code, 0) << few.errors().substr(0, 2000);
  EXPECT_EQ(report()["results"].value("noted", 0), 3);
  EXPECT_THAT(few.errors(), Not(HasSubstr("there is room")));

  Process many(options(steered(R"("change_at": 60, "note_bytes": 25000)")));
  EXPECT_EQ(many.wait().exit_code, 0) << many.errors().substr(0, 2000);
  EXPECT_EQ(report()["results"].value("noted", 0), 3);
  EXPECT_THAT(many.errors(), HasSubstr("a process that is restarted from now on may not get"));
}

/// Of where the one who steers stands in the application file: 0 is before the others.
class ComponentsThatAreSteered : public ComponentsInProcesses,
                                 public testing::WithParamInterface<std::size_t> {};

INSTANTIATE_TEST_SUITE_P(From, ComponentsThatAreSteered, testing::Values(0, 2, 4));

TEST_P(ComponentsThatAreSteered, DoTheSameInSimulatedTimeAsInOneProcess) {
  json application = json::parse(steered(R"("switch_at": 60, "back_at": 120, "change_at": 121)"));
  std::swap(application["components"][3], application["components"][GetParam()]);
  const std::string text = application.dump();
  for (json& component : application["components"]) {
    component.erase("process");
  }
  const std::string in_one = application.dump();
  const auto alone = folder_ / "alone.mcap";
  Process run_alone(options(in_one, {"--clock", "simulated", "--record", alone.string()}));
  ASSERT_EQ(run_alone.wait().exit_code, 0) << run_alone.errors();
  const json report_of_one = report();

  for (const char* workers : {"1", "2"}) {
    const auto log = folder_ / (std::string("workers_") + workers + ".mcap");
    Process run(
        options(text, {"--clock", "simulated", "--workers", workers, "--record", log.string()}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    EXPECT_TRUE(are_equal(alone, log));
    const json said = report();
    EXPECT_EQ(said["modes"], report_of_one["modes"]);
    for (const char* name : {"relayed", "first_of_spare", "last_of_spare", "has_changed",
                             "gain_of_relay", "own_gain"}) {
      EXPECT_EQ(said["results"][name], report_of_one["results"][name]) << name;
    }
    expect_ledgers(said);
  }
}

TEST_F(ComponentsInProcesses, BeginAgainInTheModeAndWithTheParamsOfTheOthers) {
  for (const char* clock : {"live", "simulated"}) {
    json application =
        json::parse(steered(R"("change_at": 20, "switch_at": 30)",
                            R"("processes": [{"name": "relaying", "on_exit": "restart"},
                                 {"name": "sparing", "on_exit": "restart"}], )"));
    // The relay joins the mode, in a process that then crashes.
    application["modes"]["degraded"]["components"] = {"relay"};
    application["modes"]["nominal"]["components"] = {"spare"};
    application["components"][1]["params"]["crash_at"] = 100;
    Process run(options(application.dump(), {"--clock", clock}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    const json said = report();
    EXPECT_EQ(said["processes"]["relaying"]["restarts"], 1) << clock;
    EXPECT_EQ(said["results"]["gain_of_relay"], 3) << clock;
    EXPECT_EQ(said["modes"]["switches"].size(), 1U) << clock;
    EXPECT_GT(said["results"]["relayed"], 3 * 150) << clock;
    EXPECT_LT(said["results"].value("last_of_spare", 0), 300) << clock;
  }
}

TEST_F(ComponentsInProcesses, EndInTheSameRoundOfSimulatedTimeWhereOneFails) {
  const std::string text =
      application(R"("on_fault": "stop", "params": {"throw_at": 50})", "", 300);
  const auto alone = folder_ / "alone.mcap";
  Process in_one(options(text, {"--clock", "simulated", "--record", alone.string()}));
  ASSERT_EQ(in_one.wait().exit_code, 1) << in_one.errors();
  const auto log = folder_ / "isolated.mcap";
  Process run(
      options(text, {"--clock", "simulated", "--isolate", "all", "--record", log.string()}));

  EXPECT_EQ(run.wait().exit_code, 1) << run.errors();

  EXPECT_TRUE(are_equal(alone, log));
  EXPECT_EQ(report()["end"], "component fault");
}

TEST_F(ComponentsInProcesses, GoOnInSimulatedTimeWithoutAProcessThatEnded) {
  const std::string text =
      application(R"("process": "relaying", "params": {"crash_at": 50})",
                  R"("processes": [{"name": "relaying", "on_exit": "continue"}], )", 300);
  std::vector<std::filesystem::path> logs;
  for (const char* name : {"one.mcap", "two.mcap"}) {
    logs.push_back(folder_ / name);
    Process run(options(text, {"--clock", "simulated", "--record", logs.back().string()}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    const json said = report();
    EXPECT_EQ(said["results"]["whole"], 300);
    EXPECT_EQ(said["results"]["relayed"], 49);
  }
  EXPECT_TRUE(are_equal(logs[0], logs[1]));
}

// It restarts at a moment that its own inputs decide, so all of it comes out alike.
TEST_F(ComponentsInProcesses, AreMadeAnewAtTheSameRoundOfSimulatedTime) {
  const std::string text =
      application(R"("process": "relaying", "params": {"crash_at": 50, "crash_again_at": 120})",
                  R"("processes": [{"name": "relaying", "on_exit": "restart"}], )", 300);
  std::vector<std::filesystem::path> logs;
  for (const char* name : {"one.mcap", "two.mcap"}) {
    logs.push_back(folder_ / name);
    Process run(options(text, {"--clock", "simulated", "--record", logs.back().string()}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    const json said = report();
    EXPECT_EQ(said["processes"]["relaying"]["restarts"], 2);
    EXPECT_EQ(said["results"]["whole"], 300);
    EXPECT_EQ(said["results"]["relayed"], 299);  // When the last reading came.
    expect_ledgers(said);
  }
  EXPECT_TRUE(are_equal(logs[0], logs[1]));
}

TEST_F(ComponentsInProcesses, GetTheSameFromALogAsInOneProcess) {
  const std::string text = application(R"("after": ["source"])", "", 200);
  const auto recorded = folder_ / "recorded.mcap";
  Process record(options(text, {"--clock", "simulated", "--record", recorded.string()}));
  ASSERT_EQ(record.wait().exit_code, 0) << record.errors();
  const auto alone = folder_ / "alone.mcap";
  const std::vector<std::string> replay{"--clock",         "simulated",     "--replay",
                                        recorded.string(), "--replay-into", "relay",
                                        "--replay-into",   "sink"};
  std::vector<std::string> words = replay;
  words.insert(words.end(), {"--record", alone.string()});
  Process in_one(options(text, words));
  ASSERT_EQ(in_one.wait().exit_code, 0) << in_one.errors();
  const json report_of_one = report();
  const auto log = folder_ / "isolated.mcap";
  words = replay;
  words.insert(words.end(), {"--isolate", "all", "--record", log.string()});
  Process run(options(text, words));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_TRUE(are_equal(alone, log));
  EXPECT_EQ(report()["results"]["whole"], report_of_one["results"]["whole"]);
  EXPECT_EQ(report()["results"]["whole"], 200);
  EXPECT_EQ(report()["results"]["relayed"], report_of_one["results"]["relayed"]);
  EXPECT_EQ(report()["end"], report_of_one["end"]);
  EXPECT_EQ(report()["replay"], report_of_one["replay"]);
  EXPECT_EQ(report()["replay"]["fed"][0]["messages"], 200);
}

TEST_F(ComponentsInProcesses, GetALogLiveAtTheTimesThatItHas) {
  const auto recorded = folder_ / "recorded.mcap";
  const std::string text = application(R"("after": ["source"])", "", 200);
  Process record(options(text, {"--clock", "simulated", "--record", recorded.string()}));
  ASSERT_EQ(record.wait().exit_code, 0) << record.errors();
  const auto log = folder_ / "isolated.mcap";

  Process run(
      options(text, {"--replay", recorded.string(), "--replay-into", "relay", "--replay-into",
                     "sink", "--isolate", "all", "--record", log.string()}));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  const json said = report();
  EXPECT_EQ(said["results"]["whole"], 200);
  for (const char* topic : {"readings", "relayed"}) {
    EXPECT_EQ(said["topics"][topic]["published"], 200) << topic << said["topics"][topic];
  }
  EXPECT_EQ(said["end"], "input finished");
  EXPECT_EQ(said["replay"]["fed"][0]["messages"], 200);
  EXPECT_GT(said["replay"]["worst_lateness_us"], 0);
  expect_ledgers(said);
}

TEST_F(ComponentsInProcesses, GoOnInALogWhereTheOthersAreAfterARestart) {
  const auto recorded = folder_ / "recorded.mcap";
  Process record(options(application(R"("after": ["source"])", "", 1000),
                         {"--clock", "simulated", "--record", recorded.string()}));
  ASSERT_EQ(record.wait().exit_code, 0) << record.errors();

  Process run(
      options(application(R"("process": "relaying", "params": {"crash_at": 50})",
                          R"("processes": [{"name": "relaying", "on_exit": "restart"}], )", 1000),
              {"--replay", recorded.string(), "--replay-into", "relay", "--replay-into", "sink"}));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  const json said = report();
  EXPECT_EQ(said["processes"]["relaying"]["restarts"], 1);
  EXPECT_EQ(said["results"]["whole"], 1000);
  // What was fed while it was away is not fed again.
  EXPECT_GT(said["results"]["relayed"], 50);
  EXPECT_LE(said["results"]["relayed"], 1000);
}

TEST_F(ComponentsInProcesses, AreInTheStatusThatAnyProcessGets) {
  for (const char* clock : {"live", "simulated"}) {
    json described =
        json::parse(application(R"("process": "relaying", "params": {"crash_at": 100})",
                                R"("status_period_ms": 50,
                       "processes": [{"name": "relaying", "on_exit": "restart"}], )",
                                400));
    described["components"].push_back({{"name", "watcher"},
                                       {"library", "processes_parts"},
                                       {"class", "Watcher"},
                                       {"process", "watching"}});
    Process run(options(described.dump(), {"--clock", clock}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    const json said = report();
    ASSERT_TRUE(said["results"].contains("failure_of_relay")) << clock << said["results"];
    EXPECT_EQ(said["results"]["failure_of_relay"], "its process \"relaying\" has ended") << clock;
    EXPECT_EQ(said["results"]["health_of_relay"], 2) << clock;  // HEALTH_FAILED
    EXPECT_GE(said["results"]["failures_of_relay"], 1) << clock;
    EXPECT_EQ(said["results"]["state_of_relay"], 2) << clock;  // STATE_ACTIVE
    EXPECT_EQ(said["results"]["restarts_of_relay"], 1) << clock;
    expect_ledgers(said);
  }
}

TEST_F(ComponentsInProcesses, GetWhatIsLatchedAlsoWhenTheirProcessWasRestarted) {
  for (const char* clock : {"live", "simulated"}) {
    json described =
        json::parse(application(R"("process": "relaying", "params": {"crash_at": 100})",
                                R"("topics": {"map": {"latched": 1}},
                       "processes": [{"name": "relaying", "on_exit": "restart"}], )",
                                400));
    described["components"].push_back({{"name", "mapper"},
                                       {"library", "processes_parts"},
                                       {"class", "Sensor"},
                                       {"serve_period_ms", 5},
                                       {"remap", {{"readings", "map"}}},
                                       {"params", {{"count", 1}}}});
    described["components"].push_back({{"name", "keeper"},
                                       {"library", "processes_parts"},
                                       {"class", "Observer"},
                                       {"process", "relaying"},
                                       {"remap", {{"readings", "map"}}}});
    Process run(options(described.dump(), {"--clock", clock}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    const json said = report();
    EXPECT_EQ(said["processes"]["relaying"]["restarts"], 1) << clock;
    ASSERT_TRUE(said["results"].contains("first_of_keeper")) << clock;
    EXPECT_EQ(said["results"]["first_of_keeper"], 1) << clock;
    EXPECT_EQ(said["results"]["process_of_keeper"], said["results"]["process_of_relay"]) << clock;
    expect_ledgers(said);
  }
}

TEST_F(ComponentsInProcesses, WriteIntoOneLog) {
  json described = json::parse(application(R"("params": {"log_every": 20})", "", 200));
  described["components"].push_back(
      {{"name", "reader"}, {"library", "processes_parts"}, {"class", "LogReader"}});
  const auto alone = folder_ / "alone.mcap";
  Process in_one(options(described.dump(), {"--clock", "simulated", "--record", alone.string()}));
  ASSERT_EQ(in_one.wait().exit_code, 0) << in_one.errors();
  EXPECT_EQ(report()["results"]["lines_of_relay"], 10);
  const auto log = folder_ / "isolated.mcap";
  Process simulated(options(
      described.dump(), {"--clock", "simulated", "--isolate", "all", "--record", log.string()}));

  EXPECT_EQ(simulated.wait().exit_code, 0) << simulated.errors();

  EXPECT_TRUE(are_equal(alone, log, {"readings", "relayed", "fastcycle/log"}));
  EXPECT_EQ(report()["results"]["lines_of_relay"], 10);
  EXPECT_EQ(report()["results"]["last_line_of_relay"], "reading 200");

  described["components"][0]["params"]["count"] = 215;
  Process live(options(described.dump(), {"--isolate", "all"}));

  EXPECT_EQ(live.wait().exit_code, 0) << live.errors();

  // The last readings give the last line time to come.
  EXPECT_EQ(report()["results"]["lines_of_relay"], 10);
  EXPECT_EQ(report()["results"]["last_line_of_relay"], "reading 200");
}

TEST_F(ComponentsInProcesses, AreAllInATrace) {
  for (const char* clock : {"live", "simulated"}) {
    const auto file = folder_ / (std::string(clock) + ".pftrace");
    Process run(options(
        application(R"("process": "relaying", "params": {"throw_at": 50}, "on_fault": "restart")"),
        {"--clock", clock, "--trace", file.string()}));

    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

    const json traced = report()["trace"];
    EXPECT_EQ(traced["lost"]["activations"], 0) << clock;
    EXPECT_GE(traced["slices"], 600) << clock;  // Those of the relay too,
    EXPECT_GE(traced["flows"], 400) << clock;   // which has arrows from the source.
    const std::string trace = test::read_file(file);
    EXPECT_THAT(trace, HasSubstr("relay: readings")) << clock;
    EXPECT_THAT(trace, HasSubstr("relaying")) << clock;
    EXPECT_THAT(trace, HasSubstr("fault of relay")) << clock;
    EXPECT_THAT(trace, HasSubstr("queue readings → relay")) << clock;
    EXPECT_THAT(trace, HasSubstr("it was asked to")) << clock;
  }
}

TEST_F(ComponentsInProcesses, RunUnderValgrindWithoutAnError) {
  if (std::string_view(FASTCYCLE_SANITIZER) != "none" ||
      !std::filesystem::exists("/usr/bin/valgrind")) {
    GTEST_SKIP() << "this takes valgrind and a build without sanitizers";
  }
  test::ProcessOptions run =
      options(application(R"("process": "relaying")",
                          R"("callback_limit_ms": 0, "lifecycle_limit_ms": 0, )", 20),
              {"--debuggable", "--clock", "simulated", "--load-timeout", "60s"});
  // The dynamic linker compares names word by word, also behind their end.
  const auto linker = folder_.write(
      "suppressions", "{\n  words\n  Memcheck:Addr8\n  fun:strncmp\n  fun:is_dst\n}\n");
  const std::vector<std::string> valgrind = {"-q",
                                             "--leak-check=no",
                                             "--error-exitcode=9",
                                             "--soname-synonyms=somalloc=nouserintercepts",
                                             "--suppressions=" + linker.string(),
                                             run.program.string()};
  run.program = "/usr/bin/valgrind";
  run.arguments.insert(run.arguments.begin(), valgrind.begin(), valgrind.end());
  run.environment = {"FASTCYCLE_POISON=free"};
  Process process(run);

  EXPECT_EQ(process.wait().exit_code, 0) << process.errors();

  const json whole = report();
  EXPECT_EQ(whole["results"]["whole"], 20) << process.errors();
  for (const auto& [name, its] : whole.at("processes").items()) {
    for (const json& link : its.value("links", json::array())) {
      EXPECT_EQ(link["copied"], 0) << name << ": its operator new is not that of the program";
    }
  }
}

TEST_F(ComponentsInProcesses, CannotSubscribeLateToWhatComesFromAnotherOne) {
  Process run(
      options(application(R"("process": "relaying")"), {"--set", "sink.subscribes_late=true"}));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_THAT(run.errors(),
              HasSubstr("topic \"relayed\" comes from \"relay\", which runs in another process: "
                        "subscribe in the constructor"));
}

TEST_F(ComponentsInProcesses, HaveLatencyChainsThatToolsShowWhereverTheyEnd) {
  test::ProcessOptions watched =
      options(application(R"("process": "relaying")",
                          R"("chains": [{"name": "whole", "from": "readings", "to": "relayed",
                                 "deadline_ms": 1000}], )",
                          1'000'000),
              {"--inspect", "--isolate", "all"});
  watched.environment = environment();
  Process run(watched);
  json shown = json::object();
  const auto end = std::chrono::steady_clock::now() + Process::kLongest;
  while (shown.value("count", 0) < 20 && std::chrono::steady_clock::now() < end) {
    const auto [code, text] = ask({"chain", "whole", "--json"});
    const json said = json::parse(code == 0 ? text : "[]", nullptr, false);
    shown = said.is_array() && !said.empty() ? said[0] : json::object();
    std::this_thread::sleep_for(20ms);
  }
  run.send(SIGINT);
  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_GE(shown.value("count", 0), 20) << shown;
  ASSERT_EQ(shown["hops"].size(), 3) << shown;
  EXPECT_EQ(shown["hops"][1]["component"], "relay");
  EXPECT_EQ(shown["hops"][1]["topic"], "relayed");
  EXPECT_EQ(shown["hops"][2]["component"], "sink");
  EXPECT_GT(shown["age_us"]["p50"], 0.0);
  EXPECT_EQ(report()["chains"][0]["hops"].size(), shown["hops"].size()) << report()["chains"];
}

TEST_F(ComponentsInProcesses, AreShownAndSteeredByTools) {
  test::ProcessOptions watched =
      options(application(R"("process": "relaying")", "", 1'000'000),
              {"--inspect", "--inspect-allow", "params", "--inspect-allow", "lifecycle"});
  watched.environment = environment();
  Process run(watched);
  const auto tool = [&](const std::vector<std::string>& words) { return ask(words); };
  const auto relay = [&]() -> json {
    const auto [code, said] = tool({"top", "--json", "--interval", "100ms"});
    const json shown = json::parse(code == 0 ? said : "{}", nullptr, false);
    return shown.contains("components") && shown["components"].size() >= 3 ? shown["components"][1]
                                                                           : json::object();
  };
  const auto wait_until = [&](const auto& is_so) {
    json shown = relay();
    const auto end = std::chrono::steady_clock::now() + Process::kLongest;
    while (!is_so(shown)) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << shown << run.errors();
      shown = relay();
    }
  };
  wait_until([](const json& shown) {
    return shown.value("state", "") == "active" && shown.value("activations", 0) > 10 &&
           shown.contains("callback_us") && shown["callback_us"].is_object();
  });
  EXPECT_EQ(relay()["process"], "relaying");
  const json all = json::parse(tool({"top", "--json", "--interval", "100ms"}).second);
  ASSERT_EQ(all["processes"].size(), 2) << all;
  EXPECT_EQ(all["processes"][0]["name"], "main");
  EXPECT_EQ(all["processes"][0]["pid"], all["pid"]);
  const json& its = all["processes"][1];
  EXPECT_EQ(its["name"], "relaying");
  EXPECT_EQ(its["pid"], test::process_of_session(run.pid(), "relaying"));
  EXPECT_EQ(its["components"], json({"relay"}));
  EXPECT_GT(its["rss_bytes"], 100'000);
  EXPECT_TRUE(its["open_files"].is_number() || geteuid() != 0) << its;
  EXPECT_GT(its["threads"].size(), 1);
  EXPECT_TRUE(its["cpu_percent"].is_number()) << its;
  EXPECT_EQ(relay()["executor"], "pool");
  ASSERT_EQ(relay()["callbacks"].size(), 1) << relay();
  EXPECT_EQ(relay()["callbacks"][0]["name"], "readings");
  EXPECT_GT(relay()["callbacks"][0]["time_us"]["p50"], 0.0);
  EXPECT_THAT(tool({"component", "list"}).second, ContainsRegex("relay .* relaying *\n"));
  EXPECT_THAT(tool({"component", "info", "relay"}).second, ContainsRegex("process +relaying\n"));

  const auto gain = [&] {
    for (const json& param : json::parse(tool({"param", "list", "relay", "--json"}).second)) {
      if (param["name"] == "gain") {
        return param;
      }
    }
    return json();
  };
  EXPECT_EQ(gain()["default"], 1);
  EXPECT_EQ(gain()["from"], "default");
  EXPECT_THAT(tool({"param", "get", "relay.gain"}).second, HasSubstr("1"));
  EXPECT_EQ(tool({"param", "set", "relay.gain=4"}).first, 0);
  EXPECT_EQ(gain()["from"], "changed");
  EXPECT_THAT(tool({"param", "get", "relay.gain"}).second, HasSubstr("4"));
  const auto [code, refused] = tool({"param", "set", "relay.gain=40"});
  EXPECT_EQ(code, 1);
  EXPECT_THAT(refused, HasSubstr("relay.gain"));

  const pid_t relaying = test::process_of_session(run.pid(), "relaying");
  kill(relaying, SIGSTOP);
  const auto [hung, why] = tool({"param", "set", "relay.gain=5"});
  kill(relaying, SIGCONT);
  EXPECT_EQ(hung, 1);
  EXPECT_THAT(why, HasSubstr("no answer within 3 s from process \"relaying\""));
  EXPECT_THAT(tool({"param", "get", "relay.gain"}).second, HasSubstr("4"));

  EXPECT_THAT(tool({"component", "stop", "relay"}).second, HasSubstr("is standby"));
  wait_until([](const json& shown) { return shown.value("state", "") == "standby"; });
  EXPECT_EQ(tool({"component", "stop", "relay"}).first, 1);
  EXPECT_EQ(tool({"component", "start", "relay"}).first, 0);
  EXPECT_EQ(tool({"component", "restart", "relay"}).first, 0);
  wait_until([](const json& shown) { return shown.value("state", "") == "active"; });

  run.send(SIGINT);
  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  EXPECT_EQ(report()["results"]["gain_of_relay"], 4);
}

TEST_F(ComponentsInProcesses, AreShownWithAllTheirSubscriptionsHoweverManyTheyAre) {
  test::ProcessOptions watched =
      options(application(R"("process": "relaying")", "", 1'000'000),
              {"--inspect", "--isolate", "all", "--set", "sink.more_subscribers=170"});
  watched.environment = environment();
  Process run(watched);
  std::size_t shown = 0;
  const auto end = std::chrono::steady_clock::now() + Process::kLongest;
  while (shown < 171 && std::chrono::steady_clock::now() < end) {
    const auto [code, text] = ask({"top", "--json", "--interval", "100ms"});
    const json said = json::parse(code == 0 ? text : "{}", nullptr, false);
    shown = 0;
    for (const json& topic : said.value("topics", json::array())) {
      for (const json& subscriber : topic["subscribers"]) {
        shown += topic["name"] == "readings" && subscriber["component"] == "sink" &&
                         subscriber["latency_us"].is_object()
                     ? 1
                     : 0;
      }
    }
  }
  run.send(SIGINT);
  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  EXPECT_EQ(shown, 171) << run.errors();
}

TEST_F(ComponentsInProcesses, AreReloadedInTheirProcess) {
  const auto log = folder_ / "log.mcap";
  test::ProcessOptions watched =
      options(application(R"("process": "relaying")", "", 1'000'000),
              {"--inspect", "--inspect-allow", "reload", "--record", log.string()});
  watched.environment = environment();
  Process run(watched);
  const auto tool = [&](std::vector<std::string> words) {
    Process asked({.program = FASTCYCLE_PROGRAM,
                   .arguments = words,
                   .folder = folder_.path(),
                   .environment = environment()});
    const int code = asked.wait().exit_code;
    return std::pair(code, asked.output() + asked.errors());
  };
  const auto wait_until = [&](const auto& is_so) {
    const auto end = std::chrono::steady_clock::now() + Process::kLongest;
    for (;;) {
      const auto [code, said] = tool({"component", "info", "relay", "--json"});
      const json shown = json::parse(code == 0 ? said : "{}", nullptr, false);
      if (shown.value("state", "") == "active" && is_so(shown)) {
        return;
      }
      ASSERT_LT(std::chrono::steady_clock::now(), end) << said << run.errors();
    }
  };
  // The same code with other contents, at a place that no application knows.
  const auto file = folder_ / "libother.so";
  std::filesystem::copy_file(std::filesystem::path(FASTCYCLE_PROGRAM).parent_path() /
                                 "../lib/fastcycle/libprocesses_parts.so",
                             file);
  std::ofstream(file, std::ios::app) << "other";
  const auto reload = [&](const std::string& class_name, const std::string& params,
                          const std::string& library = "processes_parts") {
    return tool({"component", "reload", "relay", "--library", library, "--class", class_name,
                 "--params", params});
  };
  wait_until([](const json&) { return true; });

  const auto [refused, why] = reload("Sink", "{}");
  EXPECT_EQ(refused, 1);
  EXPECT_THAT(why, HasSubstr("it no longer publishes \"relayed\""));
  EXPECT_EQ(reload("Relay", R"({"gain": 3})"),
            std::pair(0, std::string("component \"relay\" is active\n")));
  wait_until([](const json& shown) { return shown.value("is_on_probation", false); });
  EXPECT_THAT(tool({"param", "get", "relay.gain"}).second, HasSubstr("3"));
  EXPECT_EQ(tool({"component", "confirm", "relay"}).first, 0);
  const auto [code, said] = reload("Relay", R"({"throws": true, "gain": 5})", file.string());
  EXPECT_EQ(code, 0) << said;
  wait_until([](const json& shown) { return shown.value("rollbacks", 0) == 1; });
  EXPECT_THAT(tool({"param", "get", "relay.gain"}).second, HasSubstr("3"));

  run.send(SIGINT);
  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
  const json made = report();
  EXPECT_EQ(made["results"]["gain_of_relay"], 3);
  EXPECT_EQ(made["components"]["relay"]["reloads"], 2);
  EXPECT_EQ(made["components"]["relay"]["rollbacks"], 1);
  EXPECT_EQ(made["components"]["relay"]["restarts"], 0);
  expect_ledgers(made);

  // The log says where its code became another one.
  const Verified verified = verify(log, folder_);
  EXPECT_EQ(verified.exit_code, 0) << verified.output;
  EXPECT_THAT(verified.components.dump(), HasSubstr("it was reloaded in activation"));
}

/// A source that waits for the slower of two receivers, each in a process of its own.
class CreditsInSimulatedTime : public ComponentsInProcesses {
 protected:
  /// `work_us`: of the slower one, which crashes at a reading.
  [[nodiscard]] static std::string application(const char* source, bool is_trusted, int count,
                                               int work_us, int crash_at = 0) {
    return std::string(R"({"name": "flow", "processes": [{"name": "reading", "trusted": )") +
           (is_trusted ? "true" : "false") +
           R"(}, {"name": "storing", "on_exit": "restart"}, {"name": "copying"}],
           "components": [
             {"name": "store", "library": "processes_parts", "class": "Store",
              "process": "storing", "params": {"work_us": )" +
           std::to_string(work_us) + R"(, "log_at": 400, "crash_at": )" + std::to_string(crash_at) +
           R"(}},
             {"name": "copy", "library": "processes_parts", "class": "Store",
              "process": "copying"},
             {"name": "reader", "library": "processes_parts", "class": ")" +
           source + R"(", "process": "reading", "serve_period_ms": 10, "params": {"count": )" +
           std::to_string(count) + R"(}}]})";
  }
};

struct Flow {
  const char* source;
  bool is_trusted;
};

class CreditsOfComponentsInProcesses : public CreditsInSimulatedTime,
                                       public testing::WithParamInterface<Flow> {};
INSTANTIATE_TEST_SUITE_P(, CreditsOfComponentsInProcesses,
                         testing::Values(Flow{"Reader", true}, Flow{"Reader", false},
                                         Flow{"ThreadReader", true}, Flow{"ThreadReader", false}),
                         [](const auto& its) {
                           return std::string("ofA") + its.param.source +
                                  (its.param.is_trusted ? "" : "ThatIsNotTrusted");
                         });

TEST_P(CreditsOfComponentsInProcesses, LoseNothingWhereTheReceiverIsSlow) {
  Process run(options(application(GetParam().source, GetParam().is_trusted, 1000, 200)));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  EXPECT_EQ(said["topics"]["readings"]["published"], 1000);
  for (const char* receiver : {"store", "copy"}) {
    EXPECT_EQ(said["results"][std::string("received_by_") + receiver], 1000);
    EXPECT_EQ(said["results"][std::string("missing_of_") + receiver], 0);
  }
  expect_ledgers(said);
}

// It has messages then that it will never finish; after its restart it returns credits again.
TEST_P(CreditsOfComponentsInProcesses, AreReturnedAllWhenTheProcessOfTheReceiverEnds) {
  Process run(
      options(application(GetParam().source, GetParam().is_trusted, 1'000'000'000, 100, 300)));
  EXPECT_TRUE(run.wait_for("is restarted")) << run.errors();
  EXPECT_TRUE(run.wait_for("store: it has 400 readings")) << run.errors();
  run.send(SIGINT);

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  EXPECT_EQ(said["processes"]["storing"]["restarts"], 1);
  EXPECT_EQ(said["results"]["missing_of_store"], 0);
  EXPECT_EQ(said["results"]["missing_of_copy"], 0);
  expect_ledgers(said);
}

// Neither knows then what was published before.
TEST_F(CreditsInSimulatedTime, AreNotNeededToCountWhenBothEndsBeginAgain) {
  const std::string faults = R"("processes": [{"name": "reading", "on_exit": "restart"},
      {"name": "storing", "on_exit": "restart"}, {"name": "copying"}],
      "faults": {"list": [{"kind": "slow", "component": "store", "by_ms": 1},
                          {"kind": "crash", "component": "store", "from_s": 0.05},
                          {"kind": "crash", "component": "reader", "from_s": 0.05}]}, )";
  std::string text = application("Reader", true, 600, 0);
  const std::size_t begin = text.find(R"("processes")");
  text.replace(begin, text.find(R"("components")") - begin, faults);
  Process run(options(text, {"--clock", "simulated"}));

  EXPECT_EQ(run.wait().exit_code, 0) << run.errors();

  const json said = report();
  EXPECT_EQ(said["processes"]["reading"]["restarts"], 1);
  EXPECT_EQ(said["processes"]["storing"]["restarts"], 1);
  EXPECT_EQ(said["results"]["received_by_store"], 600);
  for (const json& subscriber : said["topics"]["readings"]["subscribers"]) {
    EXPECT_FALSE(subscriber["component"] == "store" && subscriber["dropped"].contains("process"))
        << subscriber;
  }
  expect_ledgers(said);
}

// With each number of workers, and as in one process.
TEST_F(CreditsInSimulatedTime, AreReturnedInTheSameRoundAsInOneProcess) {
  const std::string text = application("Reader", true, 1000, 0);
  const std::vector<std::string> topics{"readings"};
  const auto log_of = [&](const std::string& name, const std::string& its,
                          const std::string& workers) {
    const auto log = folder_ / (name + ".mcap");
    Process run(
        options(its, {"--clock", "simulated", "--workers", workers, "--record", log.string()}));
    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
    EXPECT_EQ(report()["results"]["received_by_store"], 1000);
    return log;
  };
  const auto one = log_of("one", text, "1");

  EXPECT_TRUE(are_equal(one, log_of("four", text, "4"), topics));
  const std::regex place(R"("process": "\w+",)");
  EXPECT_TRUE(are_equal(one, log_of("together", std::regex_replace(text, place, ""), "1"), topics));
}

TEST_F(ComponentsInProcesses, SayWhatDoesNotGoWithThem) {
  Process run(options(application(
      R"("process": "relaying")",
      R"("topics": {"readings": {"credits": 4}}, "processes": [{"name": "relaying", "standby": true}], )")));

  EXPECT_EQ(run.wait().exit_code, 2);
  EXPECT_THAT(run.errors(), HasSubstr("topic \"readings\" has credits"));
  EXPECT_THAT(run.errors(), HasSubstr("from process \"main\" to \"relaying\""));

  Process many(options(
      R"({"name": "many", "topics": {"readings": {"credits": 20000}}, "components": [
          {"name": "store", "library": "processes_parts", "class": "Store", "process": "storing",
           "subscribers": {"readings": {"depth": 20000}}},
          {"name": "reader", "library": "processes_parts", "class": "Reader",
           "params": {"count": 1}}]})"));

  EXPECT_EQ(many.wait().exit_code, 2);
  EXPECT_THAT(many.errors(), HasSubstr("topic \"readings\" has 20000 credits"));

  Process standby(options(
      application(R"("process": "relaying")",
                  R"("processes": [{"name": "relaying", "trusted": false, "standby": true}], )")));

  EXPECT_EQ(standby.wait().exit_code, 2);
  EXPECT_THAT(standby.errors(),
              HasSubstr("process \"relaying\" is not trusted, and \"relaying.standby\" follows"));

  test::ProcessOptions words = options(
      application(R"("process": "relaying")",
                  R"("processes": [{"name": "relaying", "trusted": false, "standby": true}], )"));
  words.arguments = {"check", words.arguments[1]};
  Process check(words);

  EXPECT_EQ(check.wait().exit_code, 2);
  EXPECT_THAT(check.errors(),
              HasSubstr("process \"relaying\" is not trusted, and \"relaying.standby\" follows"));
}

}  // namespace
}  // namespace fastcycle
