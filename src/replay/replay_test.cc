#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "host/pace.h"
#include "host/prepare_replay.h"
#include "host/test_application.h"
#include "mcap/reader.h"
#include "mcap/writer.h"
#include "record/descriptor_set.h"
#include "report/report.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using namespace std::chrono_literals;

/// Publishes 1, 2, 3, … on "numbers", two at a time, until there were 40; says a name at its start
/// and at its stop.
class Driver final : public Component {
 public:
  explicit Driver(Context& context)
      : Component(context),
        numbers_(context.create_publisher<Int64Value>("numbers")),
        map_(context.create_publisher<Int64Value>("map")),
        source_(context.create_source()) {}

  void start() override { say(7); }
  void serve() override {
    if (sent_ == 40) {
      return;  // Live, the run goes on for a moment.
    }
    for (int i = 0; i < 2; ++i) {
      auto number = numbers_.loan();
      number->set_value(++sent_);
      numbers_.publish(std::move(number), {.taken_at = now() - Duration(sent_)});
    }
    if (sent_ == 40) {
      source_.finish();
    }
  }
  void stop() override { say(9); }

 private:
  void say(std::int64_t value) {
    auto map = map_.loan();
    map->set_value(value);
    map_.publish(std::move(map));
  }

  Publisher<Int64Value> numbers_;
  Publisher<Int64Value> map_;
  Source source_;
  std::int64_t sent_ = 0;
};

/// Answers each number, so one round later, with its double.
class Doubler final : public Component {
 public:
  explicit Doubler(Context& context)
      : Component(context), doubled_(context.create_publisher<Int64Value>("doubled")) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      auto twice = doubled_.loan();
      twice->set_value(2 * number.value());
      doubled_.publish(std::move(twice));
    });
  }

 private:
  Publisher<Int64Value> doubled_;
};

/// What it publishes depends on everything that it can notice: what came, when, in which order, and
/// which messages came in the same round.
class Mixer final : public Component {
 public:
  explicit Mixer(Context& context)
      : Component(context),
        mixed_(context.create_publisher<Int64Value>("mixed")),
        latest_(context.create_latest<Int64Value>("doubled")),
        timer_(context.create_timer({.period = 3ms}, [this] { mix(5); })) {
    for (const char* topic : {"numbers", "doubled", "map"}) {
      context.create_subscriber<Int64Value>(
          topic, [this, salt = topic[0]](const Sample<Int64Value>& sample) {
            mix(sample->value() + salt);
            mix(static_cast<std::int64_t>(sample.info().sequence));
            mix((now() - sample.info().origin.taken).count());
            mix(latest_.get() ? latest_.get()->value() : 0);
          });
    }
  }

  void start() override { mix(1); }
  void stop() override { mix(2); }

 private:
  void mix(std::int64_t value) {
    state_ = state_ * 6364136223846793005ULL + static_cast<std::uint64_t>(value) +
             static_cast<std::uint64_t>(now().time_since_epoch().count());
    auto out = mixed_.loan();
    out->set_value(static_cast<std::int64_t>(state_));
    mixed_.publish(std::move(out));
  }

  Publisher<Int64Value> mixed_;
  Latest<Int64Value> latest_;
  Timer timer_;
  std::uint64_t state_ = 1;
};

/// Remembers what came.
class Listener final : public Component {
 public:
  explicit Listener(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", [this](const Sample<Int64Value>& number) {
      ++received_;
      sum_ += number->value();
      is_rising_ =
          is_rising_ && number.info().sequence > last_ && number.info().publish_time >= last_time_;
      last_ = number.info().sequence;
      last_time_ = number.info().publish_time;
    });
  }
  void serve() override {
    if (ticks_++ == 0) {
      report("first_tick_ns", (now() - Time{}).count());
    }
  }
  void stop() override {
    report("start_ns", (start_time() - Time{}).count());
    report("received", received_);
    report("sum", sum_);
    report("rising", is_rising_);
  }

 private:
  std::int64_t ticks_ = 0;
  std::int64_t received_ = 0;
  std::int64_t sum_ = 0;
  std::uint64_t last_ = 0;
  Time last_time_{};
  bool is_rising_ = true;
};

/// Receives what the mixer publishes.
class MixedListener final : public Component {
 public:
  explicit MixedListener(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("mixed", [](const Int64Value&) {});
  }
};

// The mixer stands in the middle: it starts after the driver and before the doubler, and stops
// after the doubler and before the driver.
constexpr const char* kWhole = R"({"name": "t", "topics": {"map": {"latched": 1}}, "components": [
  {"name": "driver", "library": "driver", "serve_period_ms": 1},
  {"name": "mixer", "library": "mixer"},
  {"name": "doubler", "library": "doubler"}]})";

