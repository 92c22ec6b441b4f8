#include "config/compose.h"

#include <chrono>
#include <initializer_list>
#include <utility>

#include <gtest/gtest.h>

#include "config/describe.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

/// The files of one application, and the tree that is made of them.
struct ComposeTest : testing::Test {
  Value compose(LoadOptions options = {}) {
    options.file = folder / "app.json";
    const Schema schema({}, problems);
    return Composer(schema, problems).compose(options).value_or(Value());
  }

  // The application with one component `limiter` that has these keys too.
  void write_limiter(const std::string& keys) const {
    folder.write(
        "app.json",
        R"({"name": "demo", "components": [{"name": "limiter", "library": "a")" + keys + "}]}");
  }

  TestFolder folder;
  Problems problems;
};

TEST_F(ComposeTest, IncludedComponentsAndTopicsAreInTheNamespace) {
  folder.write("app.json", R"({"name": "demo", "include":
      [{"file": "sensors/lidar.json", "namespace": "front"},
       {"file": "sensors/lidar.json", "namespace": "rear"}],
      "components": [{"name": "planner", "library": "p"}]})");
  folder.write("sensors/lidar.json", R"({"topics": {"points": {"latched": 1}, "/tf": {"keep": 1}},
      "components": [{"name": "lidar", "library": "l", "namespace": "roof"}]})");

  const Value tree = compose();

  EXPECT_EQ(tree["components"].size(), 3U);
  EXPECT_EQ(tree["components"][0]["namespace"].as_string(), "front/roof");
  EXPECT_EQ(tree["components"][1]["namespace"].as_string(), "rear/roof");
  EXPECT_EQ(tree["components"][2]["name"].as_string(), "planner");
  EXPECT_NE(tree["topics"].find("front/points"), nullptr);
  EXPECT_NE(tree["topics"].find("rear/points"), nullptr);
  EXPECT_NE(text_of(problems).find("the topic \"/tf\" is described twice"), std::string::npos);
}

TEST_F(ComposeTest, NamespacesOfNestedIncludesAreJoined) {
  folder.write("app.json", R"({"include": [{"file": "a.json", "namespace": "car"}]})");
  folder.write("a.json", R"({"include": [{"file": "b.json", "namespace": "front"}]})");
  folder.write("b.json", R"({"topics": {"points": {}, "/map": {}},
                             "components": [{"name": "lidar", "library": "l"}]})");

  const Value tree = compose();

  EXPECT_EQ(tree["components"][0]["namespace"].as_string(), "car/front");
  EXPECT_NE(tree["topics"].find("car/front/points"), nullptr);
  EXPECT_NE(tree["topics"].find("/map"), nullptr);
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, IncludedFilesGetTheirVariables) {
  folder.write("app.json", R"({"variables": {"first_port": 2368}, "include":
      [{"file": "lidar.json", "namespace": "front", "variables": {"port": "${first_port}"}},
       {"file": "lidar.json", "namespace": "rear", "variables": {"port": 2400}}]})");
  folder.write("lidar.json", R"({"variables": {"port": null, "rate_hz": 10}, "components":
      [{"name": "lidar", "library": "l", "params": {"port": "${port}", "hz": "${rate_hz}"}}]})");

  const Value tree = compose();

  EXPECT_EQ(tree["components"][0]["params"].to_text(), R"({"port":2368,"hz":10})");
  EXPECT_EQ(tree["components"][1]["params"].to_text(), R"({"port":2400,"hz":10})");
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, TheIncludingFileGoesBeforeIncludedOnes) {
  folder.write("app.json", R"({"include": [{"file": "a.json"}],
      "shared_params": {"car": {"width_m": 2}}, "on_fault": "stop",
      "components": [{"name": "planner", "library": "p"}]})");
  folder.write("a.json", R"({"shared_params": {"car": {"width_m": 1, "length_m": 4}},
      "on_fault": "restart", "components": [{"name": "lidar", "library": "l"},
                                            {"name": "radar", "library": "r", "on_fault": "stop"}]})");

  const Value tree = compose();

  EXPECT_EQ(tree["shared_params"].to_text(), R"({"car":{"width_m":2,"length_m":4}})");
  EXPECT_EQ(tree["components"][0]["on_fault"].as_string(), "restart");
  EXPECT_EQ(tree["components"][1]["on_fault"].as_string(), "stop");
  EXPECT_EQ(tree["components"][2].find("on_fault"), nullptr);
  EXPECT_EQ(tree["on_fault"].as_string(), "stop");
}

