// What the key "faults" does to a run.

#include <string>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "campaign/test_runs.h"
#include "fastcycle/version.h"

namespace fastcycle {
namespace {

using nlohmann::json;
using test::Process;
using testing::HasSubstr;
using testing::Not;
using InjectedFaults = test::TrackingRuns;

TEST_F(InjectedFaults, DropTheMessagesThatAreNamed) {
  const json report =
      run(R"({"list": [{"kind": "drop", "topic": "sweeps", "messages": [41, 42]}]})");

  EXPECT_EQ(ending_.exit_code, 0) << errors_;
  EXPECT_EQ(report["results"]["sweeps"], 98);
  EXPECT_EQ(report["results"]["tracks_lost"], 1);
  EXPECT_EQ(ledger_of(report)["dropped"]["injected"], 2);
  EXPECT_EQ(ledger_of(report)["published"], 100);
  EXPECT_EQ(ledger_of(report)["adds_up"], true);
  EXPECT_EQ(report["faults"][0]["count"], 2);
  EXPECT_EQ(report["faults"][0]["messages"], json::array({41, 42}));
}

TEST_F(InjectedFaults, AreReportedAtTheStart) {
  run(R"({"seed": 7, "list": [{"kind": "drop", "topic": "sweeps"}]})");

  EXPECT_THAT(errors_, HasSubstr("faults are injected into this run: 1 (drop_1), seed 7"));
}

TEST_F(InjectedFaults, ActFromTheirBeginToTheirEnd) {
  // Sweep n is published at 0.1 n seconds, the first at the start of the timers or a period later.
  const json report =
      run(R"({"list": [{"kind": "drop", "topic": "sweeps", "from_s": 2.05, "to_s": 3.05}]})");

  EXPECT_EQ(report["faults"][0]["count"], 10);
  EXPECT_EQ(report["results"]["sweeps"], 90);
}

TEST_F(InjectedFaults, WithAProbabilityMeanSomeMessagesAlwaysTheSame) {
  const std::string faults = R"({"seed": 3, "list":
      [{"kind": "drop", "topic": "sweeps", "probability": 0.5}]})";
  const json first = run(faults, {"--workers", "1"});
  const json second = run(faults, {"--workers", "4"});
  const json other = run(R"({"seed": 4, "list":
      [{"kind": "drop", "topic": "sweeps", "probability": 0.5}]})");

  EXPECT_GT(first["faults"][0]["count"].get<int>(), 25);
  EXPECT_LT(first["faults"][0]["count"].get<int>(), 75);
  EXPECT_EQ(first["faults"], second["faults"]);
  EXPECT_NE(first["faults"], other["faults"]);
}

TEST_F(InjectedFaults, DelayMessagesAndThoseBehindThem) {
  const json report = run(R"({"list":
      [{"kind": "delay", "topic": "sweeps", "messages": [50], "by_ms": 250}]})");

  EXPECT_EQ(report["results"]["sweeps"], 100);
  EXPECT_EQ(report["results"]["tracks_lost"], 0);  // In their order.
  EXPECT_NEAR(report["results"]["longest_gap_ms"].get<double>(), 350, 1);
  EXPECT_EQ(ledger_of(report)["adds_up"], true);
}

TEST_F(InjectedFaults, DuplicateMessages) {
  const json report =
      run(R"({"list": [{"kind": "duplicate", "topic": "sweeps", "messages": [50]}]})");

  EXPECT_EQ(report["results"]["sweeps"], 101);
  EXPECT_EQ(ledger_of(report)["published"], 101);
  EXPECT_EQ(ledger_of(report)["adds_up"], true);
}

TEST_F(InjectedFaults, FreezeWhatCameLast) {
  // 10 and 11 have the range of 9: half a metre and a metre more than their own.
  const double sum_m = run(R"({"list": []})")["results"]["range_sum_m"];
  const json report =
      run(R"({"list": [{"kind": "freeze", "topic": "sweeps", "messages": [10, 11]}]})");

  EXPECT_EQ(report["results"]["sweeps"], 100);
  EXPECT_NEAR(report["results"]["range_sum_m"].get<double>(), sum_m + 1.5, 1e-6);
}