constexpr const char* kListening = R"({"name": "t", "components": [
  {"name": "driver", "library": "driver", "serve_period_ms": 1},
  {"name": "listener", "library": "listener", "subscribers": {"numbers": {"depth": 64}}}]})";

/// A message with all that is recorded of it.
struct Line {
  std::uint64_t sequence;
  Time published;
  Time taken;
  PublisherId root;
  bool is_held;
  std::uint32_t step;
  std::string data;

  bool operator==(const Line&) const = default;
};

std::string text_of(const Line& line) {
  return fmt::format("{} at {} ns, taken {} ns before, root {:x}{}, step {}, {:02x}", line.sequence,
                     (line.published - kSimulatedStart).count(),
                     (line.published - line.taken).count(), line.root, line.is_held ? " held" : "",
                     line.step,
                     fmt::join(std::vector<int>(line.data.begin(), line.data.end()), ""));
}

/// Where the two differ first, in words; empty if they are equal.
std::string difference(const std::vector<Line>& before, const std::vector<Line>& after) {
  for (std::size_t i = 0; i < std::max(before.size(), after.size()); ++i) {
    if (i >= before.size() || i >= after.size() || before[i] != after[i]) {
      return fmt::format("message {} of {} and {}:\n  {}\n  {}", i, before.size(), after.size(),
                         i < before.size() ? text_of(before[i]) : "none",
                         i < after.size() ? text_of(after[i]) : "none");
    }
  }
  return {};
}

std::vector<Line> lines_of(const std::filesystem::path& file, const std::string& topic) {
  record::RecordingReader reader({file});
  std::vector<bool> wanted;
  for (const record::RecordedStream& stream : reader.streams()) {
    wanted.push_back(stream.topic == topic);
  }
  reader.rewind({.wanted = wanted, .from = reader.begin(), .to = reader.end()});
  std::vector<Line> lines;
  for (auto moment = reader.next(); !moment.empty(); moment = reader.next()) {
    for (const record::RecordedMessage& message : moment) {
      const MessageInfo& info = message.info;
      lines.push_back({info.sequence, info.publish_time, info.origin.taken, info.origin.root,
                       info.origin.held, message.step,
                       std::string(mcap::text_of(mcap::Bytes(message.data)))});
    }
  }
  return lines;
}

/// A message for `write`.
struct Written {
  std::string topic;
  std::uint32_t sequence;
  std::uint64_t time_ns;
  std::int64_t value;
  std::uint64_t published_ns = 0;  ///< 0: at that time.
  std::string data = {};           ///< Empty: the value.
};

/// A file with these messages, a chunk for each, by `publisher`, or by somebody who wrote no names.
std::filesystem::path write(const std::filesystem::path& file, const std::string& publisher,
                            const std::vector<Written>& messages,
                            const std::map<std::string, std::string>& end = {},
                            const std::map<std::string, std::string>& run = {}) {
  mcap::FileSink sink(file);
  mcap::Writer writer(sink, {.library = "test"});
  writer.add(mcap::Schema{.id = 1,
                          .name = "google.protobuf.Int64Value",
                          .encoding = "protobuf",
                          .data = record::descriptor_set_of(*Int64Value::descriptor())});
  std::map<std::string, std::uint16_t> ids;
  for (const Written& message : messages) {
    const auto [id, is_new] =
        ids.try_emplace(message.topic, static_cast<std::uint16_t>(ids.size() + 1));
    if (is_new) {
      mcap::Channel channel{.id = id->second,
                            .schema_id = 1,
                            .topic = message.topic,
                            .message_encoding = "protobuf",
                            .metadata = {}};
      if (!publisher.empty()) {
        channel.metadata["publisher"] = publisher;
      }
      writer.add(channel);
    }
    Int64Value number;
    number.set_value(message.value);
    const std::string bytes = message.data.empty() ? number.SerializeAsString() : message.data;
    const std::uint64_t published_ns =
        message.published_ns == 0 ? message.time_ns : message.published_ns;
    writer.write(mcap::Message{{.channel_id = id->second,
                                .sequence = message.sequence,
                                .log_time_ns = message.time_ns,
                                .publish_time_ns = published_ns},
                               mcap::bytes_of(bytes)});
    writer.flush();
  }
  if (!run.empty()) {
    writer.write(mcap::Metadata{.name = "fastcycle.run", .metadata = run});
  }
  writer.write(mcap::Metadata{.name = "fastcycle.end", .metadata = end});
  writer.close();
  return file;
}

