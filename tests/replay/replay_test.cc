#include <array>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include "fastcycle/version.h"
#include "log/log.pb.h"
#include "mcap/file.h"
#include "mcap/reader.h"
#include "process/process.h"

namespace fastcycle::replay {
namespace {

using nlohmann::json;
using test::Process;
using testing::HasSubstr;
using testing::Not;

/// A message and all that the file says of it.
struct Line {
  std::uint32_t sequence;
  std::uint64_t log_time_ns;
  std::uint64_t publish_time_ns;
  std::string data;
  std::string info;  ///< Serialized, without its channel, which is a number of that file.

  bool operator==(const Line&) const = default;
};

/// What there is on `topic`, whose messages come from one publisher.
std::vector<Line> lines_of(const std::filesystem::path& file, const std::string& topic) {
  const mcap::FileSource source(file);
  const mcap::Reader reader(source);
  std::map<std::tuple<std::uint32_t, std::uint64_t>, std::string> infos;
  mcap::MessageReader about = reader.messages({.topics = {"fastcycle/message_infos"}});
  while (const auto message = about.next()) {
    log::MessageInfos all;
    EXPECT_TRUE(all.ParseFromArray(message->data.data(), static_cast<int>(message->data.size())));
    for (log::MessageInfo info : all.infos()) {
      const std::uint32_t channel = info.channel();
      info.clear_channel();
      infos[{channel, info.sequence()}] = info.SerializeAsString();
    }
  }
  std::vector<Line> lines;
  mcap::MessageReader messages = reader.messages({.topics = {topic}});
  while (const auto message = messages.next()) {
    lines.push_back({message->sequence, message->log_time_ns, message->publish_time_ns,
                     std::string(mcap::text_of(message->data)),
                     infos[{message->channel_id, message->sequence}]});
  }
  return lines;
}

class Replay : public testing::Test {
 protected:
  /// Runs `fastcycle` in the test's folder; its exit code.
  int fastcycle(std::vector<std::string> words) {
    words.emplace_back("--quiet");
    // A memory checker looks at its own process, which a protected one does not allow.
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");
    }
    Process program({.program = FASTCYCLE_PROGRAM, .arguments = words, .folder = folder_.path()});
    const test::Ending& ending = program.wait();
    errors_ = program.errors();
    return ending.signal != 0 ? 1000 + ending.signal : ending.exit_code;
  }

  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_ / name).string();
  }
  [[nodiscard]] json report() const {
    return json::parse(test::read_file(folder_ / "report.json"));
  }

  /// Counts and adds: `counter` publishes "numbers", `adder` answers on "sums".
  void write_parts() const {
    folder_.write("app.json", R"({"name": "parts", "components": [
      {"name": "counter", "library": "launcher_parts", "class": "Counter", "serve_period_ms": 1,
       "params": {"count": 200}},
      {"name": "adder", "library": "launcher_parts", "class": "Adder",
       "subscribers": {"numbers": {"depth": 256}}}]})");
  }
  void record_parts() {
    write_parts();
    ASSERT_EQ(fastcycle({"run", path("app.json"), "--clock", "simulated", "--record", "a.mcap"}), 0)
        << errors_;
  }

  test::Folder folder_;
  std::string errors_;
};

// ---- The drive ----