TEST_F(ComposeTest, AnIncludedFileSaysHowItsComponentsStartAndRestart) {
  folder.write("app.json", R"({"name": "app", "include": [{"file": "a.json", "namespace": "front"}],
      "restart": {"limit": 1}, "components": [{"name": "planner", "library": "p"}]})");
  folder.write("a.json", R"({"restart": {"limit": 7, "back_off_ms": 50}, "start_timeout_ms": 200,
      "components": [{"name": "lidar", "library": "l", "after": ["radar", "/planner"]},
                     {"name": "radar", "library": "r", "restart": {"limit": 9, "then": "process"}}]})");

  const ApplicationDescription app = describe(compose());

  EXPECT_EQ(app.components[0].restart.limit, 7U);
  EXPECT_EQ(app.components[0].start_timeout, std::chrono::milliseconds(200));
  EXPECT_EQ(app.components[0].after, (std::vector<std::string>{"front/radar", "planner"}));
  EXPECT_EQ(app.components[1].restart.limit, 9U);
  EXPECT_EQ(app.components[1].restart.back_off, std::chrono::milliseconds(50));
  EXPECT_EQ(app.components[0].restart.then, AfterRestarts::kStay);
  EXPECT_EQ(app.components[1].restart.then, AfterRestarts::kProcess);
  EXPECT_EQ(app.components[2].restart.limit, 1U);
  EXPECT_EQ(app.components[2].start_timeout.count(), 0);
  EXPECT_EQ(start_order(app), (std::vector<std::size_t>{1, 2, 0}));
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, AnIncludedFileSaysHowLongItsComponentsMayTake) {
  folder.write("app.json", R"({"name": "app", "include": [{"file": "a.json"}], "on_hang": "stop",
      "components": [{"name": "planner", "library": "p", "lifecycle_limit_ms": 0}]})");
  folder.write("a.json", R"({"callback_limit_ms": 200,
      "components": [{"name": "lidar", "library": "l"},
                     {"name": "radar", "library": "r", "callback_limit_ms": 50.5,
                      "on_hang": "report"}]})");

  const ApplicationDescription app = describe(compose());

  EXPECT_EQ(app.components[0].hang.callback_limit, std::chrono::milliseconds(200));
  EXPECT_EQ(app.components[0].hang.lifecycle_limit, std::chrono::seconds(5));
  EXPECT_EQ(app.components[0].hang.on_hang, OnHang::kStop);
  EXPECT_EQ(app.components[1].hang.callback_limit, std::chrono::microseconds(50'500));
  EXPECT_EQ(app.components[1].hang.on_hang, OnHang::kReport);
  EXPECT_EQ(app.components[2].hang.callback_limit, std::chrono::milliseconds(750));
  EXPECT_EQ(app.components[2].hang.lifecycle_limit.count(), 0);
  EXPECT_EQ(app.components[2].hang.on_hang, OnHang::kStop);
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, ModesAreOfTheFileThatIsRunAndOfOverlays) {
  folder.write("app.json", R"({"name": "app", "include": [{"file": "a.json"}],
      "modes": {"one": {"components": ["a"]}, "two": {}}, "initial_mode": "one",
      "components": [{"name": "a", "library": "l"}]})");
  folder.write("a.json", R"({"modes": {"three": {}}, "initial_mode": "three"})");
  const auto overlay = folder.write("over.json", R"({"initial_mode": "two",
      "modes": {"one": null, "two": {"executors": ["x"]}}})");

  const ApplicationDescription app = describe(compose({.file = {}, .overlays = {overlay}}));

  ASSERT_EQ(app.modes.size(), 1U);
  EXPECT_EQ(app.modes[0].name, "two");
  EXPECT_EQ(app.modes[0].executors, std::vector<std::string>{"x"});
  EXPECT_EQ(app.initial_mode, "two");
  EXPECT_NE(text_of(problems).find("only the main application file may define modes"),
            std::string::npos);
  EXPECT_NE(text_of(problems).find("only the main application file may define the initial mode"),
            std::string::npos);
}

TEST_F(ComposeTest, FilesOfTheLiveServerAreRelativeToTheirFile) {
  folder.write("app.json", R"({"name": "app", "components": [{"name": "a", "library": "l"}],
      "live": {"token_file": "keys/token", "certificate": "/etc/cert.pem", "key": "key.pem"}})");

  const ApplicationDescription app = describe(compose());

  ASSERT_TRUE(app.live.has_value());
  EXPECT_EQ(app.live->token_file, (folder.path() / "keys/token").string());
  EXPECT_EQ(app.live->certificate, "/etc/cert.pem");
  EXPECT_EQ(app.live->key, (folder.path() / "key.pem").string());
}

