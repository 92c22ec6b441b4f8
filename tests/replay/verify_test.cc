// `fastcycle verify` and `fastcycle debug`, as their users call them.

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fastcycle/version.h"
#include "process/process.h"

namespace fastcycle::replay {
namespace {

using nlohmann::json;
using test::Process;
using testing::HasSubstr;

class Verify : public testing::Test {
 protected:
  int fastcycle(const std::vector<std::string>& words) {
    Process program({.program = FASTCYCLE_PROGRAM, .arguments = words, .folder = folder_.path()});
    const test::Ending& ending = program.wait();
    output_ = program.output();
    errors_ = program.errors();
    return ending.signal != 0 ? 1000 + ending.signal : ending.exit_code;
  }

  /// Records `application` live.
  void record(const std::string& application, std::vector<std::string> more = {}) {
    std::vector<std::string> words = {"run", application, "--quiet", "--record", "live.mcap"};
    words.insert(words.end(), more.begin(), more.end());
    // A memory checker looks at its own process, which a protected one does not allow.
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");
    }
    ASSERT_EQ(fastcycle(words), 0) << errors_;
  }

  /// Counts and adds: `counter` publishes "numbers", `adder` answers on "sums".
  void record_parts() {
    folder_.write("app.json", R"({"name": "parts", "components": [
      {"name": "counter", "library": "launcher_parts", "class": "Counter", "serve_period_ms": 1,
       "params": {"count": 200}},
      {"name": "adder", "library": "launcher_parts", "class": "Adder",
       "subscribers": {"numbers": {"depth": 256}}}]})");
    record((folder_ / "app.json").string());
  }

  [[nodiscard]] json components() const {
    return json::parse(test::read_file(folder_ / "report.json"))["components"];
  }

  [[nodiscard]] json topics() const {
    return json::parse(test::read_file(folder_ / "report.json"))["topics"];
  }

  [[nodiscard]] json topic(const std::string& name) const {
    for (const json& topic : topics()) {
      if (topic["topic"] == name) {
        return topic;
      }
    }
    ADD_FAILURE() << "no topic " << name;
    return {};
  }

  test::Folder folder_;
  std::string output_;
  std::string errors_;
};

TEST_F(Verify, ALiveRunIsEqualWithTheApplicationOfTheLogOrAnother) {
  record_parts();

  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"verify", "live.mcap", "--report", "report.json"},
        {"verify", "live.mcap", "app.json", "--workers", "1", "--report", "report.json"},
        {"verify", "live.mcap", "app.json", "--continue-with", "new", "--report", "report.json"}}) {
    ASSERT_EQ(fastcycle(words), 0) << output_ << errors_;

    EXPECT_EQ(components()["counter"]["outputs"], 200);
    EXPECT_EQ(components()["counter"]["equal"], 200);
    EXPECT_TRUE(components()["counter"]["first_difference"].is_null());
    EXPECT_EQ(components()["adder"]["activations"], components()["adder"]["recorded_activations"]);
    EXPECT_GT(components()["adder"]["outputs"], 0);
    EXPECT_EQ(components()["adder"]["equal"], components()["adder"]["outputs"]);
    EXPECT_THAT(output_, HasSubstr("counter"));
  }
}

TEST_F(Verify, AnotherParamIsADifferenceAndTheFirstOneIsReported) {
  record_parts();

  ASSERT_EQ(fastcycle({"verify", "live.mcap", "app.json", "--set", "counter.burst=2", "--report",
                       "report.json"}),
            3)
      << output_ << errors_;

  EXPECT_THAT(output_, HasSubstr("DIFFERENT"));
  EXPECT_THAT(output_, HasSubstr("by its serve()"));
  const json first = components()["counter"]["first_difference"];
  EXPECT_EQ(first["field"], "messages published");
  EXPECT_EQ(first["recorded"], "1");
  EXPECT_EQ(first["now"], "2");
  EXPECT_EQ(components()["adder"]["differences"], 0);  // It is given what was recorded.
}