/// Copies a recording without what it says of its messages.
std::filesystem::path without_infos(const std::filesystem::path& from,
                                    const std::filesystem::path& to) {
  const mcap::FileSource source(from);
  const mcap::Reader reader(source);
  mcap::FileSink sink(to);
  mcap::Writer writer(sink, {.library = "test"});
  for (const auto& [id, schema] : reader.definitions().schemas()) {
    writer.add(schema);
  }
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    writer.write(reader.read(index));
  }
  mcap::MessageReader messages = reader.messages();
  while (const std::optional<mcap::StoredMessage> message = messages.next()) {
    if (message->channel->topic != "fastcycle/message_infos") {
      writer.add(*message->channel);
      writer.write(*message);
    }
  }
  writer.close();
  return to;
}

class Replays : public testing::Test {
 protected:
  Replays() {
    classes_.with<Driver>("driver").with<Doubler>("doubler").with<Mixer>("mixer").with<Listener>(
        "listener");
  }

  static ClockOptions simulated(unsigned workers = 1) {
    return {.is_simulated = true, .workers = workers};
  }

  [[nodiscard]] static config::RecordDescription recording(const std::filesystem::path& file) {
    config::RecordDescription record;
    record.file = file;
    return record;
  }

  /// Runs the application as it is.
  std::filesystem::path record(const char* text, const std::string& name,
                               const ClockOptions& clock = simulated()) {
    const std::filesystem::path file = folder_ / name;
    config::Problems problems;
    Application application(describe_text(text, problems), clock);
    application.record(recording(file));
    application.build(classes_, problems, ConstructorFault::kFault);
    EXPECT_FALSE(problems.has_errors());
    application.start();
    application.run(std::nullopt);
    application.stop();
    return file;
  }

  /// Prepares a replay; the problems are in `problems_`.
  std::unique_ptr<Replay> prepare(const char* text, ReplayOptions options) {
    problems_ = {};
    config::Problems ignored;
    return prepare_replay(std::move(options), describe_text(text, ignored), classes_, problems_);
  }

  /// Replays, and records that into the file `name`.
  EndReason replay(const char* text, ReplayOptions options, const ClockOptions& clock,
                   const std::string& name = {}, std::optional<Duration> limit = {}) {
    replay_ = prepare(text, std::move(options));
    if (replay_ == nullptr) {
      ADD_FAILURE() << said();
      return EndReason::kNone;
    }
    Application application(replay_->description(), clock);
    application.replay(*replay_);
    if (!name.empty()) {
      application.record(recording(folder_ / name));
    }
    config::Problems problems;
    application.build(*replay_, problems, ConstructorFault::kFault);
    build_problems_ = config::text_of(problems);
    EXPECT_FALSE(problems.has_errors()) << build_problems_;
    application.start();
    const EndReason reason = application.run(limit);
    application.stop();
    report_ = make_report(application, Duration(1s));
    return reason;
  }

  [[nodiscard]] std::string said() const {
    std::string text;
    for (const config::Problem& problem : problems_.all()) {
      text += config::to_string(problem) + "\n";
    }
    return text;
  }

  [[nodiscard]] ReportValue result(const std::string& name) const {
    for (const ResultReport& one : report_.results) {
      if (one.name == name) {
        return one.value;
      }
    }
    return std::string("none");
  }

  config::TestFolder folder_;
  TestClasses classes_;
  config::Problems problems_;
  std::string build_problems_;  ///< Of the replay's application.
  std::unique_ptr<Replay> replay_;
  RunReport report_;
};

// ---- Simulated time: the same again ----

TEST_F(Replays, TheSameInputsInTheSameRoundsGiveTheSameOutputs) {
  const auto file = record(kWhole, "a.mcap");
  const std::vector<Line> before = lines_of(file, "mixed");
  ASSERT_GT(before.size(), 300U);

  for (const unsigned workers : {1U, 2U}) {
    const std::string name = "b" + std::to_string(workers) + ".mcap";
    EXPECT_EQ(replay(kWhole, {.files = {file}, .into = {"mixer"}}, simulated(workers), name),
              EndReason::kSourcesFinished);

    EXPECT_EQ(difference(before, lines_of(folder_ / name, "mixed")), "") << workers << " workers";
    EXPECT_EQ(difference(lines_of(file, "numbers"), lines_of(folder_ / name, "numbers")), "");
    EXPECT_EQ(difference(lines_of(file, "doubled"), lines_of(folder_ / name, "doubled")), "");
    EXPECT_EQ(difference(lines_of(file, "map"), lines_of(folder_ / name, "map")), "");
  }
}