TEST_F(InjectedFaults, CorruptAFieldForOneSubscriberAlone) {
  const double sum_m = run(R"({"list": []})")["results"]["range_sum_m"];
  const json value = run(R"({"list": [{"kind": "corrupt", "topic": "sweeps", "messages": [10],
      "field": "objects.range_m", "as": "value", "value": 1095}]})");
  const json stale = run(R"({"list": [{"kind": "corrupt", "topic": "sweeps", "messages": [10],
      "field": "objects.0.range_m", "as": "stale"}]})");
  const json nan = run(R"({"list": [{"kind": "corrupt", "topic": "sweeps", "messages": [10],
      "field": "objects.range_m", "as": "nan", "subscriber": "tracker"}]})");
  const json flipped = run(R"({"list": [{"kind": "corrupt", "topic": "sweeps", "messages": [10],
      "field": "objects.range_m", "as": "bit_flip"}]})");

  EXPECT_NEAR(value["results"]["range_sum_m"].get<double>(), sum_m + 1000, 1e-6);
  EXPECT_NEAR(stale["results"]["range_sum_m"].get<double>(), sum_m + 0.5, 1e-6);
  EXPECT_TRUE(nan["results"]["range_sum_m"].is_null());
  EXPECT_NE(flipped["results"]["range_sum_m"], sum_m);
}

TEST_F(InjectedFaults, ThrowInAComponentAndRestartIt) {
  const json thrown = run(R"({"list": [{"kind": "throw", "component": "tracker", "from_s": 5}]})");
  const json renewed =
      run(R"({"list": [{"kind": "restart", "component": "tracker", "from_s": 5.05}]})");

  EXPECT_EQ(thrown["components"]["tracker"]["state"], "failed");
  EXPECT_THAT(thrown["components"]["tracker"]["fault_texts"][0].get<std::string>(),
              HasSubstr("the injected fault \"throw_1\""));
  EXPECT_EQ(renewed["components"]["tracker"]["state"], "stopped");
  EXPECT_EQ(renewed["results"]["sweeps"], 50);  // Of the second object.
}

TEST_F(InjectedFaults, MakeAComponentSlowInSimulatedTime) {
  const json report = run(R"({"list":
      [{"kind": "slow", "component": "tracker", "by_ms": 80, "from_s": 5, "to_s": 6}]})");

  EXPECT_NEAR(report["results"]["longest_gap_ms"].get<double>(), 180, 1);
  EXPECT_EQ(report["results"]["tracks"], 100);
}

TEST_F(InjectedFaults, ThatCannotBeAreErrorsOfTheConfiguration) {
  run(R"({"list": [
      {"kind": "drop", "topic": "sweep"},
      {"kind": "corrupt", "topic": "sweeps", "field": "objects.range", "as": "nan"},
      {"kind": "corrupt", "topic": "sweeps", "field": "number", "as": "nan"}]})");
  EXPECT_EQ(ending_.exit_code, 2);
  EXPECT_THAT(errors_, HasSubstr("\"drop_1\": no component publishes or subscribes to \"sweep\"; "
                                 "did you mean \"sweeps\"?"));
  EXPECT_THAT(errors_, HasSubstr("campaign_test.Object has no field \"range\""));
  EXPECT_THAT(errors_, HasSubstr("only a double or a float can be \"nan\""));

  run(R"({"list": [{"kind": "delay", "topic": "sweeps"},
                   {"kind": "restart", "component": "traker", "by_ms": 3}]})");
  EXPECT_EQ(ending_.exit_code, 2);
  EXPECT_THAT(errors_, HasSubstr("\"delay\" needs the key \"by_ms\""));
  EXPECT_THAT(errors_, HasSubstr("there is no component \"traker\"; did you mean \"tracker\"?"));
  EXPECT_THAT(errors_, HasSubstr("a \"by_ms\" has no meaning with the kind \"restart\""));
}

TEST_F(InjectedFaults, AreTheSameInSeveralProcesses) {
  const std::string faults = R"({"seed": 3, "list": [
      {"kind": "drop", "topic": "sweeps", "probability": 0.2},
      {"kind": "delay", "topic": "sweeps", "probability": 0.1, "by_ms": 230},
      {"kind": "corrupt", "topic": "tracks", "field": "range_m", "as": "bit_flip",
       "probability": 0.3}]})";
  const json one = run(faults);
  const json several = run(faults, {"--isolate", "tracker"});

  EXPECT_EQ(ending_.exit_code, 0) << errors_;
  EXPECT_EQ(one["results"], several["results"]);
  EXPECT_EQ(one["faults"], several["faults"]);
  EXPECT_EQ(ledger_of(several)["dropped"], ledger_of(one)["dropped"]);
}

