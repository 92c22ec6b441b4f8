#include "host/log_topic.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "component/own_names.h"
#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "host/status_news.h"
#include "host/test_application.h"
#include "mcap/file.h"
#include "mcap/reader.h"
#include "status/status.pb.h"

namespace fastcycle::host {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using namespace std::chrono_literals;

/// Writes `lines` lines in each call of `serve`, and one of each level in `start`.
class Writer final : public Component {
 public:
  explicit Writer(Context& context)
      : Component(context),
        lines_(context.param<std::int64_t>("lines", {.fallback = 1})),
        throws_at_(context.param<std::int64_t>("throws_at", {.fallback = 0})) {}

  void start() override {
    log().debug("a debug line");
    log().info("an info line");
    log().warning("a warning line \xff");
    log().error("an error line");
  }
  void serve() override {
    ++calls_;
    for (std::int64_t i = 0; i < lines_.get(); ++i) {
      log().info("call {}, line {}", calls_, i);
    }
    if (calls_ == throws_at_.get()) {
      throw std::runtime_error("it broke");
    }
  }

 private:
  Param<std::int64_t> lines_;
  Param<std::int64_t> throws_at_;
  std::int64_t calls_ = 0;
};

/// Writes the same text in each call of `serve`, not more often than every 12 ms.
class Repeater final : public Component {
 public:
  explicit Repeater(Context& context) : Component(context) {}

  void serve() override { log().throttle(12ms).info("call {}", ++calls_); }

 private:
  std::int64_t calls_ = 0;
};

std::string text_of(const status::LogLine& line, Time start) {
  const Time taken{Duration(line.header().taken_ns())};
  return fmt::format("{} {} {}: {}{}", (taken - start) / 1ms,
                     status::LogLevel_Name(line.level()).substr(10), line.component(), line.text(),
                     line.lost() == 0 ? "" : fmt::format(" (lost {})", line.lost()));
}

/// Collects what comes on `fastcycle/log`.
class Listener final : public Component {
 public:
  static inline std::vector<std::string> lines;  ///< Of the last application of a test.
  static inline std::uint64_t lost = 0;

  explicit Listener(Context& context) : Component(context) {
    lines.clear();
    lost = 0;
    context.create_subscriber<status::LogLine>(std::string("/") + kLogTopic, {.depth = 256},
                                               [this](const status::LogLine& line) {
                                                 lines.push_back(text_of(line, start_time()));
                                                 lost += line.lost();
                                               });
  }
};

/// Notes of which components the status reports.
class Supervisor final : public Component {
 public:
  static inline std::vector<std::string> received;

  explicit Supervisor(Context& context) : Component(context) {
    context.create_subscriber<status::Status>(std::string("/") + kStatusTopic,
                                              [](const status::Status& status) {
                                                received.clear();
                                                for (const auto& one : status.components()) {
                                                  received.push_back(one.name());
                                                }
                                              });
  }
};

class LogTopic : public testing::Test {
 protected:
  LogTopic() { classes_.with<Writer>("writer").with<Listener>("listener"); }

  std::unique_ptr<Application> make(const std::string& writers, const ClockOptions& clock) {
    return make_application(R"({"name": "logged", "components": [)" + writers + R"(,
          {"name": "listener", "library": "listener"}]})",
                            classes_, clock);
  }
  /// What is received in 25 ms of simulated time.
  std::vector<std::string> simulated(const std::string& writers, unsigned workers = 1) {
    auto application = make(writers, {.is_simulated = true, .workers = workers});
    application->start();
    application->run(25ms);
    application->stop();
    return Listener::lines;
  }

  TestClasses classes_;
};

constexpr const char* kWriter = R"({"name": "writer", "library": "writer", "serve_period_ms": 10})";

TEST_F(LogTopic, HasEachLineWithTimeLevelAndComponent) {
  const std::vector<std::string> lines = simulated(kWriter);
  EXPECT_THAT(lines, testing::ElementsAre(
                         "0 INFO writer: an info line", "0 WARNING writer: a warning line ?",
                         "0 ERROR writer: an error line", "10 INFO writer: call 1, line 0",
                         "20 INFO writer: call 2, line 0"));
}

TEST_F(LogTopic, HasFaultsToo) {
  EXPECT_THAT(simulated(R"({"name": "writer", "library": "writer", "serve_period_ms": 10,
                            "params": {"throws_at": 2}})"),
              Contains(HasSubstr("20 ERROR writer: its serve() threw: it broke")));
}

TEST_F(LogTopic, IsTheSameForAnyNumberOfWorkers) {
  std::string writers;
  for (int i = 0; i < 8; ++i) {
    writers += fmt::format(R"({}{{"name": "writer_{}", "library": "writer", "serve_period_ms": 5,
                               "params": {{"lines": 2}}}})",
                           i == 0 ? "" : ",", i);
  }
  const std::vector<std::string> one = simulated(writers, 1);
  EXPECT_THAT(one, SizeIs(testing::Gt(80U)));
  EXPECT_EQ(simulated(writers, 4), one);
  EXPECT_EQ(simulated(writers, 8), one);
}