TEST_F(ComposeTest, ChainsAreMergedByTheirName) {
  folder.write("app.json", R"({"name": "app", "modes": {"safe": {}}, "initial_mode": "safe",
      "chains": [{"name": "braking", "from": "/lidar", "to": "brake", "deadline_ms": 100}],
      "components": [{"name": "a", "library": "l"}]})");
  const auto overlay = folder.write("over.json", R"({"chains": [
      {"name": "braking", "deadline_ms": 0.5, "on_breach": "degrade", "mode": "safe"},
      {"name": "steering", "from": "camera", "to": "steer", "deadline_ms": 20,
       "on_breach": "drop"}]})");

  const ApplicationDescription app = describe(compose({.file = {}, .overlays = {overlay}}));

  EXPECT_EQ(text_of(problems), "");
  ASSERT_EQ(app.chains.size(), 2U);
  EXPECT_EQ(app.chains[0].name, "braking");
  EXPECT_EQ(app.chains[0].from, "lidar");
  EXPECT_EQ(app.chains[0].to, "brake");
  EXPECT_EQ(app.chains[0].deadline, std::chrono::microseconds(500));
  EXPECT_EQ(app.chains[0].on_breach, OnBreach::kDegrade);
  EXPECT_EQ(app.chains[0].mode, "safe");
  EXPECT_EQ(app.chains[1].name, "steering");
  EXPECT_EQ(app.chains[1].on_breach, OnBreach::kDrop);
}

TEST_F(ComposeTest, IncludesThatMultiplyAreStopped) {
  const std::string twice = R"([{"file": "next.json", "namespace": "a"},
                                {"file": "next.json", "namespace": "b"}])";
  folder.write("app.json", "{\"include\": " + twice + "}");
  for (int i = 0; i < 16; ++i) {
    std::string next = twice;
    const std::string name = i == 0 ? "next.json" : "next" + std::to_string(i) + ".json";
    for (std::size_t at = 0; (at = next.find("next.json", at)) != std::string::npos; at += 5) {
      next.replace(at, 9, "next" + std::to_string(i + 1) + ".json");
    }
    folder.write(name, "{\"include\": " + next + "}");
  }

  (void)compose();

  EXPECT_NE(text_of(problems).find("the application has more than 1000 files"), std::string::npos);
}

