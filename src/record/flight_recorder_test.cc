#include "record/flight_recorder.h"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "broker/publisher_core.h"
#include "broker/topics.h"
#include "log/log.pb.h"
#include "mcap/reader.h"

namespace fastcycle::record {
namespace {

using google::protobuf::BytesValue;
using google::protobuf::Int64Value;
using testing::ElementsAre;
using testing::HasSubstr;
using namespace std::chrono_literals;

/// A component that publishes, with a flight recorder on a clock that the test moves.
class Publishing {
 public:
  Publishing(base::Clock& clock, FlightOptions options)
      : clock_(clock), recorder_(std::move(options), clock) {
    owner_.name = "publisher";
    owner_.clock = &clock_;
    owner_.enter();
    recorder_.on_news = [this](bool, const std::string& text) {
      const std::lock_guard lock(news_mutex_);
      news_ += text + "\n";
    };
  }

  template <typename T>
  detail::PublisherCore& publisher(const std::string& topic) {
    return topics_.add_publisher(topic, owner_, T::default_instance(), nullptr, false);
  }

  void open() {
    recorder_.tap(topics_);
    topics_.connect_all();
    recorder_.open({.facts = {{"application", "test"}}, .application = "{}"});
  }
  void start() {
    open();
    recorder_.start({});
  }

  template <typename T>
  void publish(detail::PublisherCore& publisher, const decltype(T().value())& value) {
    owner_.publish_count = 0;  // As in an activation of its own: what came back is used again.
    owner_.now = clock_.now();
    publisher.owner.enter();
    detail::Envelope* loan = publisher.loan(true);
    static_cast<T&>(*loan->own).set_value(value);
    publisher.publish(loan, {});
  }

  detail::Topics& topics() { return topics_; }
  FlightRecorder& recorder() { return recorder_; }
  [[nodiscard]] std::string news() {
    const std::lock_guard lock(news_mutex_);
    return news_;
  }

 private:
  base::Clock& clock_;
  detail::PublishingComponent owner_;
  detail::Topics topics_;
  std::mutex news_mutex_;
  std::string news_;
  FlightRecorder recorder_;
};

/// What a dump has.
struct Content {
  std::vector<std::int64_t> numbers;       ///< Of the topic "numbers", by their log times.
  std::vector<std::int64_t> log_times_ns;  ///< Of these.
  std::vector<std::uint64_t> info_sequences;
  std::map<std::string, std::map<std::string, std::string>> metadata;  ///< By name, the last.
  std::size_t attachments = 0;
};

template <typename T>
T parsed(mcap::Bytes bytes) {
  T message;
  EXPECT_TRUE(message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
  return message;
}

Content content_of(const std::filesystem::path& file) {
  Content content;
  const mcap::FileSource source(file);
  const mcap::Reader reader(source);
  EXPECT_FALSE(reader.problem());
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    content.metadata[index.name] = reader.read(index).metadata;
  }
  content.attachments = reader.attachments().size();
  mcap::MessageReader messages = reader.messages();
  while (const std::optional<mcap::StoredMessage> message = messages.next()) {
    if (message->channel->topic == "numbers") {
      content.numbers.push_back(parsed<Int64Value>(message->data).value());
      content.log_times_ns.push_back(static_cast<std::int64_t>(message->log_time_ns));
      EXPECT_EQ(message->channel->metadata.at("publisher"), "publisher");
    } else if (message->channel->topic == "fastcycle/message_infos") {
      const auto infos = parsed<log::MessageInfos>(message->data);
      for (const log::MessageInfo& info : infos.infos()) {
        content.info_sequences.push_back(info.sequence());
      }
    }
  }
  return content;
}

std::vector<std::int64_t> numbers_between(std::int64_t first, std::int64_t last) {
  std::vector<std::int64_t> numbers;
  for (std::int64_t number = first; number <= last; ++number) {
    numbers.push_back(number);
  }
  return numbers;
}

class Flight : public testing::Test {
 protected:
  void SetUp() override {
    std::string name =
        (std::filesystem::temp_directory_path() / "fastcycle_flight_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] FlightOptions options() const {
    return {.file = folder_ / "drive.ring", .bytes = 1 << 20, .before = 100ms, .after = 50ms};
  }

  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      names.push_back(entry.path().filename().string());
    }
    std::ranges::sort(names);
    return names;
  }

