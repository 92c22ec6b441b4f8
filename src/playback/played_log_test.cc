#include "playback/played_log.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "config/test_folder.h"
#include "inspect/client.h"
#include "mcap/test_file.h"
#include "mcap/writer.h"
#include "record/descriptor_set.h"

namespace fastcycle::playback {
namespace {

using google::protobuf::Int64Value;
using ::testing::HasSubstr;
using namespace std::chrono_literals;
using inspect::protocol::Answer;
using inspect::protocol::ControlPlayback;
using inspect::protocol::Playback;
using inspect::protocol::Request;

constexpr std::int64_t kBegin = 1'000'000'000;
constexpr std::int64_t kStep = 10'000'000;
constexpr int kNumbers = 200;  // 2 s of them.

/// One message on "map" at the beginning; numbers each 10 ms, as many as 10 ms have passed; texts.
class ARecording : public testing::Test {
 protected:
  ARecording() {
    mcap::FileSink sink(file_);
    mcap::Writer writer(sink, {.library = "test", .chunk_bytes = 512});
    writer.add(mcap::Schema{
        .id = 1, .name = "google.protobuf.Int64Value", .encoding = "protobuf", .data = schema_});
    const auto add = [&](std::uint16_t id, const std::string& topic, const std::string& encoding) {
      writer.add(mcap::Channel{.id = id,
                               .schema_id = static_cast<std::uint16_t>(encoding == "json" ? 0 : 1),
                               .topic = topic,
                               .message_encoding = encoding,
                               .metadata = {}});
    };
    add(1, "map", "protobuf");
    add(2, "numbers", "protobuf");
    add(3, "texts", "json");
    write(writer, 1, 0, 7);
    for (int i = 0; i <= kNumbers; ++i) {
      write(writer, 2, i, i);
      write(writer, 3, i, i);
    }
    writer.close();
  }

  static void write(mcap::Writer& writer, std::uint16_t channel, int step, std::int64_t value) {
    Int64Value message;
    message.set_value(value);
    const std::string bytes = message.SerializeAsString();
    const auto time_ns = static_cast<std::uint64_t>(kBegin + step * kStep);
    mcap::write_message(writer,
                        {.channel_id = channel,
                         .sequence = static_cast<std::uint32_t>(step),
                         .log_time_ns = time_ns,
                         .publish_time_ns = time_ns},
                        bytes);
  }

  void play(PlayedLog::Options options) {
    log_.emplace(std::vector{file_}, options);
    std::vector<base::Refusal> refusals;
    log_->start(refusals);
    client_.emplace(log_->connect(), "test");
  }
  std::uint32_t stream(const std::string& topic) {
    Request request;
    request.mutable_stream()->set_topic(topic);
    request.mutable_stream()->set_content(inspect::protocol::Stream::CONTENT_FULL);
    return client_->begin(std::move(request)).id();
  }
  Playback control(ControlPlayback::Command command, std::optional<int> seek = {},
                   double speed = 0) {
    Request request;
    request.mutable_playback()->set_command(command);
    request.mutable_playback()->set_speed(speed);
    if (seek) {
      request.mutable_playback()->set_has_seek(true);
      request.mutable_playback()->set_seek_ns(kBegin + *seek * kStep);
    }
    return client_->ask(std::move(request)).playback();
  }
  /// The next message: of which stream, and its value; none within 10 s.
  std::optional<std::pair<std::uint32_t, std::int64_t>> next() {
    while (const auto answer = client_->next(10s)) {
      if (answer->has_messages()) {
        Int64Value value;
        EXPECT_EQ(answer->messages().messages_size(), 1);
        EXPECT_EQ(answer->messages().lost(), 0);
        const inspect::protocol::Message& message = answer->messages().messages(0);
        EXPECT_TRUE(value.ParseFromString(message.payload()));
        return std::pair(answer->id(), value.value());
      }
    }
    return std::nullopt;
  }
  /// Plays on until it ends.
  Playback await_end() {
    Playback state;
    for (int i = 0; i < 1000; ++i) {
      state = control(ControlPlayback::COMMAND_NONE);
      if (state.status() == Playback::STATUS_ENDED) {
        break;
      }
      static_cast<void>(client_->next(10ms));
    }
    return state;
  }