TEST_F(Replays, StartsAreCountedInTheirOrderNotInThatOfTheFile) {
  constexpr const char* kBackwards = R"({"name": "t", "topics": {"map": {"latched": 1}},
    "components": [
      {"name": "doubler", "library": "doubler", "after": ["mixer"]},
      {"name": "mixer", "library": "mixer", "after": ["driver"]},
      {"name": "driver", "library": "driver", "serve_period_ms": 1}]})";
  const auto file = record(kBackwards, "a.mcap");
  const std::vector<Line> before = lines_of(file, "mixed");
  ASSERT_GT(before.size(), 300U);

  replay(kBackwards, {.files = {file}, .into = {"mixer"}}, simulated(), "b.mcap");

  EXPECT_EQ(difference(before, lines_of(folder_ / "b.mcap", "mixed")), "");
}

TEST_F(Replays, SwitchesOfModeThatNobodyAsksForAgainAreReported) {
  const auto file =
      write(folder_ / "a.mcap", "driver",
            {{.topic = "numbers", .sequence = 1, .time_ns = 1'000'000'000, .value = 1}},
            {{"switch.0.time_ns", "1000000000"},
             {"switch.0.to", "one"},
             {"switch.0.by", "listener"},
             {"switch.1.time_ns", "1500000000"},
             {"switch.1.to", "two"},
             {"switch.1.by", "driver"},
             {"switch.2.time_ns", "1600000000"},
             {"switch.2.to", "one"},
             {"switch.2.by", ""}});
  EXPECT_NE(prepare(kListening, {.files = {file}}), nullptr);
  EXPECT_NE(said().find("in the recorded run component \"driver\" asked for the mode \"two\" at "
                        "0.500 s, and is not there to ask again: 2 of its switches are not "
                        "repeated"),
            std::string::npos)
      << said();
}

/// Multiplies numbers by a factor that another component changes.
class Tuned final : public Component {
 public:
  explicit Tuned(Context& context)
      : Component(context),
        factor_(context.param<std::int64_t>("factor", {.fallback = 1, .is_tunable = true})),
        mixed_(context.create_publisher<Int64Value>("mixed")) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      auto out = mixed_.loan();
      out->set_value(factor_.get() * number.value());
      mixed_.publish(std::move(out));
    });
  }

 private:
  Param<std::int64_t> factor_;
  Publisher<Int64Value> mixed_;
};

/// Asks for another factor at each fifth number.
class Tuner final : public Component {
 public:
  explicit Tuner(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      if (number.value() % 5 == 0) {
        this->context().change_params(
            {{"tuned.factor", param_json(number.value())}},
            [this](const ParamsResult& result) { changed_ += result.has_changed() ? 1 : 0; });
      }
    });
  }
  void stop() override { report("changed", changed_); }

 private:
  std::int64_t changed_ = 0;
};

TEST_F(Replays, ChangesOfParamsThatComponentsAskForAreMadeAgain) {
  constexpr const char* kTuned = R"({"name": "t", "components": [
    {"name": "driver", "library": "driver", "serve_period_ms": 1},
    {"name": "tuned", "library": "tuned"}, {"name": "tuner", "library": "tuner"}]})";
  classes_.with<Tuned>("tuned").with<Tuner>("tuner");
  const auto file = record(kTuned, "a.mcap");
  const std::vector<Line> before = lines_of(file, "mixed");
  ASSERT_EQ(before.size(), 40U);

  EXPECT_EQ(replay(kTuned, {.files = {file}, .into = {"tuned", "tuner"}}, simulated(2), "b.mcap"),
            EndReason::kSourcesFinished);
  EXPECT_EQ(difference(before, lines_of(folder_ / "b.mcap", "mixed")), "");
  EXPECT_EQ(result("changed"), ReportValue(std::int64_t{8}));

  // Without who is changed, who asks goes on as before; without who asks, nothing is changed.
  replay(kTuned, {.files = {file}, .into = {"tuner"}}, simulated());
  EXPECT_EQ(result("changed"), ReportValue(std::int64_t{8}));
  replay(kTuned, {.files = {file}, .into = {"tuned"}}, simulated(), "c.mcap");
  EXPECT_NE(difference(before, lines_of(folder_ / "c.mcap", "mixed")), "");

  const mcap::FileSource source(file);
  const mcap::Reader reader(source);
  std::map<std::string, std::string> end;
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    if (index.name == "fastcycle.end") {
      end = reader.read(index).metadata;
    }
  }
  EXPECT_THAT(end["params.1"], HasSubstr(R"("by":"tuner","set":{"tuned.factor":5}})"));
  EXPECT_TRUE(end.contains("params.8"));
}

