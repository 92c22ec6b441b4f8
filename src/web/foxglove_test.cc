#include "web/foxglove.h"

#include <string>

#include <gtest/gtest.h>

namespace fastcycle::web::foxglove {
namespace {

TEST(Foxglove, PrefersTheNewerSubprotocol) {
  EXPECT_EQ(choose_subprotocol("foxglove.websocket.v1"), kOldSubprotocol);
  EXPECT_EQ(choose_subprotocol("foxglove.websocket.v1, foxglove.sdk.v1"), kNewSubprotocol);
  EXPECT_EQ(choose_subprotocol(" foxglove.sdk.v1\t"), kNewSubprotocol);
  EXPECT_EQ(choose_subprotocol("chat,foxglove.websocket.v2"), "");
  EXPECT_EQ(choose_subprotocol(""), "");
  EXPECT_EQ(choose_subprotocol(",,"), "");
}

TEST(Foxglove, WritesBase64AsRfc4648Does) {
  // The test vectors of section 10.
  EXPECT_EQ(to_base64(""), "");
  EXPECT_EQ(to_base64("f"), "Zg==");
  EXPECT_EQ(to_base64("fo"), "Zm8=");
  EXPECT_EQ(to_base64("foo"), "Zm9v");
  EXPECT_EQ(to_base64("foob"), "Zm9vYg==");
  EXPECT_EQ(to_base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(to_base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(to_base64("\xff\xfe\xfd"), "//79");
}

TEST(Foxglove, WritesHeadsOfMessages) {
  EXPECT_EQ(message_head(0x01020304, 0x1112131415161718),
            std::string("\x01\x04\x03\x02\x01\x18\x17\x16\x15\x14\x13\x12\x11", 13));
  EXPECT_EQ(time(5), std::string("\x02\x05\0\0\0\0\0\0\0", 9));
  EXPECT_EQ(service_reply(1, 2, kProtobuf, "xy"),
            std::string("\x03\x01\0\0\0\x02\0\0\0\x08\0\0\0", 13) + "protobuf" + "xy");
}

TEST(Foxglove, ReadsFramesOfClients) {
  const auto message = read_message(std::string_view("\x01\x05\0\0\0abc", 8));
  ASSERT_TRUE(message);
  EXPECT_EQ(message->channel, 5);
  EXPECT_EQ(message->payload, "abc");
  const std::string call = std::string("\x02\x01\0\0\0\x02\0\0\0\x03\0\0\0", 13) + "encxy";
  const auto read = read_call(call);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->service, 1);
  EXPECT_EQ(read->call, 2);
  EXPECT_EQ(read->encoding, "enc");
  EXPECT_EQ(read->payload, "xy");
}

TEST(Foxglove, KnowsHowARecordingIsPlayed) {
  EXPECT_EQ(
      playback_state({.status = PlaybackState::Status::kPaused,
                      .now_ns = 0x1112131415161718,
                      .speed = 2,
                      .did_seek = true,
                      .request = "ab"}),
      std::string("\x05\x01\x18\x17\x16\x15\x14\x13\x12\x11\0\0\0\x40\x01\x02\0\0\0", 19) + "ab");
  const std::string frame =
      std::string("\x03\x01\0\0\0\x3f\x01\x07\0\0\0\0\0\0\0\x03\0\0\0", 19) + "abc";
  const auto read = read_playback(frame);
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->is_pause);
  EXPECT_EQ(read->speed, 0.5F);
  EXPECT_EQ(read->seek_ns, 7U);
  EXPECT_EQ(read->request, "abc");
  for (std::size_t size = 0; size < frame.size(); ++size) {
    EXPECT_FALSE(read_playback(std::string_view(frame).substr(0, size))) << size;
  }
  EXPECT_FALSE(read_playback(frame + "d"));
}

TEST(Foxglove, DoesNotReadFramesThatAreCutOff) {
  const std::string call = std::string("\x02\x01\0\0\0\x02\0\0\0\x03\0\0\0", 13) + "enc";
  for (std::size_t size = 0; size < call.size(); ++size) {
    EXPECT_FALSE(read_call(std::string_view(call).substr(0, size))) << size;
  }
  EXPECT_TRUE(read_call(call));
  EXPECT_FALSE(read_message(""));
  EXPECT_FALSE(read_message(std::string_view("\x01\x05\0\0", 4)));
  // A length beyond the frame, and beyond what can be added to it.
  EXPECT_FALSE(read_call(std::string_view("\x02\x01\0\0\0\x02\0\0\0\xff\xff\xff\xff", 13)));
}

TEST(Foxglove, TellsWhatOfTheGraphIsGone) {
  const Graph before{
      .published = {{"a", {"x"}}, {"b", {"x"}}}, .subscribed = {}, .services = {{"s", {"x"}}}};
  const Graph now{.published = {{"a", {"x", "y"}}}, .subscribed = {{"a", {"z"}}}, .services = {}};
  const Json json = Json::parse(graph_update(now, before));
  EXPECT_EQ(json["op"], "connectionGraphUpdate");
  EXPECT_EQ(json["publishedTopics"], Json::parse(R"([{"name": "a", "publisherIds": ["x", "y"]}])"));
  EXPECT_EQ(json["subscribedTopics"], Json::parse(R"([{"name": "a", "subscriberIds": ["z"]}])"));
  EXPECT_EQ(json["removedTopics"], Json::parse(R"(["b"])"));
  EXPECT_EQ(json["removedServices"], Json::parse(R"(["s"])"));
}

TEST(Foxglove, TakesOnlyNumbersOf32BitsForIds) {
  EXPECT_EQ(to_id(Json::parse("7")), 7U);
  EXPECT_EQ(to_id(Json::parse("4294967295")), 4294967295U);
  for (const char* wrong :
       {"4294967296", "-1", "1.5", "\"1\"", "null", "[]", "18446744073709551616"}) {
    EXPECT_FALSE(to_id(Json::parse(wrong))) << wrong;
  }
}

}  // namespace
}  // namespace fastcycle::web::foxglove