TEST_F(InjectedFaults, KillAProcessOnce) {
  const std::string text = R"({"name": "tracking",
      "processes": [{"name": "tracking", "on_exit": "restart"}],
      "components": [
      {"name": "lidar", "library": "campaign_parts", "class": "Lidar", "serve_period_ms": 100,
       "params": {"count": 30}},
      {"name": "tracker", "library": "campaign_parts", "class": "Tracker", "process": "tracking"},
      {"name": "planner", "library": "campaign_parts", "class": "Planner"}],
      "faults": {"list": [
      {"kind": "kill", "process": "tracking", "from_s": 1},
      {"kind": "drop", "topic": "sweeps", "from_s": 2, "to_s": 2.25}]}})";
  folder_.write("killed.json", text);
  for (const char* clock : {"live", "simulated", "simulated"}) {
    Process process(
        program({"run", "killed.json", "--clock", clock, "--report", "report.json", "--quiet"}));
    EXPECT_EQ(process.wait().exit_code, 0) << process.errors();

    const json report = json::parse(test::read_file(folder_ / "report.json"));
    EXPECT_EQ(report["processes"]["tracking"]["restarts"], 1) << clock;
    EXPECT_EQ(report["faults"][0]["count"], 1) << clock;
    EXPECT_EQ(report["faults"][0]["target"], "tracking") << clock;
    // Times count from the start of the application's timers, also in a restarted process.
    const json messages = report["faults"][1]["messages"];
    if (std::string_view(clock) == "simulated") {
      EXPECT_THAT(messages, testing::AnyOf(json({21, 22}), json({20, 21}), json({20, 21, 22}),
                                           json({21, 22, 23})));
    } else {  // The machine may pause.
      ASSERT_FALSE(messages.empty());
      EXPECT_GT(messages.front(), 10);
      EXPECT_LT(messages.back(), 28);
    }
  }

  folder_.write("app.json", kApplication);
  folder_.write("overlay.json",
                R"({"faults": {"list": [{"kind": "kill", "process": "trackin", "from_s": 1}]}})");
  Process wrong(program({"run", "app.json", "--isolate", "tracker", "--overlay", "overlay.json"}));
  EXPECT_EQ(wrong.wait().exit_code, 2);
  EXPECT_THAT(wrong.errors(), HasSubstr("no component runs in a process \"trackin\""));
}

