#include "record/recorder.h"

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "broker/topics.h"
#include "log/log.pb.h"
#include "mcap/reader.h"

namespace fastcycle::record {
namespace {

using google::protobuf::BytesValue;
using google::protobuf::Int64Value;
using testing::HasSubstr;

/// A component that publishes on two topics, recorded into a folder that is gone afterwards.
class Recorded : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name =
        (std::filesystem::temp_directory_path() / "fastcycle_record_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    owner_.name = "publisher";
    owner_.clock = &clock_;
    owner_.enter();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  template <typename T>
  detail::PublisherCore& publisher(const std::string& topic) {
    return topics_.add_publisher(topic, owner_, T::default_instance(), nullptr, false);
  }

  bool start(RecorderOptions options) {
    options.recording.file = folder_ / "drive.mcap";
    recorder_.emplace(std::move(options), clock_);
    recorder_->on_trouble = [this](const std::string& text) {
      const std::lock_guard lock(trouble_mutex_);
      trouble_ += text + "\n";
    };
    recorder_->tap(topics_);
    topics_.connect_all();
    return recorder_->start({.facts = {{"name", "test"}}, .application = "{}"}, {});
  }

  /// Waits until the file that is being written has what `has` asks for.
  template <typename Has>
  void wait_for_file(const Has& has) {
    const std::int64_t end_ns = base::monotonic_ns() + 10'000'000'000;
    bool is_there = false;
    while (!is_there && base::monotonic_ns() < end_ns) {
      for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
        const mcap::FileSource source(entry.path());
        is_there = is_there || has(mcap::Reader(source));
      }
    }
    EXPECT_TRUE(is_there);
  }