// Every message of the two components, in data, sequence, times, origin and round.
TEST_F(Replay, OfTheDriveGivesTheSameBytesWithAnyNumberOfWorkers) {
  ASSERT_EQ(fastcycle({"run", FASTCYCLE_RAV4, "--clock", "simulated", "--record", "a.mcap"}), 0)
      << errors_;
  std::map<std::string, std::vector<Line>> before;
  for (const char* topic : {"vehicle/wheel_speeds", "vehicle/steering", "localization/pose"}) {
    before[topic] = lines_of(folder_ / "a.mcap", topic);
    ASSERT_GT(before[topic].size(), 3'000U) << topic;
  }

  for (const char* workers : {"1", "2"}) {
    const std::string file = std::string("b") + workers + ".mcap";
    ASSERT_EQ(fastcycle({"run", FASTCYCLE_RAV4, "--clock", "simulated", "--workers", workers,
                         "--replay", "a.mcap", "--replay-into", "vehicle", "--replay-into",
                         "localization", "--record", file, "--report", "report.json"}),
              0)
        << errors_;

    for (const auto& [topic, lines] : before) {
      EXPECT_EQ(lines_of(folder_ / file, topic), lines) << topic << ", " << workers << " workers";
    }
    const json report = this->report();
    EXPECT_EQ(report["end"], "input finished");
    EXPECT_EQ(report["components"]["can_driver"]["state"], "replayed");
    EXPECT_FALSE(report["components"].contains("supervision"));
    std::uint64_t fed = 0;
    for (const json& stream : report["replay"]["fed"]) {
      fed += stream["messages"].get<std::uint64_t>();
    }
    EXPECT_GT(fed, 100'000U);
  }
}

// Also what scoring and supervision found, which wrote no messages about it.
TEST_F(Replay, OfTheDriveWithoutItsDriversGivesTheSameResults) {
  ASSERT_EQ(fastcycle({"run", FASTCYCLE_RAV4, "--clock", "simulated", "--record", "a.mcap",
                       "--report", "report.json"}),
            0)
      << errors_;
  const json before = report();

  ASSERT_EQ(fastcycle({"run", FASTCYCLE_RAV4, "--clock", "simulated", "--replay", "a.mcap",
                       "--report", "report.json"}),
            0)
      << errors_;

  EXPECT_EQ(report()["results"], before["results"]);
  EXPECT_EQ(report()["time_s"], before["time_s"]);
}

// ---- As people call it ----

TEST_F(Replay, LiveFeedsEveryMessage) {
  record_parts();

  EXPECT_EQ(fastcycle({"run", path("app.json"), "--replay", "a.mcap", "--report", "report.json"}),
            0)
      << errors_;

  EXPECT_EQ(report()["end"], "input finished");
  EXPECT_EQ(report()["results"]["sum"], 200 * 201 / 2);
  EXPECT_GE(report()["replay"]["worst_lateness_us"], 0.0);
}

TEST_F(Replay, PlayFeedsEveryMessageAtTheWallsPace) {
  record_parts();

  EXPECT_EQ(fastcycle({"play", "a.mcap", path("app.json"), "--rate", "10", "--report",
                       "report.json", "--record", "b.mcap"}),
            0)
      << errors_;

  EXPECT_EQ(report()["results"]["sum"], 200 * 201 / 2);
  EXPECT_GE(report()["wall_s"], 0.02);
  EXPECT_EQ(lines_of(folder_ / "b.mcap", "sums"), lines_of(folder_ / "a.mcap", "sums"));
}

TEST_F(Replay, PlayTakesPartsAndLoops) {
  record_parts();

  EXPECT_EQ(fastcycle({"play", "a.mcap", path("app.json"), "--rate", "1000", "--start", "0.1",
                       "--end", "0.15", "--loop", "--for", "200ms", "--report", "report.json"}),
            0)
      << errors_;

  EXPECT_EQ(report()["end"], "time over");
  EXPECT_EQ(report()["replay"]["from_s"], 0.1);
  EXPECT_EQ(report()["replay"]["to_s"], 0.15);
  EXPECT_GT(report()["results"]["received"], 190);
}

// What the recording has is published, also where the application has no component for it.
TEST_F(Replay, WarnsOnlyOfWhatTheRecordingHasNot) {
  record_parts();
  folder_.write("adder.json", R"({"name": "adder", "components": [
      {"name": "adder", "library": "launcher_parts", "class": "Adder",
       "subscribers": {"numbers": {"depth": 256}}}]})");

  ASSERT_EQ(fastcycle({"run", path("adder.json"), "--clock", "simulated", "--for", "1ms"}), 0);
  EXPECT_THAT(errors_, HasSubstr("published by nobody"));
  ASSERT_EQ(fastcycle({"run", path("adder.json"), "--clock", "simulated", "--replay", "a.mcap"}), 0)
      << errors_;
  EXPECT_THAT(errors_, Not(HasSubstr("published by nobody")));

  folder_.write("adder.json", R"({"name": "adder", "components": [
      {"name": "adder", "library": "launcher_parts", "class": "Adder",
       "remap": {"numbers": "others"}}]})");
  EXPECT_EQ(fastcycle({"play", "a.mcap", path("adder.json")}), 2);
  EXPECT_THAT(errors_, HasSubstr("\"others\", which component \"adder\" subscribes to, is not in"));
}

TEST_F(Replay, ErrorsAreReportedBeforeAnythingStarts) {
  record_parts();
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"run", path("app.json"), "--replay", "none.mcap"}, "none.mcap"},
      {{"run", path("app.json"), "--replay", "app.json"}, "app.json"},
      {{"run", path("app.json"), "--replay", "a.mcap", "--replay-into", "ader"},
       "there is no component \"ader\"; did you mean \"adder\"?"},
      {{"run", path("app.json"), "--replay-into", "adder"}, "--replay FILE"},
      {{"run", path("app.json"), "--replay", "a.mcap", "--replay", "./a.mcap"},
       "a.mcap and ./a.mcap are the same file"},
      {{"play", "a.mcap", "a.mcap", path("app.json")}, "a.mcap is named twice"},
      {{"play", path("app.json")}, "expects recordings, followed by an application"},
      {{"play", "a.mcap", path("app.json"), "--topics", "other/*"}, "there is nothing to feed"},
      {{"play", "a.mcap", path("app.json"), "--remap", "numbers"}, "--remap expects OLD:=NEW"},
      {{"play", "a.mcap", path("app.json"), "--start", "2", "--end", "1"}, "--end must be after"},
      {{"play", "a.mcap", path("app.json"), "--rate", "0"}, "--rate expects"}};
  for (const auto& [words, text] : cases) {
    EXPECT_EQ(fastcycle(words), 2) << words.back();
    EXPECT_THAT(errors_, HasSubstr(text));
  }
}