TEST_F(ComposeTest, WhatStandsInTheApplicationGoesBeforeTheComponentsFile) {
  folder.write("parts/limiter.json", R"({"$schema": "x", "serve_period_ms": 10,
      "params": {"limit_mps": 13.9, "map": "town.osm", "limits": {"jerk": 1, "snap": 2}}})");
  write_limiter(R"(, "file": "parts/limiter.json", "params": {"limit_mps": 20,
                    "limits": {"jerk": 3}})");

  const Value tree = compose();

  const Value& limiter = tree["components"][0];
  EXPECT_EQ(limiter["params"].to_text(),
            R"({"limit_mps":20,"map":"town.osm","limits":{"jerk":3,"snap":2}})");
  EXPECT_EQ(limiter["params"]["map"].as_path(), folder / "parts/town.osm");
  EXPECT_EQ(limiter["serve_period_ms"].place().file, (folder / "parts/limiter.json").string());
  EXPECT_EQ(limiter.find("file"), nullptr);
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, OverlaysMergeComponentsByTheirFullName) {
  folder.write("app.json", R"({"executors": [{"name": "fast", "threads": 2}],
      "topics": {"speed": {"latched": 1}}, "components":
      [{"name": "limiter", "library": "a", "namespace": "front", "params": {"x": 1, "y": 2}},
       {"name": "limiter", "library": "a", "params": {"x": 1}}]})");
  const auto overlay = folder.write("car.json", R"({
      "executors": [{"name": "fast", "cpus": [1]}, {"name": "slow"}],
      "topics": {"/speed": {"keep": 2}, "map": {"latched": 1}},
      "components": [{"name": "front/limiter", "params": {"x": 7, "y": null, "z": 3}},
                     {"name": "logger", "library": "l"}]})");

  const Value tree = compose({.file = {}, .overlays = {overlay}});

  EXPECT_EQ(tree["components"][0]["params"].to_text(), R"({"x":7,"z":3})");
  EXPECT_EQ(tree["components"][1]["params"].to_text(), R"({"x":1})");
  EXPECT_EQ(tree["components"][2]["name"].as_string(), "logger");
  EXPECT_EQ(tree["executors"].to_text(),
            R"([{"name":"fast","threads":2,"cpus":[1]},{"name":"slow"}])");
  EXPECT_EQ(tree["topics"].to_text(), R"({"speed":{"latched":1,"keep":2},"map":{"latched":1}})");
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, OverlaysGoInTheirOrderAndDelete) {
  folder.write("app.json", R"({"shared_params": {"a": 1}, "library_path": ["lib"], "components":
      [{"name": "limiter", "library": "a", "params": {"x": 1}},
       {"name": "planner", "library": "p"}]})");
  const auto first = folder.write("1.json", R"({"shared_params": null, "components":
      [{"name": "planner", "library": null}, {"name": "limiter", "params": {"x": 2}}]})");
  const auto second = folder.write("2.json", R"({"library_path": ["other"], "components":
      [{"name": "limiter", "params": {"x": 3}}]})");

  const Value tree = compose({.file = {}, .overlays = {first, second}});

  EXPECT_EQ(tree.find("shared_params"), nullptr);
  EXPECT_EQ(tree["library_path"].to_text(), R"(["other"])");
  EXPECT_EQ(tree["components"].to_text(), R"([{"name":"limiter","library":"a","params":{"x":3}}])");
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, OnlyTheFileThatIsRunAndOverlaysSayHowOftenTheStatusComes) {
  folder.write("app.json", R"({"include": [{"file": "a.json"}], "status_period_ms": 500})");
  folder.write("a.json", R"({"components": [{"name": "lidar", "library": "l"}]})");
  const auto overlay = folder.write("car.json", R"({"status_period_ms": 250})");

  EXPECT_EQ(compose()["status_period_ms"].to_text(), "500");
  EXPECT_EQ(compose({.file = {}, .overlays = {overlay}})["status_period_ms"].to_text(), "250");
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);

  folder.write("a.json", R"({"status_period_ms": 100})");
  (void)compose();
  EXPECT_NE(
      text_of(problems).find("a.json:1: /status_period_ms: only the main application file may "
                             "define the period of the status"),
      std::string::npos)
      << text_of(problems);
}

TEST_F(ComposeTest, TracesAreOfTheFileThatIsRunAndOfOverlays) {
  folder.write("app.json",
               R"({"name": "app", "components": [{"name": "planner", "library": "p"}]})");
  folder.write("traced.json", R"({"trace": {}})");
  folder.write("more.json", R"({"trace": {"file": "a.pftrace", "buffer_mb": 50}})");
  folder.write("less.json", R"({"trace": {"buffer_mb": null}})");
  folder.write("none.json", R"({"trace": null})");
  const auto described = [this](std::initializer_list<const char*> overlays) {
    LoadOptions options;
    for (const char* const overlay : overlays) {
      options.overlays.push_back(folder / overlay);
    }
    return describe(compose(std::move(options))).trace;
  };

  EXPECT_FALSE(described({}));
  const auto empty = described({"traced.json"});
  ASSERT_TRUE(empty);
  EXPECT_EQ(empty->file, "");
  EXPECT_EQ(empty->buffer_bytes, 16'000'000U);
  const auto whole = described({"traced.json", "more.json"});
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->file, folder / "a.pftrace");
  EXPECT_EQ(whole->buffer_bytes, 50'000'000U);
  EXPECT_EQ(described({"more.json", "less.json"})->buffer_bytes, 16'000'000U);
  EXPECT_FALSE(described({"more.json", "none.json"}));
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, RecordingsThatSayNothingMoreAreThere) {
  folder.write("app.json", R"({"name": "app", "record": {}, "flight_recorder": {},
      "components": [{"name": "planner", "library": "p"}]})");
  const auto none = folder.write("none.json", R"({"record": null, "flight_recorder": null})");
  const auto some = folder.write("some.json", R"({"record": {"sync_ms": 5}})");

  const ApplicationDescription plain = describe(compose());
  ASSERT_TRUE(plain.record);
  EXPECT_EQ(plain.record->file, "");
  EXPECT_TRUE(plain.flight_recorder);
  EXPECT_EQ(describe(compose({.file = {}, .overlays = {some}})).record->sync_interval,
            std::chrono::milliseconds(5));
  const ApplicationDescription less = describe(compose({.file = {}, .overlays = {some, none}}));
  EXPECT_FALSE(less.record);
  EXPECT_FALSE(less.flight_recorder);
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, OverlaysGiveVariablesAndOptionsGoBeforeThem) {
  folder.write("app.json", R"({"variables": {"a": 1, "b": 1, "c": 1}, "components":
      [{"name": "limiter", "library": "l", "params": {"v": ["${a}", "${b}", "${c}"]}}]})");
  const auto overlay = folder.write("car.json", R"({"variables": {"b": 2, "c": 2}})");

  const Value tree = compose({.file = {}, .overlays = {overlay}, .variables = {"c=3"}});

  EXPECT_EQ(tree["components"][0]["params"]["v"].to_text(), "[1,2,3]");
}