// Were it not so, the first test would say nothing of rounds.
TEST_F(Replays, TheMixerNoticesInWhichRoundAMessageComes) {
  const auto file = record(kWhole, "a.mcap");
  const auto copy = without_infos(file, folder_ / "copy.mcap");

  replay(kWhole, {.files = {copy}, .into = {"mixer"}}, simulated(), "b.mcap");

  const std::vector<Line> before = lines_of(file, "mixed");
  const std::vector<Line> after = lines_of(folder_ / "b.mcap", "mixed");
  EXPECT_GT(after.size(), 300U);
  EXPECT_NE(difference(before, after), "");
}

TEST_F(Replays, AReplayCanBeReplayed) {
  const auto file = record(kWhole, "a.mcap");
  replay(kWhole, {.files = {file}, .into = {"mixer"}}, simulated(), "b.mcap");

  replay(kWhole, {.files = {folder_ / "b.mcap"}, .into = {"mixer"}}, simulated(), "c.mcap");

  EXPECT_EQ(difference(lines_of(file, "mixed"), lines_of(folder_ / "c.mcap", "mixed")), "");
}

TEST_F(Replays, WithoutAWordDriversAreReplacedAndAllElseRuns) {
  const auto file = record(kWhole, "a.mcap");

  replay(kWhole, {.files = {file}}, simulated(), "b.mcap");

  EXPECT_EQ(replay_->plan().running, (std::set<std::string>{"doubler", "mixer"}));
  EXPECT_EQ(difference(lines_of(file, "mixed"), lines_of(folder_ / "b.mcap", "mixed")), "");
  EXPECT_EQ(difference(lines_of(file, "doubled"), lines_of(folder_ / "b.mcap", "doubled")), "");
}

TEST_F(Replays, TheReportSaysWhatWasFedAndWhatNot) {
  const auto file = record(kWhole, "a.mcap");

  replay(kWhole, {.files = {file}, .into = {"mixer"}}, simulated());

  ASSERT_TRUE(report_.replay);
  EXPECT_THAT(report_.replay->files, ElementsAre(file.string()));
  EXPECT_EQ(report_.replay->from_s, 0);
  EXPECT_DOUBLE_EQ(report_.replay->to_s, 0.020);
  for (const ReplayReport::Stream& stream : report_.replay->streams) {
    if (stream.topic == "numbers") {
      EXPECT_EQ(stream.component, "driver");
      EXPECT_EQ(stream.messages, 40U);
    } else if (stream.topic == "mixed") {
      EXPECT_EQ(stream.component, "");
      EXPECT_THAT(stream.reason, HasSubstr("no component that runs subscribes"));
    }
  }
  ASSERT_EQ(report_.components.size(), 3U);
  EXPECT_TRUE(report_.components[0].is_replayed);
  EXPECT_FALSE(report_.components[1].is_replayed);
  const std::string table = to_table(report_);
  EXPECT_THAT(table, HasSubstr("REPLAYED 82 messages of 3 topics"));
  EXPECT_THAT(table, HasSubstr("replayed"));
  EXPECT_THAT(table, Not(HasSubstr("DOES NOT ADD UP")));
}

TEST_F(Replays, WhoIsNotNeededIsNotThere) {
  const auto file = record(kWhole, "a.mcap");

  replay(kWhole, {.files = {file}, .into = {"doubler"}}, simulated());

  ASSERT_EQ(report_.components.size(), 2U);
  EXPECT_EQ(report_.components[0].name, "driver");
  EXPECT_EQ(report_.components[1].name, "doubler");
}

// ---- Parts ----

TEST_F(Replays, APartHasWhatWasLatchedBeforeIt) {
  const auto file = record(kWhole, "a.mcap");

  replay(kWhole, {.files = {file}, .into = {"mixer"}, .start = 10ms, .end = 15ms}, simulated(),
         "b.mcap");

  const std::vector<Line> numbers = lines_of(folder_ / "b.mcap", "numbers");
  ASSERT_EQ(numbers.size(), 12U);
  EXPECT_EQ(numbers.front().sequence, 19U);
  EXPECT_EQ(numbers.front().published, kSimulatedStart + 10ms);
  EXPECT_EQ(numbers.back().published, kSimulatedStart + 15ms);
  ASSERT_EQ(report_.replay->streams.size(), 4U);
  for (const ReplayReport::Stream& stream : report_.replay->streams) {
    if (stream.topic == "map") {
      EXPECT_EQ(stream.messages, 1U);
    }
  }
}