TEST_F(LogTopic, LeavesOutTheSameOfAThrottledTextInEveryRunInSimulatedTime) {
  classes_.with<Repeater>("repeater");
  std::string repeaters;
  for (int i = 0; i < 8; ++i) {
    repeaters += fmt::format(R"({}{{"name": "repeater_{}", "library": "repeater",
                                 "serve_period_ms": 5}})",
                             i == 0 ? "" : ",", i);
  }
  const std::vector<std::string> one = simulated(repeaters, 1);
  EXPECT_THAT(one, Contains("5 INFO repeater_0: call 1"));
  EXPECT_THAT(one, Contains("20 INFO repeater_0: call 4 (2 more left out)"));
  EXPECT_THAT(one, SizeIs(16));
  EXPECT_EQ(simulated(repeaters, 4), one);
  EXPECT_EQ(simulated(repeaters, 8), one);
}

TEST_F(LogTopic, LeavesOutWhatIsBelowTheLevelOfTheComponentOrOfTheApplication) {
  auto application = make_application(
      R"({"name": "logged", "log_level": "error", "components": [
        {"name": "quiet", "library": "writer"},
        {"name": "loud", "library": "writer", "log_level": "debug"},
        {"name": "listener", "library": "listener"}]})",
      classes_, {.is_simulated = true, .workers = 1});
  application->start();
  application->run(1ms);
  application->stop();
  EXPECT_THAT(Listener::lines,
              testing::ElementsAre("0 ERROR quiet: an error line", "0 DEBUG loud: a debug line",
                                   "0 INFO loud: an info line", "0 WARNING loud: a warning line ?",
                                   "0 ERROR loud: an error line"));
}

TEST_F(LogTopic, CountsWhatIsMoreThanItTakes) {
  simulated(R"({"name": "writer", "library": "writer", "serve_period_ms": 10, "log_level": "info",
                "params": {"lines": 500}})");
  // The start and the first tick fill the first tenth of a second; what comes then is counted, and
  // would be reported with the next line.
  EXPECT_THAT(Listener::lines, SizeIs(LogComponent::kMostLines));
  auto application = make(R"({"name": "writer", "library": "writer", "serve_period_ms": 100,
                              "params": {"lines": 500}})",
                          {.is_simulated = true, .workers = 1});
  application->start();
  application->run(250ms);
  application->stop();
  EXPECT_EQ(Listener::lost, 400U);
}

TEST_F(LogTopic, IsThereLiveAndNobodyWaitsForIt) {
  auto application = make(kWriter, {});
  application->start();
  const auto end = std::chrono::steady_clock::now() + 60s;
  const auto has_come = [&] {
    return application->topics().find(kLogTopic)->subscriptions.front()->ledger().delivered >= 5;
  };
  while (!has_come() && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(1ms);
  }
  application->stop();
  EXPECT_THAT(Listener::lines, Contains(HasSubstr("INFO writer: call 1, line 0")));
}

TEST_F(LogTopic, IsThereOnlyIfSomebodySubscribes) {
  auto application =
      make_application(R"({"name": "logged", "components": [)" + std::string(kWriter) + "]}",
                       classes_, {.is_simulated = true, .workers = 1});
  EXPECT_EQ(application->topics().find(kLogTopic), nullptr);
  EXPECT_THAT(application->components(), SizeIs(1));
}

TEST_F(LogTopic, IsThereBesideTheStatusWhichDoesNotReportIt) {
  classes_.with<Supervisor>("supervisor");
  auto application = make(std::string(kWriter) + R"(, {"name": "supervisor", "library":
                          "supervisor"})",
                          {.is_simulated = true, .workers = 1});
  application->start();
  application->run(25ms);
  application->stop();
  EXPECT_THAT(Listener::lines, Contains("20 INFO writer: call 2, line 0"));
  EXPECT_THAT(Supervisor::received, testing::ElementsAre("writer", "supervisor", "listener"));
}

TEST_F(LogTopic, IsRecordedWhereTheRecordingNamesIt) {
  const config::TestFolder folder;
  const std::filesystem::path file = folder / "drive.mcap";
  config::Problems problems;
  config::RecordDescription record;
  record.file = file;
  record.topics = {kLogTopic};
  Application application(
      describe_text(R"({"name": "logged", "components": [)" + std::string(kWriter) + "]}",
                    problems),
      {.is_simulated = true, .workers = 1});
  application.record(record);
  application.build(classes_, problems, ConstructorFault::kFault);
  ASSERT_FALSE(problems.has_errors());
  application.start();
  application.run(25ms);
  application.stop();
  std::vector<std::string> texts;
  const mcap::FileSource source(file);
  const mcap::Reader reader(source);
  mcap::MessageReader messages = reader.messages({.topics = {kLogTopic}});
  while (const std::optional<mcap::StoredMessage> message = messages.next()) {
    status::LogLine line;
    ASSERT_TRUE(line.ParseFromArray(message->data.data(), static_cast<int>(message->data.size())));
    texts.push_back(line.text());
  }
  EXPECT_THAT(texts, Contains("call 2, line 0"));
}

}  // namespace
}  // namespace fastcycle::host