TEST_F(Verify, CompareOfARunWithItselfFindsNothing) {
  record_parts();

  ASSERT_EQ(fastcycle({"compare", "live.mcap", "--report", "report.json"}), 0)
      << output_ << errors_;

  for (const json& topic : topics()) {
    EXPECT_EQ(topic["different"], 0) << topic;
    EXPECT_EQ(topic["missing"], 0) << topic;
    EXPECT_EQ(topic["new"], 0) << topic;
    EXPECT_GT(topic["compared"], 0) << topic;
  }
  EXPECT_EQ(topics().size(), 2);
}

TEST_F(Verify, CompareTellsByHowMuchEachFieldChanged) {
  record_parts();

  // Of its 200 numbers it publishes two at once: of its serves from the 101st on there is nothing,
  // and the first of each of the others, number k of the log, is 2k - 1 now.
  ASSERT_EQ(fastcycle({"compare", "live.mcap", "app.json", "--set", "counter.burst=2", "--report",
                       "report.json", "--log", "new.mcap"}),
            3)
      << output_ << errors_;

  const json numbers = topic("numbers");
  EXPECT_EQ(numbers["compared"], 100);
  EXPECT_EQ(numbers["different"], 99);
  EXPECT_EQ(numbers["missing"], 100);
  EXPECT_EQ(numbers["new"], 100);
  ASSERT_EQ(numbers["fields"].size(), 1);
  const json field = numbers["fields"][0];
  EXPECT_EQ(field["field"], "value");
  EXPECT_EQ(field["messages"], 99);
  EXPECT_EQ(field["mean"], 50.0);
  EXPECT_EQ(field["max"], 99.0);
  EXPECT_EQ(field["max_at"]["recorded"], "100");
  EXPECT_EQ(field["max_at"]["now"], "199");
  EXPECT_EQ(topic("sums")["different"], 0);  // It was given what was recorded.
  EXPECT_EQ(fastcycle({"info", "new.mcap"}), 0) << errors_;
  EXPECT_THAT(output_, HasSubstr("numbers"));
  // A file that is there is not replaced unasked.
  EXPECT_NE(fastcycle({"compare", "live.mcap", "app.json", "--log", "new.mcap"}), 0);
  EXPECT_THAT(errors_, HasSubstr("new.mcap"));
}

TEST_F(Verify, ARealDriveIsEqual) {
  record(FASTCYCLE_RAV4, {"--for", "2s"});

  ASSERT_EQ(fastcycle({"verify", "live.mcap", FASTCYCLE_RAV4, "--report", "report.json"}), 0)
      << output_ << errors_;

  for (const char* name : {"can_driver", "gnss_driver", "imu_driver", "vehicle", "radar",
                           "localization", "scoring", "supervision"}) {
    EXPECT_EQ(components()[name]["activations"], components()[name]["recorded_activations"])
        << name;
    EXPECT_EQ(components()[name]["equal"], components()[name]["outputs"]) << name;
  }
  EXPECT_GT(components()["localization"]["outputs"], 50);
}

TEST_F(Verify, OneComponentAloneIsExecuted) {
  record_parts();

  ASSERT_EQ(fastcycle({"verify", "live.mcap", "--component", "adder", "--report", "report.json"}),
            0)
      << output_ << errors_;

  EXPECT_TRUE(components()["adder"]["executed"]);
  EXPECT_FALSE(components()["counter"]["executed"]);
}

TEST_F(Verify, WhoPublishedWhatWasNotRecordedIsExecutedToo) {
  folder_.write("app.json", R"({"name": "parts", "components": [
      {"name": "counter", "library": "launcher_parts", "class": "Counter", "serve_period_ms": 1,
       "params": {"count": 100}},
      {"name": "adder", "library": "launcher_parts", "class": "Adder",
       "subscribers": {"numbers": {"depth": 256}}}]})");
  record((folder_ / "app.json").string(), {"--record-topics", "sums"});

  ASSERT_EQ(fastcycle({"verify", "live.mcap", "--component", "adder", "--report", "report.json"}),
            0)
      << output_ << errors_;

  EXPECT_EQ(components()["adder"]["outputs"], 100);
  EXPECT_EQ(components()["adder"]["equal"], 100);
  EXPECT_FALSE(components()["adder"]["executed_for_others"]);
  EXPECT_TRUE(components()["counter"]["executed_for_others"]);
  EXPECT_THAT(output_, HasSubstr("also executed"));
}

