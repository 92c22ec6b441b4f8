#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fastcycle/version.h"
#include "process/process.h"

namespace fastcycle::live {
namespace {

using nlohmann::json;
using test::Process;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using namespace std::chrono_literals;

constexpr const char* kComponents = R"(
  "components": [
    {"name": "sensor", "library": "live_parts", "class": "Sensor", "serve_period_ms": 5},
    {"name": "filter", "library": "live_parts", "class": "Filter"},
    {"name": "display", "library": "live_parts", "class": "Display"}])";
constexpr const char* kModes = R"(
  "modes": {"nominal": {"components": ["filter"]}, "blind": {}}, "initial_mode": "nominal",)";
constexpr const char* kAllowAll = R"({"allow": ["params", "publish", "lifecycle"]})";

/// Applications that run, in a folder that holds their sockets too, and what came of the last
/// command.
class LiveCommands : public testing::Test {
 protected:
  /// Starts an application, and waits until it may be looked at.
  Process& start(const std::string& name = "watched", const std::string& inspect = kAllowAll,
                 const std::string& more = "") {
    const auto file =
        folder_.write(name + ".json", "{\"name\": \"" + name + "\", \"inspect\": " + inspect + "," +
                                          more + kComponents + "}");
    std::vector<std::string> words{"run", file.string(), "--quiet"};
    // A memory checker looks at its own process, which a protected one does not allow.
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");
    }
    running_.push_back(std::make_unique<Process>(options(words)));
    while (!is_listed(name)) {
      std::this_thread::sleep_for(10ms);
      if (std::chrono::steady_clock::now() > limit_) {
        ADD_FAILURE() << name << " does not run: " << running_.back()->errors();
        break;
      }
    }
    return *running_.back();
  }

  /// Whether `name` runs, and has published something.
  bool is_listed(const std::string& name) {
    if (command({"topic", "list", "--json", "--app", name}) != 0) {
      return false;
    }
    for (const json& topic : json::parse(output_)) {
      if (topic["name"] == "sensor/filtered" && topic["published"] > 3) {
        return true;
      }
    }
    return false;
  }

  [[nodiscard]] test::ProcessOptions options(const std::vector<std::string>& words) const {
    return {.program = FASTCYCLE_PROGRAM,
            .arguments = words,
            .folder = folder_.path(),
            .environment = {"XDG_RUNTIME_DIR=" + folder_.path().string()}};
  }

  /// Runs a command to its end. Returns the exit code; 1000 + the number of the signal that ended
  /// it.
  int command(const std::vector<std::string>& words) {
    Process program(options(words));
    return take(program);
  }

  int take(Process& program) {
    const test::Ending& ending = program.wait();
    output_ = program.output();
    errors_ = program.errors();
    return ending.signal != 0 ? 1000 + ending.signal : ending.exit_code;
  }

  /// What a command says with `--json`.
  json json_of(std::vector<std::string> words) {
    words.emplace_back("--json");
    EXPECT_EQ(command(words), 0) << errors_;
    const json said = json::parse(output_, nullptr, false);
    EXPECT_FALSE(said.is_discarded()) << output_;
    return said;
  }

  /// The lines of what was printed, each JSON.
  [[nodiscard]] std::vector<json> json_lines() const {
    std::vector<json> lines;
    std::istringstream stream(output_);
    for (std::string line; std::getline(stream, line);) {
      lines.push_back(json::parse(line, nullptr, false));
      EXPECT_FALSE(lines.back().is_discarded()) << line;
    }
    return lines;
  }

  const std::chrono::steady_clock::time_point limit_ =
      std::chrono::steady_clock::now() + Process::kLongest;
  test::Folder folder_;
  std::vector<std::unique_ptr<Process>> running_;
  std::string output_;
  std::string errors_;
};

// ---- Which application ----