TEST_F(ComposeTest, SetsReachNestedParams) {
  write_limiter(R"(, "namespace": "front", "params": {"limit_mps": 22.2, "limits": {"jerk": 1}})");

  const Value tree =
      compose({.file = {},
               .sets = {"front/limiter.limit_mps=20", "front/limiter.limits.jerk=3",
                        "front/limiter.limits.new.deep=[1,2]", "front/limiter.text=a=b c"}});

  EXPECT_EQ(tree["components"][0]["params"].to_text(),
            R"({"limit_mps":20,"limits":{"jerk":3,"new":{"deep":[1,2]}},"text":"a=b c"})");
  EXPECT_EQ(to_string(tree["components"][0]["params"]["limit_mps"].place()),
            "--set front/limiter.limit_mps=20");
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(ComposeTest, SetsGoBeforeOverlaysAndWorkWithoutParams) {
  write_limiter("");
  const auto overlay =
      folder.write("car.json", R"({"components": [{"name": "limiter", "params": {"x": 1}}]})");

  const Value tree =
      compose({.file = {}, .overlays = {overlay}, .sets = {"limiter.x=2", "limiter.y=null"}});

  EXPECT_EQ(tree["components"][0]["params"].to_text(), R"({"x":2})");
  EXPECT_NE(text_of(problems).find("null deletes \"y\""), std::string::npos);
}

TEST_F(ComposeTest, ProcessesComeFromIncludesAndAreMergedByTheirName) {
  folder.write("app.json", R"({"include": [{"file": "lidar.json", "namespace": "front"}],
      "processes": [{"name": "planning"}], "components":
      [{"name": "planner", "library": "p", "process": "planning"}]})");
  folder.write("lidar.json", R"({"processes": [{"name": "sensing", "cpus": [0], "memory_mb": 64}],
      "components": [{"name": "lidar", "library": "l", "file": "parts/lidar.json"}]})");
  folder.write("parts/lidar.json", R"({"process": "sensing"})");
  const auto overlay = folder.write("car.json", R"({
      "processes": [{"name": "sensing", "cpus": null, "sandbox": {"read": ["maps"]}},
                    {"name": "control", "on_exit": "restart"}],
      "components": [{"name": "planner", "process": null}]})");

  const Value tree = compose({.file = {}, .overlays = {overlay}});

  EXPECT_EQ(tree["processes"].to_text(),
            R"([{"name":"sensing","memory_mb":64,"sandbox":{"read":["maps"]}},)"
            R"({"name":"planning"},{"name":"control","on_exit":"restart"}])");
  EXPECT_EQ(tree["components"][0]["process"].as_string(), "sensing")
      << "processes are in no namespace";
  EXPECT_EQ(tree["components"][1].find("process"), nullptr);
  EXPECT_EQ(tree["processes"][0]["sandbox"]["read"][0].as_path(), folder / "maps");
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);

  const auto none = folder.write("none.json", R"({"processes": null})");
  EXPECT_EQ(compose({.file = {}, .overlays = {overlay, none}}).find("processes"), nullptr);
}