TEST_F(Verify, ALogThatIsCutOffIsExecutedAsFarAsItGoes) {
  record_parts();
  const std::filesystem::path whole = folder_ / "live.mcap";
  const auto size = std::filesystem::file_size(whole);

  int verified = 0;
  for (std::uintmax_t part = 1; part < 20; ++part) {
    const std::filesystem::path cut = folder_ / "cut.mcap";
    std::filesystem::copy_file(whole, cut, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(cut, size * part / 20);
    const int exit_code = fastcycle({"verify", "cut.mcap", "app.json", "--report", "report.json"});
    EXPECT_TRUE(exit_code == 0 || (exit_code == 2 && !errors_.empty()))
        << part << " of 20: " << exit_code << " " << output_ << errors_;
    verified += exit_code == 0 ? 1 : 0;
  }
  EXPECT_GT(verified, 0);
}

TEST_F(Verify, ADumpOfTheFlightRecorderBeginsWithDeclaredState) {
  folder_.write("app.json", R"({"name": "parts", "state_period_s": 0.01,
    "flight_recorder": {"file": "drive.ring", "size_mb": 1, "before_s": 0.1, "after_s": 0.05},
    "components": [
      {"name": "counter", "library": "launcher_parts", "class": "Counter", "serve_period_ms": 1,
       "params": {"count": 600}},
      {"name": "tally", "library": "launcher_parts", "class": "Tally", "params": {"dump_at": 400},
       "subscribers": {"numbers": {"depth": 256}}}]})");
  std::vector<std::string> words = {"run", "app.json", "--quiet"};
  if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
    words.emplace_back("--debuggable");
  }
  ASSERT_EQ(fastcycle(words), 0) << errors_;
  std::string dump;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    if (entry.path().extension() == ".mcap") {
      dump = entry.path().filename().string();
    }
  }
  ASSERT_FALSE(dump.empty()) << errors_;

  ASSERT_EQ(fastcycle({"verify", dump, "--report", "report.json"}), 0) << output_ << errors_;

  const json tally = components()["tally"];
  EXPECT_GT(tally["began_after_activation"], 200);
  EXPECT_GT(tally["outputs"], 20);
  EXPECT_EQ(tally["outputs"], tally["equal"]);
  // The dump may end within its last activation, which publishes two messages at most.
  EXPECT_LE(tally["not_recorded"], 2) << tally.dump();
  EXPECT_FALSE(components()["counter"]["executed"]);
  EXPECT_THAT(components()["counter"]["why"].get<std::string>(), HasSubstr("it declares none"));
}

TEST_F(Verify, ALogBeginsAtTheTimeThatIsAskedFor) {
  folder_.write("app.json", R"({"name": "parts", "state_period_s": 0.02, "components": [
      {"name": "counter", "library": "launcher_parts", "class": "Counter", "serve_period_ms": 1,
       "params": {"count": 300}},
      {"name": "tally", "library": "launcher_parts", "class": "Tally",
       "subscribers": {"numbers": {"depth": 256}}}]})");
  record((folder_ / "app.json").string());

  ASSERT_EQ(fastcycle({"verify", "live.mcap", "--start", "200ms", "--report", "report.json"}), 0)
      << output_ << errors_;

  EXPECT_THAT(output_, HasSubstr("from its state after activation"));
  EXPECT_EQ(components()["counter"]["began_after_activation"], 0);
  const json tally = components()["tally"];
  EXPECT_GT(tally["began_s"], 0.1);
  EXPECT_LE(tally["began_s"], 0.2);
  EXPECT_EQ(tally["outputs"], tally["equal"]);
  EXPECT_EQ(fastcycle({"verify", "live.mcap", "--start", "soon"}), 2);
  EXPECT_THAT(errors_, HasSubstr("--start"));
}