TEST_F(LiveCommands, SayWhatToDoWhereNoApplicationRuns) {
  EXPECT_EQ(command({"list"}), 0) << errors_;
  EXPECT_THAT(output_, HasSubstr("--inspect"));
  EXPECT_EQ(json_of({"list"}), json::array());

  EXPECT_EQ(command({"topic", "list"}), 1);
  EXPECT_THAT(errors_, AllOf(StartsWith("fastcycle topic list: "), HasSubstr("--inspect")));
  EXPECT_EQ(output_, "");
}

TEST_F(LiveCommands, AskWhichOfTwoApplicationsIsMeant) {
  start("front", "true");
  start("rear", "true", kModes);

  EXPECT_EQ(command({"list"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("front"), HasSubstr("rear"), HasSubstr("nominal")));
  const json listed = json_of({"list"});
  ASSERT_EQ(listed.size(), 2U);
  EXPECT_EQ(listed[0]["name"], "front");
  EXPECT_EQ(listed[0]["pid"], running_[0]->pid());
  EXPECT_EQ(listed[1]["mode"], "nominal");

  EXPECT_EQ(command({"component", "list"}), 1);
  EXPECT_THAT(errors_, AllOf(HasSubstr("front, rear"), HasSubstr("--app ")));
  EXPECT_EQ(command({"component", "list", "--app", "rear"}), 0) << errors_;
  EXPECT_EQ(command({"component", "list", "--app", "reer"}), 1);
  EXPECT_THAT(errors_, HasSubstr("front, rear"));
}

// ---- Topics ----

TEST_F(LiveCommands, TopicListAndInfoShowWhatFlows) {
  start();

  EXPECT_EQ(command({"topic", "list"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("sensor/readings"), HasSubstr("live.Reading"),
                             HasSubstr("display"), HasSubstr("Hz")));
  EXPECT_EQ(json_of({"topic", "list", "sensor/*"}).size(), 2U);

  EXPECT_EQ(command({"topic", "info", "sensor/readings"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("published by"), HasSubstr("subscribed by"),
                             HasSubstr("filter"), HasSubstr("sensor")));
  const json topic = json_of({"topic", "info", "sensor/readings"});
  EXPECT_EQ(topic["type"], "live.Reading");
  EXPECT_GT(topic["published"], 0);
  EXPECT_EQ(topic["subscribers"][0]["component"], "filter");

  for (const std::string word : {"info", "echo", "hz", "list"}) {
    EXPECT_EQ(command({"topic", word, "sensor/raedings"}), 2);
    EXPECT_THAT(errors_, HasSubstr("did you mean \"sensor/readings\"?"));
  }
}

TEST_F(LiveCommands, EchoPrintsMessagesAndLeavesOutLargeFields) {
  start();

  EXPECT_EQ(command({"topic", "echo", "sensor/readings", "--count", "2"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("  sensor/readings  #"), HasSubstr("text: \"reading\""),
                             HasSubstr("image: <1000 bytes>"), HasSubstr("… 95 more]")));

  EXPECT_EQ(command({"topic", "echo", "sensor/**", "--count", "5", "--json"}), 0) << errors_;
  const std::vector<json> lines = json_lines();
  ASSERT_EQ(lines.size(), 5U);
  for (const json& line : lines) {
    EXPECT_GT(line["sequence"], 0);
    EXPECT_GT(line["publish_time_ns"], 0);
    if (line["topic"] == "sensor/readings") {
      EXPECT_EQ(line["publisher"], "sensor");
      EXPECT_EQ(line["elided"].size(), 2U);
    }
  }

  EXPECT_EQ(command({"topic", "echo", "sensor/readings", "--once", "--full", "--json"}), 0)
      << errors_;
  ASSERT_EQ(json_lines().size(), 1U);
  EXPECT_EQ(json_lines()[0]["data"]["ranges"].size(), 100U);
  EXPECT_FALSE(json_lines()[0].contains("elided"));
}

TEST_F(LiveCommands, EchoEndsInOrderOnCtrlC) {
  start();
  Process echo(options({"topic", "echo", "sensor/readings"}));
  ASSERT_TRUE(echo.wait_for("#")) << echo.errors();

  echo.send(SIGINT);

  EXPECT_EQ(take(echo), 0) << errors_;
  EXPECT_EQ(errors_, "");
}

TEST_F(LiveCommands, EchoEndsQuietlyWhenNobodyReads) {
  start();
  const std::string line = "'" + std::string(FASTCYCLE_PROGRAM) +
                           "' topic echo sensor/readings | head -1; echo \"code ${PIPESTATUS[0]}\"";
  test::ProcessOptions shell = options({"-c", line});
  shell.program = "/bin/bash";

  Process pipe(shell);

  EXPECT_EQ(take(pipe), 0);
  EXPECT_THAT(output_, AllOf(HasSubstr("sensor/readings"), HasSubstr("code 0")));
  EXPECT_EQ(errors_, "");
}

TEST_F(LiveCommands, EchoEndsWithTheApplication) {
  Process& application = start();
  Process echo(options({"topic", "echo", "sensor/readings"}));
  ASSERT_TRUE(echo.wait_for("#")) << echo.errors();

  application.send(SIGINT);

  EXPECT_EQ(take(echo), 0) << errors_;
}

TEST_F(LiveCommands, RatesSizesAndAgesAreMeasured) {
  start();
  const std::vector<std::string> few{"--every", "200ms", "--count", "3"};
  const auto measure = [&](const std::string& word, bool is_json) {
    std::vector<std::string> words{"topic", word, "sensor/readings"};
    words.insert(words.end(), few.begin(), few.end());
    if (is_json) {
      words.emplace_back("--json");
    }
    EXPECT_EQ(command(words), 0) << errors_;
  };

  measure("hz", true);
  ASSERT_EQ(json_lines().size(), 3U);
  EXPECT_GT(json_lines()[2]["rate_hz"], 0.0);
  EXPECT_LE(json_lines()[2]["rate_hz"], 10'000.0);
  EXPECT_GE(json_lines()[2]["period_max_ns"], json_lines()[2]["period_min_ns"]);
  measure("hz", false);
  EXPECT_THAT(output_, HasSubstr(" Hz "));

  measure("bw", true);
  EXPECT_GT(json_lines()[2]["bytes_mean"], 1000.0);  // The image, and more.
  measure("bw", false);
  EXPECT_THAT(output_, HasSubstr("B/s"));

  measure("delay", true);
  EXPECT_GE(json_lines()[2]["age_p99_ns"], 0.0);
  EXPECT_GT(json_lines()[2]["latency"]["count"], 0);
  measure("delay", false);
  EXPECT_THAT(output_, HasSubstr("to the callback"));
}

TEST_F(LiveCommands, PubPublishesWhatJsonSays) {
  Process& application = start();

  EXPECT_EQ(command({"topic", "pub", "orders", R"({"value": 7, "text": "stop"})"}), 0) << errors_;
  EXPECT_THAT(output_, HasSubstr("1 message published on orders"));
  EXPECT_TRUE(application.wait_for("an order: 7 stop")) << application.errors();

  EXPECT_EQ(json_of({"topic", "pub", "orders", "{}", "--rate", "100", "--count", "5"})["published"],
            5);

  EXPECT_EQ(command({"topic", "pub", "orders", R"({"valu": 7})"}), 2);
  EXPECT_THAT(errors_, AllOf(HasSubstr("valu"), HasSubstr("live.Reading"), HasSubstr("ranges")));
}

// ---- Components, params, services, modes ----

TEST_F(LiveCommands, ComponentsAreListedStoppedStartedAndMadeAnew) {
  start();

  EXPECT_EQ(command({"component", "list"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("sensor"), HasSubstr("active"), HasSubstr("p99")));
  EXPECT_EQ(command({"component", "info", "filter"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("Filter of live_parts"), HasSubstr("sensor/readings"),
                             HasSubstr("sensor/filtered"), HasSubstr("called for")));
  const auto info = json_of({"component", "info", "filter"});
  EXPECT_EQ(info["state"], "active");
  EXPECT_EQ(info["callbacks"][0]["name"], "double");
  EXPECT_EQ(info["callbacks"][0]["kind"], "request");
  EXPECT_EQ(info["callbacks"][2]["name"], "sensor/readings");
  EXPECT_GT(info["callbacks"][2]["time"]["count"], 0);

  EXPECT_EQ(command({"component", "stop", "filter"}), 0) << errors_;
  EXPECT_NE(json_of({"component", "info", "filter"})["state"], "active");
  EXPECT_EQ(command({"component", "start", "filter"}), 0) << errors_;
  EXPECT_EQ(json_of({"component", "info", "filter"})["state"], "active");
  EXPECT_EQ(command({"component", "restart", "filter"}), 0) << errors_;

  EXPECT_EQ(command({"component", "info", "filtre"}), 2);
  EXPECT_THAT(errors_, HasSubstr("did you mean \"filter\"?"));
}

TEST_F(LiveCommands, ParamsAreReadAndChangedTogether) {
  start();

  EXPECT_EQ(command({"param", "list", "filter"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("filter.gain"), HasSubstr("m/s"),
                             HasSubstr("What is kept below"), Not(HasSubstr("sensor."))));
  EXPECT_EQ(json_of({"param", "list"}).size(), 3U);
  EXPECT_EQ(command({"param", "get", "filter.gain"}), 0) << errors_;
  EXPECT_EQ(output_, "2\n");

  EXPECT_EQ(command({"param", "set", "filter.gain=5", "filter.limit=12.5"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("filter.gain = 5 (was 2)"), HasSubstr("filter.limit")));
  EXPECT_EQ(json_of({"param", "get", "filter.gain", "filter.limit"}),
            (json{{"filter.gain", 5}, {"filter.limit", 12.5}}));

  // All of them, or none.
  EXPECT_EQ(command({"param", "set", "filter.gain=9", "filter.limit=-1"}), 1);
  EXPECT_THAT(errors_, AllOf(HasSubstr("nothing was changed"), HasSubstr("filter.limit")));
  EXPECT_EQ(json_of({"param", "get", "filter.gain"})["filter.gain"], 5);

  EXPECT_EQ(command({"param", "set", "filter.gian=9"}), 2);
  EXPECT_THAT(errors_, HasSubstr("did you mean \"filter.gain\"?"));
  EXPECT_EQ(command({"param", "set", "filter.gain"}), 2);
  EXPECT_THAT(errors_, HasSubstr("COMPONENT.PARAM=VALUE"));
}

TEST_F(LiveCommands, ServicesAreListedAndCalled) {
  start();

  EXPECT_EQ(command({"service", "list"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("double"), HasSubstr("live.Question")));
  EXPECT_EQ(command({"service", "call", "double", R"({"value": 21})"}), 0) << errors_;
  EXPECT_EQ(output_, "doubled: 42\n");
  EXPECT_EQ(json_of({"service", "call", "double", R"({"value": 4})"})["reply"]["doubled"], "8");

  EXPECT_EQ(command({"service", "call", "duoble"}), 2);
  EXPECT_THAT(errors_, HasSubstr("did you mean \"double\"?"));
}

TEST_F(LiveCommands, ModesAreShownAndSwitched) {
  start("watched", kAllowAll, kModes);

  EXPECT_EQ(command({"mode"}), 0) << errors_;
  EXPECT_EQ(output_, "* nominal\n  blind\n");
  EXPECT_EQ(command({"mode", "blind"}), 0) << errors_;
  EXPECT_EQ(output_, "Mode blind, was nominal.\n");
  EXPECT_EQ(json_of({"mode"})["mode"], "blind");

  EXPECT_EQ(command({"mode", "blond"}), 2);
  EXPECT_THAT(errors_, HasSubstr("did you mean \"blind\"?"));
}

TEST_F(LiveCommands, WhatIsNotAllowedNamesTheWordThatAllowsIt) {
  start("watched", "true", kModes);
  const auto expect_refused = [&](const std::vector<std::string>& words, const std::string& word) {
    EXPECT_EQ(command(words), 1) << output_;
    EXPECT_THAT(errors_, HasSubstr(word));
  };

  expect_refused({"param", "set", "filter.gain=5"}, "params");
  expect_refused({"topic", "pub", "orders", "{}"}, "publish");
  expect_refused({"service", "call", "double"}, "publish");
  expect_refused({"component", "restart", "filter"}, "lifecycle");
  expect_refused({"mode", "blind"}, "lifecycle");
  EXPECT_EQ(json_of({"param", "get", "filter.gain"})["filter.gain"], 2);
}

// ---- The whole ----

TEST_F(LiveCommands, GraphShowsRatesAndLatencies) {
  start();

  EXPECT_EQ(command({"graph", "--live", "--over", "300ms"}), 0) << errors_;

  EXPECT_THAT(output_, AllOf(StartsWith("digraph application {"), HasSubstr("<b>filter</b>"),
                             HasSubstr("sensor/readings"), HasSubstr(" Hz"), HasSubstr("% CPU"),
                             HasSubstr("p99 ")));
  EXPECT_EQ(command({"graph", "--live", "--set", "a.b=1"}), 2);
  EXPECT_THAT(errors_, HasSubstr("--set cannot be used with --live"));
  EXPECT_EQ(command({"graph"}), 2);
  EXPECT_THAT(errors_, HasSubstr("application is required"));
}

TEST_F(LiveCommands, RecordWritesALogFromOutside) {
  start();
  const std::string file = (folder_ / "live.mcap").string();

  EXPECT_EQ(command({"record", "--live", "-o", file, "--topics", "sensor/**", "--for", "300ms"}), 0)
      << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("live.mcap: "), HasSubstr("of 2 topics")));

  const json info = json_of({"info", file})["files"][0];
  EXPECT_GT(info["messages"], 0);
  EXPECT_TRUE(info["topics"].contains("sensor/readings"));
  EXPECT_EQ(command({"doctor", file}), 0) << output_ << errors_;
  EXPECT_EQ(command({"echo", file, "sensor/readings", "--json", "--full"}), 0) << errors_;
  std::uint64_t sequence = 0;
  for (const json& line : json_lines()) {
    EXPECT_GT(line["sequence"], sequence);
    sequence = line["sequence"];
    EXPECT_EQ(line["data"]["ranges"].size(), 100U);
    EXPECT_EQ(line["publisher"], "sensor");
    EXPECT_EQ(line["type"], "live.Reading");
  }
  EXPECT_GT(sequence, 0U);
}

TEST_F(LiveCommands, RecordIsWholeAfterCtrlC) {
  start();
  const std::string file = (folder_ / "live.mcap").string();
  Process record(options({"record", "--live", "-o", file}));
  ASSERT_TRUE(record.wait_for("Ctrl-C ends it")) << record.errors();

  record.send(SIGINT);

  EXPECT_EQ(take(record), 0) << errors_;
  EXPECT_EQ(command({"doctor", file}), 0) << output_ << errors_;
}

TEST_F(LiveCommands, RecordFailsAtOnceWhenItsLogIsDeleted) {
  start();
  const std::string file = (folder_ / "live.mcap").string();
  Process record(options({"record", "--live", "-o", file}));
  ASSERT_TRUE(record.wait_for("Ctrl-C ends it")) << record.errors();

  ASSERT_TRUE(std::filesystem::remove(file + ".active"));

  EXPECT_EQ(take(record), 1) << errors_;
  EXPECT_THAT(errors_, HasSubstr("live.mcap.active: it was deleted"));
}

TEST_F(LiveCommands, RecordKeepsItsLogBesideAFileThatGotItsName) {
  start();
  const std::string file = (folder_ / "live.mcap").string();
  Process record(options({"record", "--live", "-o", file}));
  ASSERT_TRUE(record.wait_for("Ctrl-C ends it")) << record.errors();
  std::ofstream(file) << "precious";
  record.send(SIGINT);

  EXPECT_EQ(take(record), 0) << errors_;
  EXPECT_EQ(std::filesystem::file_size(file), 8U);
  EXPECT_EQ(command({"doctor", (folder_ / "live_0002.mcap").string()}), 0) << output_ << errors_;
}

TEST_F(LiveCommands, LogPrintsLinesAsTheyCome) {
  start();

  EXPECT_EQ(command({"log", "--level", "warning", "--count", "1"}), 0) << errors_;
  EXPECT_THAT(output_, AllOf(HasSubstr("warning"), HasSubstr("sensor: fifty more readings")));
  EXPECT_EQ(command({"log", "--component", "sensor", "--count", "1", "--json"}), 0) << errors_;
  EXPECT_EQ(json_lines()[0]["text"], "fifty more readings");

  EXPECT_EQ(command({"log", "--component", "sensro"}), 2);
  EXPECT_THAT(errors_, HasSubstr("did you mean \"sensor\"?"));
}

TEST_F(LiveCommands, ChainSaysWhereThereIsNone) {
  start();

  EXPECT_EQ(command({"chain"}), 0) << errors_;
  EXPECT_THAT(output_, HasSubstr("no chains"));
  EXPECT_EQ(json_of({"chain"}), json::array());
}

// ---- The command line ----

TEST_F(LiveCommands, HelpIsGivenForEachWordWithExamples) {
  const std::vector<std::vector<std::string>> all{
      {"list"},
      {"topic"},
      {"topic", "list"},
      {"topic", "info"},
      {"topic", "echo"},
      {"topic", "hz"},
      {"topic", "bw"},
      {"topic", "delay"},
      {"topic", "pub"},
      {"component"},
      {"component", "list"},
      {"component", "info"},
      {"component", "start"},
      {"component", "stop"},
      {"component", "restart"},
      {"param"},
      {"param", "list"},
      {"param", "get"},
      {"param", "set"},
      {"service"},
      {"service", "list"},
      {"service", "call"},
      {"mode"},
      {"log"},
      {"chain"},
  };
  for (std::vector<std::string> words : all) {
    std::string line = "  fastcycle";
    for (const std::string& word : words) {
      line += " " + word;
    }
    words.emplace_back("--help");

    EXPECT_EQ(command(words), 0) << line << errors_;
    EXPECT_THAT(output_, HasSubstr("Examples:\n" + line));
  }
}

TEST_F(LiveCommands, WrongWordsAreReportedInASentence) {
  struct Case {
    std::vector<std::string> words;
    std::string sentence;
  };
  const std::vector<Case> cases{
      {{"topik"}, "fastcycle: unknown command \"topik\"; did you mean \"topic\"?"},
      {{"topic", "ecco"}, "fastcycle topic: unknown command \"ecco\"; did you mean \"echo\"?"},
      {{"topic", "echo"}, "fastcycle topic echo: topics is required"},
      {{"topic", "hz", "a", "--evry", "1s"},
       "fastcycle topic hz: unknown option --evry; did you mean \"--every\"?"},
      {{"topic", "hz", "a", "b"}, "fastcycle topic hz: unexpected argument \"b\""},
      {{"topic", "hz", "a", "--every", "1"}, "expects a time above zero with its unit"},
      {{"topic", "--app", "x", "list"}, "fastcycle topic: "},
      {{"param", "get"}, "fastcycle param get: params is required"},
      {{"log", "--level", "loud"}, "fastcycle log: "},
      {{"record", "--live", "app.json"}, "give --app NAME, not a file"},
      {{"graph", "app.json", "--app", "x"}, "--app requires --live"},
  };
  for (const Case& each : cases) {
    EXPECT_EQ(command(each.words), 2) << each.sentence;
    EXPECT_THAT(errors_, HasSubstr(each.sentence));
    EXPECT_EQ(output_, "") << each.sentence;
  }

  EXPECT_EQ(command({"topic"}), 2);
  EXPECT_THAT(errors_, HasSubstr("echo"));
}

TEST_F(LiveCommands, NamesThatAreCommandsMayBeComponentsAndTopics) {
  for (const std::string name : {"run", "list", "topic", "filter"}) {
    EXPECT_EQ(command({"component", "info", name}), 1) << "It is a name, and nothing runs";
    EXPECT_THAT(errors_, StartsWith("fastcycle component info: no application runs"));
  }
}

}  // namespace
}  // namespace fastcycle::live