TEST_F(Replays, ALoopGoesOnWhereItEnded) {
  const auto file = record(kListening, "a.mcap");

  EXPECT_EQ(replay(kListening, {.files = {file}, .is_looped = true}, simulated(), {}, 50ms),
            EndReason::kTimeOver);

  EXPECT_EQ(result("received"), ReportValue(std::int64_t{100}));
  EXPECT_EQ(result("rising"), ReportValue(true));
}

TEST_F(Replays, SeveralFilesAreOneRecordingAndWhatIsRepeatedComesOnce) {
  const auto first = write(folder_ / "drive_0001.mcap", "driver",
                           {{"numbers", 1, 1'000, 10}, {"numbers", 2, 2'000, 20}});
  // It repeats a latched message, and began before the first one was closed.
  const auto second = write(folder_ / "drive_0002.mcap.active", "driver",
                            {{"numbers", 2, 2'500, 20, 2'000}, {"numbers", 3, 2'500, 30}});

  replay(kListening, {.files = {first, second}}, simulated());

  EXPECT_EQ(result("received"), ReportValue(std::int64_t{3}));
  EXPECT_EQ(result("sum"), ReportValue(std::int64_t{60}));
  EXPECT_EQ(result("rising"), ReportValue(true));
}

// Live, components take time to start, and timers start after them.
TEST_F(Replays, TimersStartWhenTheyDidThen) {
  const auto file = write(
      folder_ / "a.mcap", "driver", {{"numbers", 1, 1'000'000, 1}, {"numbers", 2, 5'000'000, 2}},
      {{"time_ns", "20000000"}, {"timers_ns", "3000000"}, {"reason", "stopped on request"}});
  const char* serving = R"({"name": "t", "components": [
    {"name": "driver", "library": "driver", "serve_period_ms": 1},
    {"name": "listener", "library": "listener", "serve_period_ms": 10}]})";

  EXPECT_EQ(replay(serving, {.files = {file}}, simulated()), EndReason::kSourcesFinished);

  EXPECT_EQ(result("start_ns"), ReportValue(std::int64_t{3'000'000}));
  EXPECT_EQ(result("first_tick_ns"), ReportValue(std::int64_t{13'000'000}));
  EXPECT_EQ(result("received"), ReportValue(std::int64_t{2}));
}

TEST_F(Replays, ALiveRecordingSaysWhenItsTimersStarted) {
  const auto file = record(kListening, "a.mcap", {});
  const Time started = record::RecordingReader({file}).begin_of_timers();
  EXPECT_GT(started, record::RecordingReader({file}).begin());

  replay(kListening, {.files = {file}}, simulated());

  EXPECT_EQ(result("start_ns"), ReportValue(std::int64_t{base::to_ns(started)}));
  EXPECT_EQ(result("received"), ReportValue(std::int64_t{40}));
}

// Losses of a live recording.
TEST_F(Replays, GapsInSequencesStayAsTheyWere) {
  const auto file =
      write(folder_ / "gaps.mcap", "driver", {{"numbers", 5, 1'000, 1}, {"numbers", 9, 2'000, 2}});

  replay(kListening, {.files = {file}}, simulated(), "b.mcap");

  const std::vector<Line> after = lines_of(folder_ / "b.mcap", "numbers");
  ASSERT_EQ(after.size(), 2U);
  EXPECT_EQ(after[0].sequence, 5U);
  EXPECT_EQ(after[1].sequence, 9U);
}

// ---- Other files ----

TEST_F(Replays, AFileOfOthersGoesWhereARemapSays) {
  const auto file = write(folder_ / "foreign.mcap", "",
                          {{"/data", 0, 5'000'000'000, 1, 4'000'000'000},
                           {"/data", 0, 5'001'000'000, 2, 4'000'000'000},
                           {"/data", 0, 5'002'000'000, 3, 4'000'000'000}});

  EXPECT_EQ(replay(kListening, {.files = {file}, .remap = {{"/data", "numbers"}}}, simulated()),
            EndReason::kSourcesFinished);

  EXPECT_EQ(result("received"), ReportValue(std::int64_t{3}));
  EXPECT_EQ(result("sum"), ReportValue(std::int64_t{6}));
  EXPECT_EQ(result("rising"), ReportValue(true));
  EXPECT_EQ(replay_->plan().streams.front().component, "driver");
}

TEST_F(Replays, WhoPublishedAndIsNotThereGetsAPlace) {
  const auto file = record(kWhole, "a.mcap");
  const char* alone =
      R"({"name": "t", "components": [{"name": "listener", "library": "listener"}]})";

  replay(alone, {.files = {file}}, simulated());

  EXPECT_EQ(result("received"), ReportValue(std::int64_t{40}));
  ASSERT_EQ(report_.components.size(), 2U);
  EXPECT_EQ(report_.components[1].name, "driver");
}