/// A fault of a component or a process that ends its process, which is restarted.
class FaultsOfAProcess : public InjectedFaults {
 protected:
  json report_of(const std::string& fault, const std::string& process, const std::string& clock) {
    folder_.write("ended.json", R"({"name": "tracking",
        "processes": [{"name": "tracking", "on_exit": "restart", )" +
                                    process + R"(}],
        "components": [
        {"name": "lidar", "library": "campaign_parts", "class": "Lidar", "serve_period_ms": 50,
         "params": {"count": 40}},
        {"name": "tracker", "library": "campaign_parts", "class": "Tracker",
         "process": "tracking"},
        {"name": "planner", "library": "campaign_parts", "class": "Planner"}],
        "faults": {"list": [)" + fault +
                                    "]}}");
    Process run(
        program({"run", "ended.json", "--clock", clock, "--report", "report.json", "--quiet"}));
    EXPECT_EQ(run.wait().exit_code, 0) << run.errors();
    errors_ = run.errors();
    return json::parse(test::read_file(folder_ / "report.json"));
  }
};

TEST_F(FaultsOfAProcess, CrashItInACallbackOfTheComponent) {
  for (const char* clock : {"live", "simulated"}) {
    const json report = report_of(R"({"kind": "crash", "component": "tracker", "from_s": 0.5})",
                                  R"("trusted": true)", clock);

    EXPECT_EQ(report["processes"]["tracking"]["restarts"], 1) << clock;
    EXPECT_EQ(report["faults"][0]["count"], 1) << clock;
    EXPECT_THAT(errors_, HasSubstr("crash of component \"tracker\"")) << clock;
    EXPECT_EQ(report["topics"]["sweeps"]["published"], 40) << clock;
  }
}

TEST_F(FaultsOfAProcess, SuspendItUntilItsHeartbeatIsMissed) {
  for (const char* clock : {"live", "simulated"}) {
    const json report = report_of(R"({"kind": "suspend", "process": "tracking", "from_s": 0.5})",
                                  R"("heartbeat_ms": 500)", clock);

    EXPECT_EQ(report["processes"]["tracking"]["restarts"], 1) << clock;
    EXPECT_EQ(report["topics"]["sweeps"]["published"], 40) << clock;
  }
}

TEST_F(FaultsOfAProcess, TakeMemoryUpToItsLimit) {
  if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
    GTEST_SKIP() << "a sanitizer reserves memory itself, and ends the process where there is none";
  }
  for (const char* clock : {"live", "simulated"}) {
    const json report =
        report_of(R"({"kind": "leak", "component": "tracker", "from_s": 0.5, "by_mb": 1000})",
                  R"("memory_mb": 400)", clock);

    EXPECT_EQ(report["components"]["tracker"]["state"], "failed") << clock;
    EXPECT_THAT(report["components"]["tracker"]["fault_texts"].dump(), HasSubstr("bad_alloc"));
    EXPECT_EQ(report["topics"]["sweeps"]["published"], 40) << clock;
  }
}

TEST_F(InjectedFaults, ActInLiveRunsToo) {
  folder_.write("app.json", kApplication);
  folder_.write("overlay.json", R"({"faults": {"list": [
      {"kind": "delay", "topic": "sweeps", "messages": [5], "by_ms": 250},
      {"kind": "drop", "topic": "sweeps", "messages": [9]},
      {"kind": "hang", "component": "planner", "from_s": 0.3, "by_ms": 150}]}})");
  Process process(program({"run", "app.json", "--overlay", "overlay.json", "--set",
                           "lidar.count=12", "--report", "report.json", "--quiet"}));
  EXPECT_EQ(process.wait().exit_code, 0) << process.errors();

  const json report = json::parse(test::read_file(folder_ / "report.json"));
  EXPECT_EQ(report["results"]["sweeps"], 11);
  EXPECT_GE(report["results"]["longest_gap_ms"].get<double>(), 250);
  EXPECT_EQ(ledger_of(report)["dropped"]["injected"], 1);
  EXPECT_EQ(ledger_of(report)["adds_up"], true);
  for (const json& fault : report["faults"]) {
    EXPECT_EQ(fault["count"], 1) << fault;
  }
}

TEST_F(InjectedFaults, AreInTheLogAndVerifiedAsFarAsItIsComplete) {
  run(R"({"seed": 3, "list": [
      {"kind": "drop", "topic": "sweeps", "probability": 0.1},
      {"kind": "delay", "topic": "sweeps", "probability": 0.1, "by_ms": 230},
      {"kind": "duplicate", "topic": "tracks", "probability": 0.1},
      {"kind": "throw", "component": "tracker", "from_s": 8}]})",
      {"--record", "log.mcap"});
  Process verify(program({"verify", "log.mcap"}));
  EXPECT_EQ(verify.wait().exit_code, 0) << verify.output() << verify.errors();
  EXPECT_THAT(verify.errors(), Not(HasSubstr("corrupt")));

  for (const char* on_fault : {"restart", "stop"}) {
    run(R"({"list": [{"kind": "throw", "component": "tracker", "from_s": 5}]}, "components": [
        {"name": "tracker", "on_fault": ")" +
            std::string(on_fault) + R"("}])",
        {"--record", std::string(on_fault) + ".mcap"});
    Process thrown(program({"verify", std::string(on_fault) + ".mcap", "--component", "tracker"}));
    EXPECT_EQ(thrown.wait().exit_code, 0) << thrown.output() << thrown.errors();
  }

  run(R"({"list": [{"kind": "corrupt", "topic": "sweeps", "field": "objects.range_m",
      "as": "nan", "messages": [7]}]})",
      {"--record", "corrupt.mcap"});
  Process corrupt(program({"verify", "corrupt.mcap"}));
  EXPECT_EQ(corrupt.wait().exit_code, 3);
  EXPECT_THAT(corrupt.errors(), HasSubstr("the log contains the published messages"));
}

}  // namespace
}  // namespace fastcycle