  [[nodiscard]] std::string trouble() {
    const std::lock_guard lock(trouble_mutex_);
    return trouble_;
  }
  /// Waits until the recorder has said `text`.
  void wait_for_trouble(const std::string& text) {
    const std::int64_t end_ns = base::monotonic_ns() + 30'000'000'000;
    while (trouble().find(text) == std::string::npos && base::monotonic_ns() < end_ns) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_THAT(trouble(), HasSubstr(text));
  }
  /// Publishes numbers until the recorder has said `text`. Returns how many there were.
  std::int64_t publish_until_trouble(detail::PublisherCore& numbers, const std::string& text) {
    const std::int64_t end_ns = base::monotonic_ns() + 30'000'000'000;
    std::int64_t count = 0;
    while (trouble().find(text) == std::string::npos && base::monotonic_ns() < end_ns) {
      publish<Int64Value>(numbers, ++count);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_THAT(trouble(), HasSubstr(text));
    return count;
  }
  /// A file that is looked at often, with number 1 in it.
  detail::PublisherCore& start_with_one_number() {
    detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
    RecorderOptions options;
    options.recording.sync_interval = std::chrono::milliseconds(20);
    EXPECT_TRUE(start(options));
    publish<Int64Value>(numbers, 1);
    wait_for_file([&](const mcap::Reader& reader) {
      return reader.messages({.topics = {"numbers"}}).next().has_value();
    });
    return numbers;
  }
  void expect_ledger() {
    const RecordedTopic topic = recorder_->topics()[0];
    EXPECT_EQ(topic.published, topic.recorded + topic.lost());
    std::uint64_t found = 0;
    for (const auto& file : recorder_->files()) {
      found += numbers_in(file, "numbers").size();
    }
    EXPECT_EQ(topic.recorded, found);
  }
  static std::vector<std::int64_t> numbers_in(const std::filesystem::path& file,
                                              const std::string& topic);

  template <typename T>
  void publish(detail::PublisherCore& publisher, const decltype(T().value())& value) {
    publisher.owner.enter();
    detail::Envelope* loan = publisher.loan(true);
    static_cast<T&>(*loan->own).set_value(value);
    publisher.publish(loan, {});
  }

  base::Clock clock_ = base::Clock::live();
  detail::PublishingComponent owner_;
  detail::Topics topics_;
  std::filesystem::path folder_;
  std::mutex trouble_mutex_;
  std::string trouble_;
  std::optional<Recorder> recorder_;
};

TEST_F(Recorded, HasEveryMessageWithItsSequenceAndTime) {
  detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
  detail::PublisherCore& images = publisher<BytesValue>("images");
  ASSERT_TRUE(start({}));
  for (int i = 1; i <= 300; ++i) {
    publish<Int64Value>(numbers, i);
    if (i % 30 == 0) {
      publish<BytesValue>(images, std::string(1'000'000, static_cast<char>('a' + i % 26)));
    }
  }
  recorder_->stop();

  ASSERT_EQ(recorder_->files(), std::vector{folder_ / "drive.mcap"}) << recorder_->problem();
  const mcap::FileSource source(folder_ / "drive.mcap");
  const mcap::Reader reader(source);
  EXPECT_FALSE(reader.problem());
  std::int64_t next = 1;
  int images_seen = 0;
  mcap::MessageReader messages = reader.messages({.topics = {"numbers", "images"}});
  while (const std::optional<mcap::StoredMessage> message = messages.next()) {
    const std::string_view bytes = mcap::text_of(message->data);
    if (message->channel->topic == "images") {
      BytesValue image;
      ASSERT_TRUE(image.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
      EXPECT_EQ(image.value().size(), 1'000'000U);
      EXPECT_EQ(message->sequence, static_cast<std::uint32_t>(++images_seen));
      continue;
    }
    Int64Value number;
    ASSERT_TRUE(number.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
    EXPECT_EQ(number.value(), next);
    EXPECT_EQ(message->sequence, static_cast<std::uint32_t>(next++));
    EXPECT_EQ(message->channel->metadata.at("publisher"), "publisher");
  }
  EXPECT_EQ(next, 301);
  EXPECT_EQ(images_seen, 10);
  for (const RecordedTopic& topic : recorder_->topics()) {
    EXPECT_EQ(topic.published, topic.recorded + topic.lost()) << topic.topic;
    EXPECT_EQ(topic.lost(), 0U) << topic.topic;
  }
}

/// All messages of `topic` in `file`, as numbers.
std::vector<std::int64_t> Recorded::numbers_in(const std::filesystem::path& file,
                                               const std::string& topic) {
  const mcap::FileSource source(file);
  const mcap::Reader reader(source);
  EXPECT_FALSE(reader.problem());
  std::vector<std::int64_t> numbers;
  mcap::MessageReader messages = reader.messages({.topics = {topic}});
  while (const std::optional<mcap::StoredMessage> message = messages.next()) {
    const std::string_view bytes = mcap::text_of(message->data);
    Int64Value number;
    EXPECT_TRUE(number.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
    numbers.push_back(number.value());
  }
  return numbers;
}

TEST_F(Recorded, SplitFilesHaveEveryMessageOnceAndWhatIsLatchedInEach) {
  topics_.set_options("map", {.latched = 1});
  detail::PublisherCore& map = publisher<Int64Value>("map");
  detail::PublisherCore& images = publisher<BytesValue>("images");
  detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
  RecorderOptions options;
  options.chunk.compression = mcap::Compression::kNone;
  options.recording.splitting.bytes = 3'000'000;
  ASSERT_TRUE(start(options));
  publish<Int64Value>(map, 7);
  wait_for_file([&](const mcap::Reader& reader) {
    return reader.messages({.topics = {"map"}}).next().has_value();
  });
  for (int i = 1; i <= 20; ++i) {
    publish<Int64Value>(numbers, i);
    publish<BytesValue>(images, std::string(500'000, 'x'));
  }
  recorder_->stop();

  const std::vector<std::filesystem::path> files = recorder_->files();
  ASSERT_GE(files.size(), 4U) << recorder_->problem();
  EXPECT_EQ(files[0], folder_ / "drive_0001.mcap");
  EXPECT_EQ(files[1], folder_ / "drive_0002.mcap");
  std::vector<std::int64_t> all;
  for (const auto& file : files) {
    EXPECT_LT(std::filesystem::file_size(file), 3'100'000U);
    EXPECT_EQ(numbers_in(file, "map"), std::vector<std::int64_t>{7}) << file;
    const std::vector<std::int64_t> some = numbers_in(file, "numbers");
    all.insert(all.end(), some.begin(), some.end());
  }
  std::ranges::sort(all);
  std::vector<std::int64_t> wanted(20);
  std::iota(wanted.begin(), wanted.end(), 1);
  EXPECT_EQ(all, wanted);
}

TEST_F(Recorded, AFileThatIsThereIsLeftAlone) {
  std::ofstream(folder_ / "drive.mcap") << "precious";
  detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
  ASSERT_TRUE(start({}));
  publish<Int64Value>(numbers, 1);
  recorder_->stop();

  EXPECT_EQ(std::filesystem::file_size(folder_ / "drive.mcap"), 8U);
  ASSERT_EQ(recorder_->files(), std::vector{folder_ / "drive_0002.mcap"});
  EXPECT_EQ(numbers_in(recorder_->files()[0], "numbers"), std::vector<std::int64_t>{1});
}

TEST_F(Recorded, WhatCannotBeWrittenIsCounted) {
  detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
  std::filesystem::remove_all(folder_);
  EXPECT_FALSE(start({}));
  for (int i = 1; i <= 100; ++i) {
    publish<Int64Value>(numbers, i);
  }
  recorder_->stop();

  EXPECT_TRUE(recorder_->files().empty());
  EXPECT_NE(recorder_->problem().find("drive.mcap"), std::string::npos) << recorder_->problem();
  ASSERT_EQ(recorder_->topics().size(), 1U);
  const RecordedTopic topic = recorder_->topics()[0];
  EXPECT_EQ(topic.published, 100U);
  EXPECT_EQ(topic.recorded, 0U);
  EXPECT_EQ(topic.bytes, 0U);
  EXPECT_EQ(topic.lost(), 100U);
}

TEST_F(Recorded, AFileThatIsDeletedIsLostAndAnotherOneBegun) {
  detail::PublisherCore& numbers = start_with_one_number();
  std::filesystem::remove(folder_ / "drive.mcap.active");
  publish_until_trouble(numbers, "drive.mcap.active: it was deleted");
  publish<Int64Value>(numbers, -1);
  recorder_->stop();

  EXPECT_TRUE(recorder_->has_failed());
  EXPECT_THAT(trouble(), HasSubstr("recording goes on in"));
  EXPECT_THAT(recorder_->trouble(), HasSubstr("it was deleted"));
  EXPECT_EQ(recorder_->files(), std::vector{folder_ / "drive_0002.mcap"});
  EXPECT_EQ(numbers_in(folder_ / "drive_0002.mcap", "numbers").back(), -1);
  EXPECT_GT(recorder_->topics()[0].disk, 0U);
  expect_ledger();
}

TEST_F(Recorded, WhatIsLostWithItsFolderIsCounted) {
  detail::PublisherCore& numbers = start_with_one_number();
  std::filesystem::remove_all(folder_);
  publish_until_trouble(numbers, "nothing is recorded now");
  recorder_->stop();

  EXPECT_TRUE(recorder_->has_failed());
  EXPECT_THAT(trouble(), HasSubstr("it was deleted"));
  EXPECT_THAT(recorder_->files(), testing::IsEmpty());
  const RecordedTopic topic = recorder_->topics()[0];
  EXPECT_EQ(topic.recorded, 0U);
  EXPECT_EQ(topic.bytes, 0U);
  EXPECT_EQ(topic.disk, topic.published);
}

TEST_F(Recorded, AFileThatGoesAwayBeforeTheEndIsFoundAtTheEnd) {
  detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
  RecorderOptions options;
  options.recording.sync_interval = std::chrono::nanoseconds(0);
  ASSERT_TRUE(start(options));
  publish<Int64Value>(numbers, 1);
  std::filesystem::remove(folder_ / "drive.mcap.active");
  recorder_->stop();

  EXPECT_TRUE(recorder_->has_failed());
  EXPECT_THAT(trouble(), HasSubstr("the 1 messages that were recorded into it are lost"));
  EXPECT_EQ(recorder_->topics()[0].recorded, 0U);
  EXPECT_EQ(recorder_->topics()[0].disk, 1U);
}

TEST_F(Recorded, AFileThatIsCutOffIsLostAndAnotherOneBegun) {
  detail::PublisherCore& numbers = start_with_one_number();
  std::filesystem::resize_file(folder_ / "drive.mcap.active", 0);
  publish_until_trouble(numbers, "another program cut it off");
  publish<Int64Value>(numbers, -1);
  recorder_->stop();

  EXPECT_TRUE(recorder_->has_failed());
  ASSERT_EQ(recorder_->files().back(), folder_ / "drive_0002.mcap");
  EXPECT_EQ(numbers_in(folder_ / "drive_0002.mcap", "numbers").size(),
            recorder_->topics()[0].recorded);
}

TEST_F(Recorded, AFileThatIsMovedIsWrittenToItsEndWhereItIs) {
  detail::PublisherCore& numbers = start_with_one_number();
  std::filesystem::rename(folder_ / "drive.mcap.active", folder_ / "moved");
  const std::int64_t count = 1 + publish_until_trouble(numbers, "it was moved to ");
  recorder_->stop();

  EXPECT_TRUE(recorder_->has_failed()) << "it has not the name that was asked for";
  EXPECT_EQ(recorder_->topics()[0].lost(), 0U);
  EXPECT_EQ(numbers_in(folder_ / "moved", "numbers").size(), static_cast<std::size_t>(count));
  EXPECT_THAT(recorder_->problem(), HasSubstr("moved"));
}

TEST_F(Recorded, AMessageThatIsTooLargeIsRefusedNamedAndCounted) {
  detail::PublisherCore& images = publisher<BytesValue>("images");
  RecorderOptions options;
  options.message_bytes_max = 1000;
  ASSERT_TRUE(start(options));
  publish<BytesValue>(images, std::string(500, 'x'));
  publish<BytesValue>(images, std::string(1000, 'x'));
  publish<BytesValue>(images, std::string(2000, 'x'));
  publish<BytesValue>(images, std::string(500, 'x'));
  recorder_->stop();

  const RecordedTopic topic = recorder_->topics()[0];
  EXPECT_EQ(topic.recorded, 2U);
  EXPECT_EQ(topic.too_large, 2U);
  EXPECT_EQ(topic.lost(), 2U);
  EXPECT_THAT(trouble(), HasSubstr("component \"publisher\" on images is not recorded"));
  EXPECT_THAT(trouble(), HasSubstr("it has 1003 bytes, and 1000 can be written"));
  EXPECT_EQ(trouble().find("2003"), std::string::npos) << "it is said once";
  EXPECT_FALSE(recorder_->has_failed());
}

// Of small limits, which differ by as much as the real ones.
TEST_F(Recorded, TheLargestMessageIsRecordedAsReadersTakeIt) {
  constexpr std::uint64_t kHeadBytes = 4;  // Of the message's only field.
  constexpr std::uint64_t kMost = 300'000;
  topics_.set_options("maps", {.latched = 1});
  detail::PublisherCore& images = publisher<BytesValue>("images");
  detail::PublisherCore& maps = publisher<BytesValue>("maps");
  detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
  RecorderOptions options;
  EXPECT_EQ(options.message_bytes_max, mcap::kMostMessageBytes);
  options.message_bytes_max = kMost;
  ASSERT_TRUE(start(options));
  for (const std::uint64_t bytes : {kMost, kMost + 1}) {
    publish<BytesValue>(images, std::string(bytes - kHeadBytes, 'x'));
    publish<Int64Value>(numbers, 7);
    publish<BytesValue>(maps, std::string(bytes - kHeadBytes, 'x'));
  }
  recorder_->stop();

  for (const RecordedTopic& topic : recorder_->topics()) {
    EXPECT_EQ(topic.too_large, topic.topic == "numbers" ? 0U : 1U) << topic.topic;
  }
  mcap::ReadOptions read;
  read.limits.chunk_bytes = kMost + (read.limits.chunk_bytes - mcap::kMostMessageBytes);
  const mcap::FileSource source(folder_ / "drive.mcap");
  const mcap::Reader reader(source, read);
  mcap::MessageReader messages = reader.messages({.topics = {"images", "maps", "numbers"}});
  std::map<std::string, std::vector<std::size_t>> sizes;
  while (const auto message = messages.next()) {
    sizes[message->channel->topic].push_back(message->data.size());
  }
  EXPECT_EQ(sizes["images"], std::vector<std::size_t>{kMost});
  EXPECT_EQ(sizes["maps"], std::vector<std::size_t>{kMost});
  EXPECT_EQ(sizes["numbers"].size(), 2U);
}

// A limit of the process stands for a full disk.
TEST_F(Recorded, AFileThatCannotBeBegunIsNotLeft) {
  (void)publisher<Int64Value>("numbers");
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit none{.rlim_cur = 0, .rlim_max = before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &none);
  const bool is_started = start({});
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  recorder_->stop();

  EXPECT_FALSE(is_started);
  EXPECT_NE(recorder_->problem().find("File too large"), std::string::npos) << recorder_->problem();
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(Recorded, RecordsNoMoreThanIsWanted) {
  detail::PublisherCore& numbers = publisher<Int64Value>("control/speed");
  detail::PublisherCore& others = publisher<Int64Value>("camera/front");
  RecorderOptions options;
  options.filter.topics = {"control/*"};
  ASSERT_TRUE(start(options));
  publish<Int64Value>(numbers, 1);
  publish<Int64Value>(others, 2);
  recorder_->stop();

  ASSERT_EQ(recorder_->topics().size(), 1U);
  EXPECT_EQ(recorder_->topics()[0].topic, "control/speed");
  EXPECT_EQ(recorder_->topics()[0].recorded, 1U);
}

TEST_F(Recorded, WhatAMessageRecordHasNoPlaceForStandsBesideIt) {
  const base::Clock clock = base::Clock::simulated();
  owner_.clock = &clock;
  owner_.now = clock.now();
  detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
  recorder_.emplace(RecorderOptions{.recording = {.file = folder_ / "drive.mcap"}}, clock);
  recorder_->tap(topics_);
  topics_.connect_all();
  ASSERT_TRUE(recorder_->start({}, {}));
  publish<Int64Value>(numbers, 1);
  recorder_->take(0);
  detail::Envelope* loan = numbers.loan(true);
  numbers.publish(loan, {.taken_at = clock.now() - std::chrono::milliseconds(5)});
  recorder_->take(2);
  recorder_->stop({{"reason", "test"}});

  const mcap::FileSource source(folder_ / "drive.mcap");
  const mcap::Reader reader(source);
  mcap::MessageReader messages = reader.messages({.topics = {"fastcycle/message_infos"}});
  const std::optional<mcap::StoredMessage> message = messages.next();
  ASSERT_TRUE(message);
  log::MessageInfos infos;
  ASSERT_TRUE(infos.ParseFromArray(message->data.data(), static_cast<int>(message->data.size())));
  // The first one is as usual, and has none.
  ASSERT_EQ(infos.infos_size(), 1);
  const log::MessageInfo& info = infos.infos(0);
  EXPECT_EQ(reader.definitions().find_channel(static_cast<std::uint16_t>(info.channel()))->topic,
            "numbers");
  EXPECT_EQ(info.sequence(), 2U);
  EXPECT_GE(info.age_ns(), 5'000'000);
  EXPECT_LE(info.age_ns(), 5'000'001);
  EXPECT_EQ(info.root(), 0U);
  EXPECT_EQ(info.step(), 3U);

  ASSERT_FALSE(reader.metadata().empty());
  const auto end =
      std::ranges::find(reader.metadata(), "fastcycle.end", &mcap::MetadataIndex::name);
  ASSERT_NE(end, reader.metadata().end());
  EXPECT_EQ(reader.read(*end).metadata.at("reason"), "test");
}

// A crash takes nothing that came more than the age of a chunk before it.
TEST_F(Recorded, WhatWasTakenIsInTheFileSoonAlsoIfItIsNeverClosed) {
  detail::PublisherCore& numbers = publisher<Int64Value>("numbers");
  ASSERT_TRUE(start({}));
  publish<Int64Value>(numbers, 1);
  wait_for_file([&](const mcap::Reader& reader) {
    return reader.messages({.topics = {"numbers"}}).next().has_value();
  });
  recorder_->stop();
}

}  // namespace
}  // namespace fastcycle::record