// What `fastcycle topic pub` sends while a driver publishes on the same topic.
TEST_F(Replays, WhatAToolPublishedThenIsPublishedBesideItsDriver) {
  const auto driver = write(folder_ / "driver.mcap", "driver",
                            {{"numbers", 1, 1'000, 1}, {"numbers", 2, 3'000, 2}});
  const auto tool = write(folder_ / "tool.mcap", "fastcycle/inspect", {{"numbers", 1, 2'000, 100}});

  EXPECT_EQ(replay(kListening, {.files = {driver, tool}}, simulated()),
            EndReason::kSourcesFinished);

  EXPECT_EQ(result("received"), ReportValue(std::int64_t{3}));
  EXPECT_EQ(result("sum"), ReportValue(std::int64_t{103}));
}

TEST_F(Replays, OfOneComponentDoNotJudgeChainsThatOthersWouldEnd) {
  std::string text = kWhole;
  text.insert(1, R"("chains": [
    {"name": "all", "from": "numbers", "to": "doubled", "deadline_ms": 50},
    {"name": "first", "from": "numbers", "to": "numbers", "deadline_ms": 50}],)");
  text.replace(text.find(R"("to": "numbers")"), 15, R"("to": "mixed")");
  text.insert(text.rfind(']'), R"(, {"name": "listener", "library": "mixed_listener"})");
  classes_.with<MixedListener>("mixed_listener");
  const auto file = record(text.c_str(), "a.mcap");

  EXPECT_EQ(replay(text.c_str(), {.files = {file}, .into = {"mixer", "listener"}}, simulated()),
            EndReason::kSourcesFinished);

  ASSERT_EQ(report_.chains.size(), 2U);
  EXPECT_FALSE(report_.chains[0].is_judged);
  EXPECT_TRUE(report_.chains[1].is_judged);
  EXPECT_GT(report_.chains[1].count, 0U);
  EXPECT_THAT(build_problems_,
              HasSubstr("the chain \"all\" is not checked in this replay: it ends at "
                        "\"doubled\", which nothing of \"numbers\" reaches"));
  EXPECT_THAT(to_table(report_),
              HasSubstr("not checked: this replay executes too little of the chain"));
}

// ---- Live ----

TEST_F(Replays, LiveEveryMessageComesAtItsTimeOfThen) {
  const auto file = record(kListening, "a.mcap");

  EXPECT_EQ(replay(kListening, {.files = {file}}, {}, "b.mcap"), EndReason::kSourcesFinished);

  EXPECT_EQ(result("received"), ReportValue(std::int64_t{40}));
  EXPECT_EQ(result("rising"), ReportValue(true));
  ASSERT_TRUE(report_.replay->worst_lateness_us);
  EXPECT_GE(*report_.replay->worst_lateness_us, 0.0);
  const std::vector<Line> before = lines_of(file, "numbers");
  const std::vector<Line> after = lines_of(folder_ / "b.mcap", "numbers");
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(after[i].sequence, before[i].sequence);
    EXPECT_EQ(after[i].published, before[i].published);
    EXPECT_EQ(after[i].taken, before[i].taken);
    EXPECT_EQ(after[i].data, before[i].data);
  }
}

TEST_F(Replays, ALiveReplayCanBeStoppedInTheMiddle) {
  const auto file = record(kListening, "a.mcap");
  replay_ = prepare(kListening, {.files = {file}});
  ASSERT_NE(replay_, nullptr) << said();
  // A thousand times slower: it would take 20 s.
  Application application(replay_->description(), {.rate = 1e-3});
  application.replay(*replay_);
  config::Problems problems;
  application.build(*replay_, problems, ConstructorFault::kFault);
  application.start();
  application.request_end(EndReason::kRequested);

  EXPECT_EQ(application.run(std::nullopt), EndReason::kRequested);
  application.stop();

  EXPECT_LT(ledger_of(application, "numbers", "listener").published, 40U);
}

// ---- At the pace of the wall ----

TEST_F(Replays, APaceThatIsPausedLetsNothingComeButStepByStep) {
  const auto file = record(kListening, "a.mcap");
  replay_ = prepare(kListening, {.files = {file}});
  ASSERT_NE(replay_, nullptr) << said();
  WallPace pace(1000.0);
  Application application(replay_->description(), simulated());
  application.replay(*replay_);
  application.set_pace(pace);
  config::Problems problems;
  application.build(*replay_, problems, ConstructorFault::kFault);
  pace.set_paused(true);
  application.start();
  std::thread control([&] {
    const auto received = [&] { return ledger_of(application, "numbers", "listener").delivered; };
    const auto wait_for = [&](std::uint64_t count) {
      const auto limit = std::chrono::steady_clock::now() + 60s;
      while (received() < count && std::chrono::steady_clock::now() < limit) {
        std::this_thread::yield();
      }
      EXPECT_EQ(received(), count);
    };
    pace.step();
    wait_for(2);
    pace.step();
    wait_for(4);
    pace.set_paused(false);
  });

  EXPECT_EQ(application.run(std::nullopt), EndReason::kSourcesFinished);
  control.join();
  application.stop();

  EXPECT_EQ(ledger_of(application, "numbers", "listener").delivered, 40U);
}

// ---- What is wrong ----

TEST_F(Replays, AMissingFileIsAnErrorWithTheNameOfTheUnfinishedOne) {
  EXPECT_EQ(prepare(kListening, {.files = {folder_ / "none.mcap"}}), nullptr);
  EXPECT_THAT(said(), HasSubstr("none.mcap"));

  std::ofstream(folder_ / "drive.mcap.active") << "x";
  EXPECT_EQ(prepare(kListening, {.files = {folder_ / "drive.mcap"}}), nullptr);
  EXPECT_THAT(said(), HasSubstr("it is " + (folder_ / "drive.mcap.active").string()));
}

TEST_F(Replays, RunsThatOverlapInTimeAndPublishersAreAnError) {
  const std::map<std::string, std::string> one{{"start_ns", "900"}};
  const std::map<std::string, std::string> another{{"start_ns", "1500"}};
  const auto begin = write(folder_ / "a_0001.mcap", "driver",
                           {{"numbers", 1, 1'000, 1}, {"numbers", 2, 2'000, 2}}, {}, one);
  const auto end = write(folder_ / "a_0002.mcap", "driver",
                         {{"numbers", 3, 2'000, 3}, {"numbers", 4, 4'000, 4}}, {}, one);
  const auto other = write(folder_ / "b.mcap", "driver",
                           {{"numbers", 1, 1'500, 5}, {"numbers", 2, 1'700, 6}}, {}, another);
  const auto tool =
      write(folder_ / "c.mcap", "fastcycle/inspect", {{"numbers", 1, 1'600, 7}}, {}, another);

  EXPECT_EQ(prepare(kListening, {.files = {begin, end, other}}), nullptr);
  EXPECT_THAT(said(), HasSubstr(begin.string() + " and " + other.string() +
                                " are of different runs at the same time, and \"driver\" "
                                "published \"numbers\" in both"));

  EXPECT_NE(prepare(kListening, {.files = {begin, end}}), nullptr) << said();
  EXPECT_NE(prepare(kListening, {.files = {end, other}}), nullptr) << "one after the other";
  EXPECT_NE(prepare(kListening, {.files = {begin, tool}}), nullptr) << said();
}

TEST_F(Replays, WhatIsNoRecordingIsAnError) {
  std::ofstream(folder_ / "text.mcap") << "this is no recording, but long enough to look like one";
  EXPECT_EQ(prepare(kListening, {.files = {folder_ / "text.mcap"}}), nullptr);
  EXPECT_THAT(said(), HasSubstr("text.mcap"));
}

TEST_F(Replays, APartWithoutMessagesIsAnError) {
  const auto file = record(kListening, "a.mcap");

  EXPECT_EQ(prepare(kListening, {.files = {file}, .start = 5s}), nullptr);
  EXPECT_THAT(said(), HasSubstr("nothing to feed from 5 s"));
}

TEST_F(Replays, AFileThatEndsInTheMiddleIsReadUpToThere) {
  const auto file = record(kListening, "a.mcap");
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 40);

  EXPECT_EQ(replay(kListening, {.files = {file}}, simulated()), EndReason::kSourcesFinished);

  EXPECT_THAT(said(), HasSubstr("what is before that is read"));
  EXPECT_EQ(result("received"), ReportValue(std::int64_t{40}));
}

TEST_F(Replays, DamageInTheMiddleEndsTheRunAndCountsAsFailure) {
  // A field without its value.
  const auto file = write(folder_ / "damaged.mcap", "driver",
                          {{"numbers", 1, 1'000, 1}, {"numbers", 2, 2'000, 2, 0, "\x08"}});

  for (const bool is_simulated : {true, false}) {
    const EndReason reason =
        replay(kListening, {.files = {file}}, {.is_simulated = is_simulated, .workers = 1});

    EXPECT_EQ(reason, EndReason::kReplayFailed);
    EXPECT_TRUE(is_failure(reason));
    EXPECT_EQ(result("received"), ReportValue(std::int64_t{1}));
  }
}

}  // namespace
}  // namespace fastcycle::host