TEST_F(Verify, ALogOfAnEarlierVersionIsReplayedAsItWas) {
  const std::string old = FASTCYCLE_OLD_LOG;
  folder_.write("app.json", R"({"name": "parts", "components": [
      {"name": "counter", "library": "launcher_parts", "class": "Counter", "serve_period_ms": 2,
       "params": {"count": 40}},
      {"name": "adder", "library": "launcher_parts", "class": "Adder",
       "subscribers": {"numbers": {"depth": 256}}}]})");

  ASSERT_EQ(fastcycle({"run", "app.json", "--replay", old, "--replay-into", "adder", "--clock",
                       "simulated", "--quiet", "--report", "replayed.json"}),
            0)
      << errors_;

  const json results = json::parse(test::read_file(folder_ / "replayed.json"))["results"];
  EXPECT_EQ(results["sum"], 820);
  EXPECT_EQ(results["received"], 40);
  // Of what it received, and when: the version that recorded it finds the same.
  EXPECT_EQ(results["hash"], -3190773588186842028);
  EXPECT_EQ(fastcycle({"verify", old, "app.json"}), 2);
  EXPECT_THAT(errors_, HasSubstr("the log was recorded by an earlier version"));
}

TEST_F(Verify, WhatIsWrongIsSaid) {
  record_parts();

  EXPECT_EQ(fastcycle({"verify", "live.mcap", "--component", "ader"}), 2);
  EXPECT_THAT(errors_, HasSubstr("did you mean \"adder\""));
  EXPECT_EQ(fastcycle({"verify", "nowhere.mcap"}), 2);
  EXPECT_THAT(errors_, HasSubstr("nowhere.mcap"));
  EXPECT_EQ(fastcycle({"verify", "live.mcap", "live.mcap"}), 2);
  EXPECT_THAT(errors_, HasSubstr("live.mcap is named twice"));
  EXPECT_EQ(fastcycle({"verify", "app.json"}), 2);
  EXPECT_THAT(errors_, HasSubstr("expects a log"));
  EXPECT_EQ(fastcycle({"verify", "live.mcap", "--workers", "0"}), 2);
  EXPECT_THAT(errors_, HasSubstr("--workers expects a number from 1 to 64"));
}

TEST_F(Verify, DebugNamesTheActivationsThatThereAre) {
  if (std::system("gdb --version > /dev/null 2>&1") != 0) {  // NOLINT
    GTEST_SKIP() << "gdb is not installed";
  }
  record_parts();

  EXPECT_EQ(fastcycle({"debug", "live.mcap", "--component", "adder", "--activation", "100000"}), 2);
  EXPECT_THAT(errors_, HasSubstr("has the activations 1 to"));
}

TEST_F(Verify, DebugStopsBeforeAnActivationAndTheValueIsTheSameEachTime) {
  if (std::system("gdb --version > /dev/null 2>&1") != 0) {  // NOLINT
    GTEST_SKIP() << "gdb is not installed";
  }
  if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
    GTEST_SKIP() << "a memory checker does not run in a debugger";
  }
  record_parts();

  for (int i = 0; i < 3; ++i) {
    // Two of the life cycle, and then one for each number.
    ASSERT_EQ(fastcycle({"debug", "live.mcap", "--component", "counter", "--activation", "103",
                         "--batch", "--ex", "print *object", "--ex", "print activation"}),
              0)
        << output_ << errors_;
    if (output_.find("ptrace") != std::string::npos ||
        errors_.find("ptrace") != std::string::npos) {
      GTEST_SKIP() << "gdb may not start a process here";
    }
    EXPECT_THAT(output_, HasSubstr("published_ = 100}")) << errors_;
    EXPECT_THAT(output_, HasSubstr("$2 = 103\n"));
  }
}

}  // namespace
}  // namespace fastcycle::replay