// ---- Keys ----

/// The program on a terminal of its own.
class Terminal {
 public:
  explicit Terminal(std::vector<std::string> words) {
    terminal_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (terminal_ < 0 || grantpt(terminal_) != 0 || unlockpt(terminal_) != 0) {
      throw std::runtime_error("no terminal");
    }
    const std::string name = ptsname(terminal_);
    inside_ = open(name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    pid_ = fork();
    if (pid_ == 0) {
      setsid();
      const int inside = open(name.c_str(), O_RDWR);  // Which becomes its terminal.
      for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
        dup2(inside, stream);
      }
      std::string program = FASTCYCLE_PROGRAM;
      std::vector<char*> arguments{program.data()};
      for (std::string& word : words) {
        arguments.push_back(word.data());
      }
      arguments.push_back(nullptr);
      execv(program.c_str(), arguments.data());
      _exit(127);
    }
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  ~Terminal() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    close(inside_);
    close(terminal_);
  }

  void press(std::string_view keys) const {
    ASSERT_EQ(write(terminal_, keys.data(), keys.size()), static_cast<ssize_t>(keys.size()));
  }
  void send(int signal) const { kill(pid_, signal); }

  /// Waits until `text` was shown since this was asked last; false after a minute.
  bool wait_for(const std::string& text) {
    for (int i = 0; i < kTimes; ++i) {
      if (const auto at = shown_.find(text); at != std::string::npos) {
        shown_.erase(0, at + text.size());
        return true;
      }
      read_once();
    }
    ADD_FAILURE() << "\"" << text << "\" was not shown, but: " << shown_;
    return false;
  }

  /// Whether keys are shown and lines are put together, as usual.
  [[nodiscard]] bool is_as_usual() const {
    termios modes{};
    tcgetattr(inside_, &modes);
    return (modes.c_lflag & ECHO) != 0 && (modes.c_lflag & ICANON) != 0;
  }

  /// Waits for the end. The exit code; 1000 + the number of the signal that ended it; -1 if it has
  /// not ended after a minute.
  int wait() {
    int status = 0;
    for (int i = 0; waitpid(pid_, &status, WNOHANG) == 0; ++i) {
      if (i == kTimes) {
        return -1;
      }
      read_once();
    }
    pid_ = -1;
    return WIFSIGNALED(status) ? 1000 + WTERMSIG(status) : WEXITSTATUS(status);
  }

 private:
  static constexpr int kTimes = 600;  ///< Of a tenth of a second.

  void read_once() {
    pollfd ready{terminal_, POLLIN, 0};
    if (poll(&ready, 1, 100) > 0) {
      std::array<char, 4096> bytes{};
      const ssize_t count = read(terminal_, bytes.data(), bytes.size());
      shown_.append(bytes.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
    }
  }

  int terminal_ = -1;
  int inside_ = -1;
  pid_t pid_ = -1;
  std::string shown_;
};

class Keys : public Replay {
 protected:
  /// The words that play 0.2 s in 200 s.
  [[nodiscard]] std::vector<std::string> slowly() const {
    std::vector<std::string> words{"play", path("a.mcap"), path("app.json"), "--rate", "0.001"};
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");
    }
    return words;
  }
};

TEST_F(Keys, PauseStepChangeTheRateAndEndTheRun) {
  record_parts();
  Terminal terminal(slowly());
  ASSERT_TRUE(terminal.wait_for("q ends"));

  terminal.press(" ");
  EXPECT_TRUE(terminal.wait_for("paused"));
  EXPECT_FALSE(terminal.is_as_usual());
  terminal.press("..........");
  EXPECT_TRUE(terminal.wait_for("received ten numbers"));
  terminal.press("+ ");
  EXPECT_TRUE(terminal.wait_for("0.002 times as fast"));
  terminal.press("q");

  EXPECT_EQ(terminal.wait(), 0);
  EXPECT_TRUE(terminal.is_as_usual());
}

TEST_F(Keys, LeaveTheTerminalAsItWasWhateverEndsTheRun) {
  record_parts();
  for (const int signal : {SIGTERM, SIGABRT}) {
    Terminal terminal(slowly());
    ASSERT_TRUE(terminal.wait_for("q ends"));
    terminal.press(" ");
    ASSERT_TRUE(terminal.wait_for("paused"));
    terminal.send(signal);

    EXPECT_EQ(terminal.wait(), signal == SIGTERM ? 0 : 1000 + signal);
    EXPECT_TRUE(terminal.is_as_usual());
  }
}

}  // namespace
}  // namespace fastcycle::replay