TEST_F(ComposeTest, IsolatedComponentsGetAProcessOfTheirNameUnlessTheyHaveOne) {
  folder.write("app.json", R"({"components": [
      {"name": "lidar", "library": "l", "namespace": "front"},
      {"name": "lidar", "library": "l", "namespace": "rear/left"},
      {"name": "true", "library": "l"},
      {"name": "planner", "library": "p", "process": "planning"},
      {"name": "driver", "library": "p", "process": "main"},
      {"name": "control", "library": "c"}]})");
  const auto processes = [&](std::vector<std::string> isolated) {
    std::string text;
    const Value tree = compose({.file = {}, .isolated = std::move(isolated)});
    for (const Value& component : tree["components"].items()) {
      const Value* process = component.find("process");
      text += (process == nullptr ? "-" : process->as_string()) + ' ';
    }
    return text;
  };

  EXPECT_EQ(processes({}), "- - - planning main - ");
  EXPECT_EQ(processes({"control", "true"}), "- - true planning main control ");
  EXPECT_EQ(processes({"front/lidar"}), "front/lidar - - planning main - ");
  EXPECT_EQ(processes({"**/lidar"}), "front/lidar rear/left/lidar - planning main - ");
  EXPECT_EQ(processes({"control", "all"}),
            "front/lidar rear/left/lidar true planning main control ");
  EXPECT_EQ(text_of(problems), "");
  EXPECT_EQ(
      to_string(compose({.file = {}, .isolated = {"c*"}})["components"][5]["process"].place()),
      "--isolate c*");
}

TEST_F(ComposeTest, AnIsolatedComponentGetsTheProcessThatIsDescribedForIt) {
  folder.write("app.json", R"({"processes": [{"name": "lidar", "on_exit": "restart"}],
      "components": [{"name": "lidar", "library": "l"}]})");

  const ApplicationDescription app = describe(compose({.file = {}, .isolated = {"lidar"}}));

  ASSERT_EQ(app.processes.size(), 1U);
  EXPECT_EQ(app.processes[0].on_exit, OnExit::kRestart);
  EXPECT_EQ(app.components[0].process, "lidar");
  EXPECT_EQ(text_of(problems), "");
}

TEST_F(ComposeTest, AComponentWithAStandbyGetsAProcessOfItsOwnName) {
  folder.write("app.json", R"({"processes": [{"name": "sensing", "heartbeat_ms": 20}],
      "components": [{"name": "planner", "library": "p", "standby": true},
                     {"name": "lidar", "library": "l", "process": "sensing", "standby": true},
                     {"name": "radar", "library": "r", "process": "sensing"},
                     {"name": "camera", "library": "c"}]})");

  const ApplicationDescription app = describe(compose({.file = {}}));

  ASSERT_EQ(app.processes.size(), 2U);
  EXPECT_EQ(app.components[0].process, "planner");
  EXPECT_EQ(app.components[3].process, "");
  for (const ProcessDescription& process : app.processes) {
    EXPECT_TRUE(process.has_standby) << process.name;
    EXPECT_EQ(process.on_exit, OnExit::kRestart) << process.name;
  }
  EXPECT_EQ(app.processes[0].heartbeat, std::chrono::milliseconds(20));
  EXPECT_EQ(app.processes[1].heartbeat, std::chrono::milliseconds(100));
}

TEST_F(ComposeTest, ShadowsAreNamedByTheirNumberUnlessTheyHaveAName) {
  folder.write("app.json", R"({"components": [{"name": "planner", "library": "p"}],
      "shadow": [{"of": "planner"}, {"of": "planner", "name": "next", "library": "q",
                  "params": {"horizon_s": 8}}]})");

  const ApplicationDescription app = describe(compose({.file = {}}));

  ASSERT_EQ(app.shadows.size(), 2U);
  EXPECT_EQ(app.shadows[0].name, "shadow_1");
  EXPECT_EQ(app.shadows[0].library, "");
  EXPECT_EQ(app.shadows[1].name, "next");
  EXPECT_EQ(app.shadows[1].library, "q");
  EXPECT_EQ(app.shadows[1].params["horizon_s"].as_int64(), 8);
}

TEST_F(ComposeTest, AComponentThatIsNamedToBeIsolatedAndStaysIsAWarning) {
  folder.write("app.json", R"({"components": [
      {"name": "lidar", "library": "l", "process": "sensing"}]})");

  (void)compose({.file = {}, .isolated = {"all", "l*", "lidar"}});

  EXPECT_EQ(text_of(problems),
            "--isolate lidar: warning: the component \"lidar\" stays in the process that it names, "
            "\"sensing\"\n");
}

TEST_F(ComposeTest, SetsWithAThousandDotsAreRefused) {
  write_limiter("");
  std::string name = "limiter";
  for (int i = 0; i < 50'000; ++i) {
    name += ".a";
  }

  (void)compose({.file = {}, .sets = {name + "=1", "limiter.a=\xff"}});

  EXPECT_NE(text_of(problems).find("more than 64 parts"), std::string::npos);
  EXPECT_NE(text_of(problems).find("the option is not UTF-8"), std::string::npos);
}

}  // namespace
}  // namespace fastcycle::config