  std::filesystem::path folder_;
};

/// In simulated time, which the test moves: one number every 10 ms, from 1 on.
class SimulatedFlight : public Flight {
 protected:
  void start(const FlightOptions& options) {
    flight_ = std::make_unique<Publishing>(clock_, options);
    numbers_ = &flight_->publisher<Int64Value>("numbers");
    flight_->start();
  }

  /// Publishes up to `number`, which is published at `number` times 10 ms.
  void publish_until(std::int64_t number) {
    while (next_ <= number) {
      clock_.set_simulated(kSimulatedStart + next_ * 10ms);
      flight_->publish<Int64Value>(*numbers_, next_++);
      flight_->recorder().take(0);
    }
  }
  void publish_until(std::int64_t number, const std::string& reason) {
    publish_until(number);
    flight_->recorder().trigger(reason, "limiter", "words");
  }

  [[nodiscard]] FlightReport report() { return flight_->recorder().report(); }

  base::Clock clock_ = base::Clock::simulated();
  std::unique_ptr<Publishing> flight_;
  detail::PublisherCore* numbers_ = nullptr;
  std::int64_t next_ = 1;
};

TEST_F(SimulatedFlight, DumpHasExactlyTheMessagesOfTheWindow) {
  start(options());
  publish_until(50, "Hard braking!");
  publish_until(55);
  EXPECT_TRUE(report().dumps.empty());  // What comes in the 50 ms after it belongs to it.
  publish_until(80);
  flight_->recorder().stop();

  const FlightReport report = this->report();
  ASSERT_EQ(report.dumps.size(), 1U);
  const FlightDump& dump = report.dumps[0];
  EXPECT_EQ(dump.problem, "");
  EXPECT_EQ(dump.file.filename(), "drive_2000-01-01_00-00-00_hard_braking.mcap");
  EXPECT_EQ(dump.messages, 16U);
  EXPECT_EQ(dump.missing, 0U);
  const Content content = content_of(dump.file);
  EXPECT_EQ(content.numbers, numbers_between(40, 55));
  EXPECT_EQ(content.attachments, 1U);
  EXPECT_EQ(content.metadata.at("fastcycle.run").at("application"), "test");
  const auto& facts = content.metadata.at("fastcycle.dump");
  EXPECT_EQ(facts.at("reason"), "Hard braking!");
  EXPECT_EQ(facts.at("component"), "limiter");
  EXPECT_EQ(facts.at("detail"), "words");
  EXPECT_EQ(facts.at("trigger_ns"), std::to_string(base::to_ns(kSimulatedStart + 500ms)));
  EXPECT_EQ(facts.at("messages"), "16");
  EXPECT_EQ(facts.at("missing"), "0");
  EXPECT_EQ(facts.at("triggers"), "1");
  EXPECT_EQ(report.messages, 80U);
  EXPECT_THAT(flight_->news(),
              HasSubstr("hard_braking.mcap (16 messages; Hard braking! of limiter)"));
}

TEST_F(SimulatedFlight, DumpSaysOfAMessageWhatItsRecordHasNoPlaceFor) {
  start(options());
  publish_until(3);
  clock_.set_simulated(kSimulatedStart + 40ms);
  flight_->publish<Int64Value>(*numbers_, next_++);
  flight_->recorder().take(7);  // In a later round of its moment.
  publish_until(6, "infos");
  flight_->recorder().stop();

  const Content content = content_of(report().dumps.at(0).file);
  EXPECT_EQ(content.numbers, numbers_between(1, 6));
  EXPECT_THAT(content.info_sequences, ElementsAre(4U));
}

TEST_F(SimulatedFlight, TriggersWithinTheWindowJoinIntoOneDump) {
  start(options());
  publish_until(30, "first");
  publish_until(34, "second");
  publish_until(38, "third");
  publish_until(60, "fourth");  // After the end of the dump of the others.
  publish_until(90);
  flight_->recorder().stop();

  const std::vector<FlightDump> dumps = report().dumps;
  ASSERT_EQ(dumps.size(), 2U);
  EXPECT_EQ(dumps[0].trigger.reason, "first");
  EXPECT_EQ(dumps[0].trigger_count, 3U);
  EXPECT_EQ(content_of(dumps[0].file).numbers, numbers_between(20, 43));
  EXPECT_THAT(content_of(dumps[0].file).metadata.at("fastcycle.dump").at("trigger.2"),
              HasSubstr("third limiter"));
  EXPECT_EQ(dumps[1].trigger.reason, "fourth");
  EXPECT_EQ(content_of(dumps[1].file).numbers, numbers_between(50, 65));
}

TEST_F(SimulatedFlight, ADumpThatIsExtendedForeverIsWrittenNevertheless) {
  start(options());
  for (std::int64_t number = 30; number <= 60; number += 2) {
    publish_until(number, "again");
  }
  EXPECT_GE(report().dumps.size(), 1U);
  publish_until(90);
  flight_->recorder().stop();

  const std::vector<FlightDump> dumps = report().dumps;
  ASSERT_GE(dumps.size(), 2U);
  EXPECT_EQ(content_of(dumps[0].file).numbers, numbers_between(20, 45));
  std::size_t triggers = 0;
  for (const FlightDump& dump : dumps) {
    triggers += dump.trigger_count;
  }
  EXPECT_EQ(triggers, 16U);
}

TEST_F(SimulatedFlight, WritesSoManyDumpsAndNoMore) {
  start(options());
  for (int i = 0; i < 20; ++i) {
    publish_until(20 * (i + 1), "trouble");
  }
  flight_->recorder().stop();

  EXPECT_EQ(report().dumps.size(), FlightRecorder::kDumpsMax);
  EXPECT_EQ(report().triggers_refused, 4U);
  EXPECT_THAT(flight_->news(), HasSubstr("16 dumps were asked for in this run"));
  EXPECT_EQ(names().size(), FlightRecorder::kDumpsMax + 1);  // And the ring.
}

TEST_F(SimulatedFlight, MoreTriggersAtOnceThanCanWaitAreCounted) {
  start(options());
  publish_until(5);
  for (int i = 0; i < 20; ++i) {
    flight_->recorder().trigger("at once", "", std::string(1000, 'x'));
  }
  flight_->recorder().stop();

  ASSERT_EQ(report().dumps.size(), 1U);
  EXPECT_EQ(report().dumps[0].trigger_count, 16U);
  EXPECT_EQ(report().dumps[0].trigger.detail.size(), 255U);
  EXPECT_EQ(report().triggers_refused, 4U);
}

TEST_F(SimulatedFlight, TheEndOfTheRunEndsADump) {
  start(options());
  publish_until(30, "late");
  publish_until(32);
  flight_->recorder().stop();

  ASSERT_EQ(report().dumps.size(), 1U);
  EXPECT_EQ(content_of(report().dumps[0].file).numbers, numbers_between(20, 32));
}

TEST_F(SimulatedFlight, ARingThatIsTooSmallIsReportedByTheDump) {
  FlightOptions small = options();
  small.bytes = 4096;
  small.before = 10s;
  start(small);
  publish_until(500, "too late");
  publish_until(510);
  flight_->recorder().stop();

  ASSERT_EQ(report().dumps.size(), 1U);
  const FlightDump dump = report().dumps[0];
  const Content content = content_of(dump.file);
  ASSERT_FALSE(content.numbers.empty());
  EXPECT_EQ(content.numbers,
            numbers_between(506 - static_cast<std::int64_t>(content.numbers.size()), 505));
  EXPECT_EQ(dump.missing + dump.messages, 505U);
  EXPECT_EQ(content.metadata.at("fastcycle.dump").at("missing"), std::to_string(dump.missing));
  EXPECT_THAT(flight_->news(), HasSubstr("a larger ring keeps them"));
}

TEST_F(SimulatedFlight, WhatIsLatchedIsInTheDumpHoweverOldItIs) {
  FlightOptions small = options();
  small.bytes = 64 << 10;
  flight_ = std::make_unique<Publishing>(clock_, small);
  flight_->topics().set_options("map", {.latched = 1});
  numbers_ = &flight_->publisher<Int64Value>("numbers");
  detail::PublisherCore& map = flight_->publisher<Int64Value>("map");
  flight_->start();
  flight_->publish<Int64Value>(map, 7);
  flight_->publish<Int64Value>(map, 8);
  publish_until(5000, "much later");
  publish_until(5010);
  flight_->recorder().stop();

  const FlightDump dump = report().dumps.at(0);
  const mcap::FileSource source(dump.file);
  const mcap::Reader reader(source);
  mcap::MessageReader messages = reader.messages({.topics = {"map"}});
  const std::optional<mcap::StoredMessage> message = messages.next();
  ASSERT_TRUE(message);
  EXPECT_EQ(parsed<Int64Value>(message->data).value(), 8);
  EXPECT_EQ(message->log_time_ns,
            static_cast<std::uint64_t>(base::to_ns(kSimulatedStart + 50s - 100ms)));
  EXPECT_LT(message->publish_time_ns, message->log_time_ns);
  EXPECT_FALSE(messages.next());
}

TEST_F(SimulatedFlight, WhatWasLostStandsInTheDump) {
  FlightOptions small = options();
  small.bytes = 64 << 10;
  flight_ = std::make_unique<Publishing>(clock_, small);
  numbers_ = &flight_->publisher<Int64Value>("numbers");
  detail::PublisherCore& images = flight_->publisher<BytesValue>("images");
  flight_->start();
  flight_->publish<BytesValue>(images, std::string(40'000, 'x'));  // Above half of the ring.
  for (int i = 0; i < 600; ++i) {                                  // More than wait in a queue.
    flight_->publish<Int64Value>(*numbers_, i);
  }
  flight_->recorder().take(0);
  publish_until(5, "loss");
  flight_->recorder().stop();

  const FlightReport report = this->report();
  EXPECT_EQ(report.too_large, 1U);
  EXPECT_GE(report.overflow + report.pool, 88U);
  EXPECT_EQ(report.messages + report.overflow + report.pool, 605U);
  const mcap::FileSource source(report.dumps.at(0).file);
  const mcap::Reader reader(source);
  std::map<std::string, std::map<std::string, std::string>> losses;
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    if (index.name == "fastcycle.dump_loss") {
      const auto metadata = reader.read(index).metadata;
      losses[metadata.at("topic")] = metadata;
    }
  }
  EXPECT_EQ(losses.at("images").at("lost.too_large"), "1");
  EXPECT_EQ(losses.at("numbers").at("lost.overflow"), std::to_string(report.overflow));
  EXPECT_EQ(losses.at("numbers").at("lost.pool"), std::to_string(report.pool));
}

TEST_F(SimulatedFlight, KeepsNoMoreThanIsWanted) {
  FlightOptions few = options();
  few.filter.except = {"num*"};
  start(few);
  publish_until(5, "nothing");
  flight_->recorder().stop();
  EXPECT_EQ(report().messages, 0U);
  EXPECT_TRUE(content_of(report().dumps.at(0).file).numbers.empty());
}

TEST_F(SimulatedFlight, ARunThatEndedInOrderLeavesNoCrash) {
  start(options());
  publish_until(5);
  flight_.reset();
  EXPECT_FALSE(dump_crashed(folder_ / "drive.ring").has_value());
  EXPECT_FALSE(dump_crashed(folder_ / "none.ring").has_value());
  EXPECT_THAT(names(), ElementsAre("drive.ring"));
}

TEST_F(SimulatedFlight, GoesOnWhenItsRingIsCutOff) {
  start(options());
  publish_until(10);
  std::filesystem::resize_file(folder_ / "drive.ring", 0);
  publish_until(15, "test");
  flight_->recorder().stop();

  EXPECT_THAT(flight_->news(), HasSubstr("drive.ring: another program cut it off"));
  EXPECT_THAT(report().problem, HasSubstr("cut it off"));
  ASSERT_EQ(report().dumps.size(), 1U);
  EXPECT_EQ(report().dumps[0].problem, "");
  // What came before it was found is gone with the file.
  EXPECT_EQ(content_of(report().dumps[0].file).numbers, numbers_between(12, 15));
}

TEST_F(SimulatedFlight, WhatCannotBeReadIsSetAside) {
  start(options());
  publish_until(5);
  flight_.reset();
  {
    std::fstream file(folder_ / "drive.ring", std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(24);
    file << "nonsense";
  }
  start(options());
  flight_->recorder().stop();

  EXPECT_THAT(flight_->news(), HasSubstr("what it has stays in"));
  ASSERT_EQ(report().dumps.size(), 1U);
  EXPECT_THAT(report().dumps[0].problem, HasSubstr("a header with the right CRC"));
  EXPECT_THAT(names(), ElementsAre("drive.ring", "drive.ring.left"));
}

// ---- Live ----

TEST_F(Flight, ADumpIsWrittenWhileTheApplicationGoesOn) {
  base::Clock clock = base::Clock::live();
  Publishing flight(clock, options());
  detail::PublisherCore& numbers = flight.publisher<Int64Value>("numbers");
  flight.start();
  std::int64_t next = 1;
  const auto publish = [&] {
    flight.publish<Int64Value>(numbers, next++);
    std::this_thread::sleep_for(1ms);
  };
  while (next <= 20) {
    publish();
  }
  const std::int64_t trigger_ns = base::to_ns(clock.now());
  flight.recorder().trigger("now", "", "");
  const std::int64_t limit_ns = base::monotonic_ns() + 30'000'000'000;
  while (flight.news().empty() && base::monotonic_ns() < limit_ns) {
    publish();
  }
  flight.recorder().stop();

  ASSERT_EQ(flight.recorder().report().dumps.size(), 1U) << flight.news();
  const Content content = content_of(flight.recorder().report().dumps[0].file);
  ASSERT_GT(content.numbers.size(), 1U);
  EXPECT_EQ(content.numbers, numbers_between(content.numbers.front(), content.numbers.back()));
  EXPECT_LE(content.log_times_ns.front(), trigger_ns);
  const std::int64_t end_ns = std::stoll(content.metadata.at("fastcycle.dump").at("end_ns"));
  EXPECT_GE(end_ns, trigger_ns + 50'000'000);
  EXPECT_LE(content.log_times_ns.back(), end_ns);
  EXPECT_GT(next, content.numbers.back());
}

TEST_F(Flight, ThreadsMayAskForDumpsAtTheSameTime) {
  base::Clock clock = base::Clock::live();
  Publishing flight(clock, options());
  static_cast<void>(flight.publisher<Int64Value>("numbers"));
  flight.start();
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < 100; ++k) {
        flight.recorder().trigger("many", "component", "words");
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  flight.recorder().stop();

  const FlightReport report = flight.recorder().report();
  std::uint64_t count = report.triggers_refused;
  for (const FlightDump& dump : report.dumps) {
    EXPECT_EQ(dump.trigger.reason, "many");
    EXPECT_EQ(dump.trigger.detail, "words");
    count += dump.trigger_count;
  }
  EXPECT_EQ(count, 400U);
}

// ---- A process that is killed ----

/// The progress of a child, in memory that it shares with the test: of each of the last messages,
/// how often the recorder had come by when it had been published.
struct Progress {
  static constexpr std::uint64_t kCount = 1 << 16;

  std::atomic<std::int64_t> published{0};
  std::atomic<std::uint64_t> wakes[kCount];
};

class SharedProgress {
 public:
  SharedProgress()
      : progress_(new(mmap(nullptr, sizeof(Progress), PROT_READ | PROT_WRITE,
                           MAP_SHARED | MAP_ANONYMOUS, -1, 0)) Progress) {}
  ~SharedProgress() { munmap(progress_, sizeof(Progress)); }
  SharedProgress(const SharedProgress&) = delete;
  SharedProgress& operator=(const SharedProgress&) = delete;

  Progress* operator->() const { return progress_; }
  Progress& operator*() const { return *progress_; }

 private:
  Progress* progress_;
};

/// Publishes numbers, and images of `image_bytes` in between, until it is killed. It is never so
/// far ahead of the recorder that a queue overflows.
[[noreturn]] void fly_until_killed(const FlightOptions& options, std::size_t image_bytes,
                                   Progress& progress) {
  base::Clock clock = base::Clock::live();
  Publishing flight(clock, options);
  detail::PublisherCore& numbers = flight.publisher<Int64Value>("numbers");
  detail::PublisherCore& images = flight.publisher<BytesValue>("images");
  flight.start();
  const FlightRing& ring = *flight.recorder().ring();
  const std::string image(image_bytes, 'x');
  std::uint64_t since_wake = 0;
  std::uint64_t wakes = 0;
  for (std::int64_t number = 1;; ++number) {
    flight.publish<Int64Value>(numbers, number);
    if (number % 16 == 0) {
      flight.publish<BytesValue>(images, image);
    }
    const std::uint64_t now = ring.wakes();
    progress.wakes[static_cast<std::uint64_t>(number) % Progress::kCount].store(now);
    progress.published.store(number);
    since_wake = now == wakes ? since_wake + 1 : 0;
    wakes = now;
    while (since_wake >= 200 && ring.wakes() == wakes) {
      std::this_thread::yield();
    }
  }
}

/// How often the soak kills; a few times in an ordinary run of the tests.
int kill_count() {
  const char* const text = std::getenv("FASTCYCLE_FLIGHT_KILLS");
  return text == nullptr ? 5 : std::max(1, std::atoi(text));
}

TEST_F(Flight, TheNextStartDumpsWhatAKilledRunHadPublished) {
  constexpr std::size_t kImageBytes = std::size_t{128} << 10U;
  std::mt19937 random(std::random_device{}());
  double bytes = 0;
  double seconds = 0;
  FlightOptions options = this->options();
  options.bytes = 32 << 20;
  for (int kill_number = 0; kill_number < kill_count(); ++kill_number) {
    const SharedProgress progress;
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      fly_until_killed(options, kImageBytes, *progress);
    }
    const auto enough = std::uniform_int_distribution<std::int64_t>(1, 20'000)(random);
    while (progress->published.load() < enough) {
      ASSERT_EQ(waitpid(child, nullptr, WNOHANG), 0) << "the child ended by itself";
      std::this_thread::sleep_for(100us);
    }
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);

    std::uint64_t wakes = 0;
    {
      FlightRingReader ring(options.file);
      wakes = ring.wakes();
      std::optional<std::uint64_t> last;
      while (const std::optional<FlightRecord> record = ring.next()) {
        EXPECT_EQ(record->number, last.value_or(record->number - 1) + 1);
        last = record->number;
      }
      EXPECT_EQ(ring.missing(), 0U);
    }
    base::Clock clock = base::Clock::live();
    Publishing flight(clock, options);
    static_cast<void>(flight.publisher<Int64Value>("numbers"));
    flight.open();
    flight.recorder().stop();

    // What had been published when the recorder came by for the last time but one is there.
    std::int64_t sure = progress->published.load();
    while (sure > 0 &&
           progress->wakes[static_cast<std::uint64_t>(sure) % Progress::kCount].load() + 2 >
               wakes) {
      --sure;
    }
    if (sure == 0 && flight.recorder().report().dumps.empty()) {
      continue;  // Killed before the recorder came by.
    }
    EXPECT_THAT(flight.news(), HasSubstr("the run before did not end in order"));
    ASSERT_EQ(flight.recorder().report().dumps.size(), 1U);
    const FlightDump dump = flight.recorder().report().dumps[0];
    EXPECT_EQ(dump.problem, "");
    EXPECT_THAT(dump.file.filename().string(), HasSubstr("_crash"));
    const Content content = content_of(dump.file);
    if (sure == 0 && content.numbers.empty()) {
      continue;  // Killed when the recorder had come by for what begins a run, and nothing else.
    }
    ASSERT_FALSE(content.numbers.empty());
    EXPECT_EQ(content.numbers, numbers_between(content.numbers.front(), content.numbers.back()));
    EXPECT_GE(content.numbers.back(), sure);
    EXPECT_LE(content.numbers.back(), progress->published.load() + 1);
    bytes += static_cast<double>(content.numbers.size() / 16 * kImageBytes);
    seconds +=
        static_cast<double>(content.log_times_ns.back() - content.log_times_ns.front()) / 1e9;
    std::filesystem::remove(dump.file);
  }
  std::printf("published at %.0f MB/s until the kills\n", bytes / 1e6 / seconds);
}

}  // namespace
}  // namespace fastcycle::record
