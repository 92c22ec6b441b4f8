// What the clients of a recording are given, whenever they come.
#include "web/hub.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"
#include "mcap/test_file.h"
#include "mcap/writer.h"
#include "playback/played_log.h"
#include "record/descriptor_set.h"
#include "web/session.h"

namespace fastcycle::web {
namespace {

using foxglove::Json;
using google::protobuf::Int64Value;
using inspect::protocol::ControlPlayback;
using playback::PlayedLog;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using namespace std::chrono_literals;

constexpr std::int64_t kBegin = 1'000'000'000;
constexpr std::int64_t kStep = 10'000'000;
constexpr int kSteps = 200;

/// Of a Foxglove client all that it receives.
struct Client {
  explicit Client(Hub& hub) : session(hub, [] {}) {}

  void subscribe(const foxglove::Channel& channel) {
    session.take_text(
        Json{{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", channel.id}}}}}
            .dump());
  }
  void take() {
    while (const auto frame = session.outbox().take()) {
      Int64Value value;
      if (frame->message != nullptr && value.ParseFromString(frame->message->payload)) {
        values.push_back(value.value());
      } else if (frame->is_text) {
        if (const Json json = Json::parse(frame->head); json["op"] == "status") {
          statuses.push_back(json["message"].get<std::string>());
        }
      }
    }
  }

  Session session;
  std::vector<std::int64_t> values;
  std::vector<std::string> statuses;
};

/// "map" has one message, at the beginning; "speed" the numbers of steps, from step 10 on, by one
/// publisher, and by another a single 1000 at step 20.
class HubOfARecording : public testing::Test {
 protected:
  HubOfARecording() {
    mcap::FileSink sink(file_);
    mcap::Writer writer(sink, {.library = "test", .chunk_bytes = 512});
    writer.add(mcap::Schema{.id = 1,
                            .name = "google.protobuf.Int64Value",
                            .encoding = "protobuf",
                            .data = record::descriptor_set_of(*Int64Value::descriptor())});
    const auto add = [&](std::uint16_t id, const std::string& topic, const std::string& publisher) {
      writer.add(mcap::Channel{.id = id,
                               .schema_id = 1,
                               .topic = topic,
                               .message_encoding = "protobuf",
                               .metadata = {{"publisher", publisher}}});
    };
    add(1, "map", "hd_map");
    add(2, "speed", "wheels");
    add(3, "speed", "gnss");
    write(writer, 1, 0, 7);
    for (int i = 10; i <= kSteps; ++i) {
      write(writer, 2, i, i);
      if (i == 20) {
        write(writer, 3, i, 1000);
      }
    }
    writer.close();
  }

  static void write(mcap::Writer& writer, std::uint16_t channel, int step, std::int64_t value) {
    Int64Value message;
    message.set_value(value);
    const auto time_ns = static_cast<std::uint64_t>(kBegin + step * kStep);
    mcap::write_message(writer,
                        {.channel_id = channel,
                         .sequence = static_cast<std::uint32_t>(step),
                         .log_time_ns = time_ns,
                         .publish_time_ns = time_ns},
                        message.SerializeAsString());
  }

  void play(PlayedLog::Options options) {
    log_.emplace(std::vector{file_}, options);
    std::vector<base::Refusal> refusals;
    log_->start(refusals);
    hub_.emplace(std::make_unique<inspect::Client>(log_->connect(), "test"), Hub::Options{});
  }
  /// Lets the hub read until `is_enough`, for a minute at most.
  bool await(const std::function<bool()>& is_enough) {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!is_enough()) {
      if (std::chrono::steady_clock::now() > end) {
        return false;
      }
      hub_->look(std::chrono::steady_clock::now());
      hub_->read();
      std::this_thread::sleep_for(1ms);
    }
    return true;
  }
  /// Goes to `step`, and waits until the answer is there.
  void seek(Client& client, int step) {
    bool is_done = false;
    inspect::protocol::Request request;
    request.mutable_playback()->set_command(ControlPlayback::COMMAND_PAUSE);
    request.mutable_playback()->set_has_seek(true);
    request.mutable_playback()->set_seek_ns(kBegin + step * kStep);
    hub_->ask(client.session, std::move(request), [&](const auto&) { is_done = true; });
    ASSERT_TRUE(await([&] { return is_done; }));
  }
  /// What who subscribes now is given at once.
  std::vector<std::int64_t> given_to_another() {
    Client client(*hub_);
    client.subscribe(*hub_->find_channel("speed"));
    client.take();
    return client.values;
  }

  config::TestFolder folder_;
  const std::filesystem::path file_ = folder_.path() / "drive.mcap";
  std::optional<PlayedLog> log_;
  std::optional<Hub> hub_;
};

TEST_F(HubOfARecording, GivesWhoComesLaterTheLastMessageOfEachPublisher) {
  play({.speed = 100});
  Client first(*hub_);
  first.subscribe(*hub_->find_channel("speed"));
  ASSERT_TRUE(await([&] {
    first.take();
    return !first.values.empty() && first.values.back() == kSteps;
  }));

  EXPECT_THAT(given_to_another(), ElementsAre(1000, kSteps));
}

TEST_F(HubOfARecording, GivesWhoComesAfterAStepBackNothingOfATimeThatIsNotYetThere) {
  play({.speed = 100});
  Client first(*hub_);
  first.subscribe(*hub_->find_channel("speed"));
  ASSERT_TRUE(await([&] {
    first.take();
    return !first.values.empty() && first.values.back() == kSteps;
  }));

  seek(first, 5);
  EXPECT_THAT(given_to_another(), IsEmpty());

  seek(first, 50);
  first.values.clear();
  ASSERT_TRUE(await([&] {
    first.take();
    return first.values.size() == 2;
  }));
  EXPECT_THAT(first.values, ElementsAre(1000, 50));
  EXPECT_THAT(given_to_another(), ElementsAre(1000, 50));
}

TEST_F(HubOfARecording, TellsItsClientsWhatCannotBeRead) {
  std::fstream file(file_, std::ios::in | std::ios::out | std::ios::binary);
  // Within the messages, for the summary is at the end; longer than what stands between chunks.
  file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(file_) / 3));
  file << std::string(1500, 'x');
  file.close();
  play({.speed = 100});
  Client first(*hub_);
  first.subscribe(*hub_->find_channel("speed"));
  ASSERT_TRUE(await([&] {
    first.take();
    return !first.statuses.empty();
  }));

  Client second(*hub_);
  second.take();
  ASSERT_EQ(first.statuses.size(), 1U);
  EXPECT_THAT(first.statuses[0], HasSubstr("drive.mcap"));
  EXPECT_THAT(first.statuses[0], HasSubstr("paused there"));
  EXPECT_EQ(second.statuses, first.statuses);
}

}  // namespace
}  // namespace fastcycle::web