  config::TestFolder folder_;
  const std::filesystem::path file_ = folder_.path() / "drive.mcap";
  const std::string schema_ = record::descriptor_set_of(*Int64Value::descriptor());
  std::optional<PlayedLog> log_;
  std::optional<inspect::Client> client_;
};

TEST_F(ARecording, ShowsItsTopicsWithTheirSchemas) {
  play({.is_paused = true});

  Request request;
  request.mutable_overview();
  const Answer answer = client_->ask(std::move(request));

  ASSERT_EQ(answer.overview().topics_size(), 2);
  EXPECT_EQ(answer.overview().topics(0).name(), "map");
  EXPECT_EQ(answer.overview().topics(1).name(), "numbers");
  EXPECT_EQ(answer.overview().topics(1).published(), kNumbers + 1);
  EXPECT_EQ(answer.overview().topics(1).type(), "google.protobuf.Int64Value");
  EXPECT_TRUE(answer.overview().topics(1).schema().empty());
  EXPECT_EQ(answer.overview().playback().begin_ns(), kBegin);
  EXPECT_EQ(answer.overview().playback().end_ns(), kBegin + kNumbers * kStep);
  EXPECT_TRUE(answer.overview().playback().can_seek());
  Request one;
  one.mutable_topic()->set_topic("numbers");
  EXPECT_EQ(client_->ask(std::move(one)).topic().schema(), schema_);
  ASSERT_EQ(log_->notes().size(), 1);
  EXPECT_THAT(log_->notes()[0], HasSubstr("1 topics are not shown"));
  EXPECT_THAT(log_->notes()[0], HasSubstr("texts"));
}

TEST_F(ARecording, GivesEachMessageOnceAndInOrder) {
  play({.speed = 20});
  const std::uint32_t numbers = stream("numbers");

  std::int64_t expected = -1;
  while (const auto message = next()) {
    EXPECT_EQ(message->first, numbers);
    if (expected >= 0) {
      EXPECT_EQ(message->second, expected);
    }
    expected = message->second + 1;
    if (expected == kNumbers + 1) {
      break;
    }
  }
  EXPECT_EQ(expected, kNumbers + 1);
  EXPECT_EQ(await_end().now_ns(), kBegin + kNumbers * kStep);
}

TEST_F(ARecording, GivesWhoComesTheLastMessageOfBefore) {
  play({.is_paused = true, .start = base::from_ns(kBegin + 150 * kStep + 5)});

  const std::uint32_t map = stream("map");
  EXPECT_EQ(next(), std::pair(map, std::int64_t{7}));
  const std::uint32_t numbers = stream("numbers");
  EXPECT_EQ(next(), std::pair(numbers, std::int64_t{150}));
}

TEST_F(ARecording, GoesToAnyTimeOfItAndPlaysOnFromThere) {
  play({.is_paused = true});
  const std::uint32_t map = stream("map");
  const std::uint32_t numbers = stream("numbers");
  EXPECT_EQ(next(), std::pair(map, std::int64_t{7}));
  EXPECT_EQ(next(), std::pair(numbers, std::int64_t{0}));

  for (const int seek : {120, 30, 180}) {
    const Playback state = control(ControlPlayback::COMMAND_PAUSE, seek);
    EXPECT_EQ(state.status(), Playback::STATUS_PAUSED);
    EXPECT_EQ(state.now_ns(), kBegin + seek * kStep);
    // In the order of their times, and behind the answer.
    EXPECT_EQ(next(), std::pair(map, std::int64_t{7}));
    EXPECT_EQ(next(), std::pair(numbers, std::int64_t{seek}));
  }
  EXPECT_EQ(control(ControlPlayback::COMMAND_PLAY).seeks(), 3);
  for (int i = 181; i <= kNumbers; ++i) {
    EXPECT_EQ(next(), std::pair(numbers, std::int64_t{i}));
  }
  EXPECT_EQ(await_end().status(), Playback::STATUS_ENDED);

  // Once more, from its beginning.
  const Playback again = control(ControlPlayback::COMMAND_PLAY, {}, 100);
  EXPECT_EQ(again.status(), Playback::STATUS_PLAYING);
  EXPECT_EQ(again.speed(), 100);
  EXPECT_EQ(next(), std::pair(map, std::int64_t{7}));
  EXPECT_EQ(next(), std::pair(numbers, std::int64_t{0}));
  EXPECT_EQ(next(), std::pair(numbers, std::int64_t{1}));
}

TEST_F(ARecording, StandsWhileItIsPaused) {
  play({.is_paused = true});
  stream("numbers");
  ASSERT_TRUE(next());
  static_cast<void>(control(ControlPlayback::COMMAND_PAUSE, 50));
  ASSERT_TRUE(next());

  EXPECT_FALSE(client_->next(50ms));
  EXPECT_EQ(control(ControlPlayback::COMMAND_NONE).now_ns(), kBegin + 50 * kStep);
}

TEST_F(ARecording, BeginsWhenSomebodyLooks) {
  play({.speed = 50});
  std::this_thread::sleep_for(100ms);  // Of which all would be over.
  EXPECT_EQ(control(ControlPlayback::COMMAND_NONE).now_ns(), kBegin);

  const std::uint32_t numbers = stream("numbers");
  EXPECT_EQ(next(), std::pair(numbers, std::int64_t{0}));
  EXPECT_EQ(next(), std::pair(numbers, std::int64_t{1}));
}

TEST_F(ARecording, GivesWhoComesWhileItPlaysTheLastMessageAndAllBehindIt) {
  play({.speed = 10});
  const std::uint32_t first = stream("numbers");
  for (int i = 0; i < 50; ++i) {
    ASSERT_EQ(next(), std::pair(first, std::int64_t{i}));
  }
  const std::uint32_t second = stream("numbers");
  std::int64_t of_first = 49;
  std::optional<std::int64_t> of_second;
  while (of_first < kNumbers || of_second != kNumbers) {
    const auto message = next();
    ASSERT_TRUE(message);
    if (message->first == first) {
      ASSERT_EQ(message->second, ++of_first);
    } else {
      ASSERT_EQ(message->first, second);
      ASSERT_EQ(message->second, of_second.value_or(message->second - 1) + 1);
      of_second = message->second;
    }
  }
}

TEST_F(ARecording, IsNotTakenTwice) {
  const std::vector files{file_, file_};

  EXPECT_THROW(PlayedLog(files, {}), std::runtime_error);
}

TEST_F(ARecording, TellsWhatCannotBeReadOnceAndGoesOnElsewhere) {
  std::fstream file(file_, std::ios::in | std::ios::out | std::ios::binary);
  // Within the messages, for the summary is at the end; longer than what stands between chunks.
  file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(file_) / 3));
  file << std::string(1500, 'x');
  file.close();
  std::atomic<int> problems{0};
  play({.speed = 100, .on_problem = [&](const std::string&) { problems.fetch_add(1); }});
  stream("numbers");
  for (int i = 0; i < 1000 && problems.load() == 0; ++i) {
    static_cast<void>(client_->next(10ms));
  }
  const Playback stopped = control(ControlPlayback::COMMAND_NONE);
  EXPECT_EQ(stopped.status(), Playback::STATUS_PAUSED);
  EXPECT_LT(stopped.now_ns(), kBegin + kNumbers * kStep);
  EXPECT_THAT(stopped.problem(), HasSubstr(file_.filename().string()));
  static_cast<void>(client_->next(50ms));
  EXPECT_EQ(problems.load(), 1);

  EXPECT_EQ(control(ControlPlayback::COMMAND_PAUSE, kNumbers).problem(), "");
  std::int64_t value = 0;
  while (const auto message = next()) {
    value = message->second;
    if (value == kNumbers) {
      break;
    }
  }
  EXPECT_EQ(value, kNumbers);
}

TEST_F(ARecording, SaysWhatARecordingCannotDo) {
  play({.is_paused = true});

  Request unknown;
  unknown.mutable_stream()->set_topic("number");
  try {
    client_->begin(std::move(unknown));
    FAIL();
  } catch (const inspect::ClientError& error) {
    EXPECT_THAT(error.what(), HasSubstr("no topic \"number\" in the recording"));
    EXPECT_THAT(error.hint(), HasSubstr("numbers"));
  }
  Request change;
  change.mutable_switch_mode()->set_mode("manual");
  try {
    client_->ask(std::move(change));
    FAIL();
  } catch (const inspect::ClientError& error) {
    EXPECT_THAT(error.what(), HasSubstr("nothing of it runs"));
    EXPECT_THAT(error.hint(), HasSubstr("fastcycle play"));
  }
}

}  // namespace
}  // namespace fastcycle::playback
