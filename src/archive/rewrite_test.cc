#include "archive/rewrite.h"

#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/test_log.h"
#include "log/log.pb.h"

namespace fastcycle::archive {
namespace {

using mcap::Compression;
using mcap::Lines;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

mcap::WriterOptions unchunked() {
  mcap::WriterOptions options = mcap::small_chunks();
  options.chunked = false;
  return options;
}

/// Four chunks of messages in no order of time, metadata and attachments, of some of them two
/// alike.
std::string rich_log(const mcap::WriterOptions& options) {
  mcap::StringSink sink;
  mcap::Writer writer(sink, options);
  for (const std::uint16_t id : {std::uint16_t{3}, std::uint16_t{7}}) {
    writer.add(scene_schema(id));  // Two that are the same but for their number.
    writer.add(scene_channel(id, "scene", id));
  }
  writer.add(mcap::kCamera);
  for (const char* name : {"car", "car", "driver"}) {
    writer.write(mcap::Metadata{.name = name, .metadata = {{"a", "b"}}});
    writer.write(mcap::Attachment{{.log_time_ns = 5, .name = name}, mcap::bytes_of("same")});
  }
  writer.write(mcap::Attachment{{.log_time_ns = 5, .name = "car"}, mcap::bytes_of("SAME")});
  for (std::uint32_t i = 0; i < 40; ++i) {
    const std::uint16_t channel = i % 4 == 0 ? mcap::kCamera.id : i % 4 == 1 ? 7 : 3;
    const std::uint64_t time_ns = 1000 + (i ^ 3U) / 2 * 100;  // Some have the same time.
    mcap::write_message(writer,
                        {.channel_id = channel,
                         .sequence = i,
                         .log_time_ns = time_ns,
                         .publish_time_ns = time_ns - i},
                        scene(fmt::format("name: 'message number {}'", i)));
  }
  writer.close();
  return sink.file();
}

class RoundTrip : public ::testing::TestWithParam<mcap::WriterOptions> {};

INSTANTIATE_TEST_SUITE_P(Kinds, RoundTrip,
                         ::testing::Values(mcap::small_chunks(),
                                           mcap::small_chunks(Compression::kLz4),
                                           mcap::small_chunks(Compression::kZstd), unchunked(),
                                           mcap::without_summary(mcap::small_chunks())));

TEST_P(RoundTrip, PiecesPutTogetherAreTheWhole) {
  const std::string whole = rich_log(GetParam());
  Layout layout{.chunk_bytes = 300};
  layout.piece.time_ns = 450;

  std::string file = whole;
  for (int round = 0; round < 2; ++round) {
    const std::vector<std::string> pieces = rewritten({file}, layout);
    ASSERT_THAT(pieces, SizeIs(4));
    const std::vector<std::string> merged = rewritten(pieces);
    ASSERT_THAT(merged, SizeIs(1));
    file = merged[0];

    EXPECT_EQ(content_of(file), content_of(whole)) << round;
  }
}

TEST_P(RoundTrip, ConversionKeepsTheContent) {
  const std::string whole = rich_log(GetParam());
  for (const Compression compression :
       {Compression::kNone, Compression::kLz4, Compression::kZstd}) {
    for (const bool has_index : {true, false}) {
      const std::vector<std::string> files =
          rewritten({whole}, {.chunk = {.compression = compression}, .has_index = has_index});

      ASSERT_THAT(files, SizeIs(1));
      EXPECT_EQ(content_of(files[0]), content_of(whole));
      EXPECT_EQ(mcap::stream(files[0]).stop.reason, mcap::Stop::Reason::kEnd);
      EXPECT_EQ(mcap::only(mcap::stream(files[0]).lines, "ChunkIndex").empty(), !has_index);
    }
  }
}

TEST(Split, PiecesStayWithinTheirSize) {
  const std::string whole = rich_log(mcap::small_chunks());
  Layout layout{.chunk_bytes = 200};
  layout.piece.bytes = 6000;

  const std::vector<std::string> pieces = rewritten({whole}, layout);

  EXPECT_GT(pieces.size(), 1U);
  for (const std::string& piece : pieces) {
    EXPECT_LE(piece.size(), 6000U);
    EXPECT_GT(mcap::indexed(piece).size(), 0U);
  }
  EXPECT_EQ(content_of(rewritten(pieces).at(0)), content_of(whole));
}

TEST(Split, LargeAttachmentsAreInTheFirstPieceAlone) {
  mcap::StringSink sink;
  mcap::Writer writer(sink);
  writer.add(mcap::kCamera);
  const std::string map(3'000'000, 'm');
  writer.write(mcap::Attachment{{.name = "map"}, mcap::bytes_of(map)});
  writer.write(mcap::Attachment{{.name = "note"}, mcap::bytes_of("small")});
  mcap::write_message(writer, mcap::head_at(0, mcap::kCamera), "a");
  mcap::write_message(writer, mcap::head_at(100, mcap::kCamera), "b");
  writer.close();
  Layout layout;
  layout.piece.time_ns = 50;

  const std::vector<std::string> pieces = rewritten({sink.file()}, layout);

  ASSERT_THAT(pieces, SizeIs(2));
  EXPECT_GT(pieces[0].size(), map.size());
  EXPECT_THAT(mcap::only(mcap::stream(pieces[1]).lines, "Attachment"),
              ElementsAre(HasSubstr("note")));
  EXPECT_EQ(content_of(rewritten(pieces).at(0)), content_of(sink.file()));
}

/// One channel with number 1 and one message.
std::string single(const std::string& topic, std::uint64_t time_ns, const std::string& fact) {
  mcap::StringSink sink;
  mcap::Writer writer(sink, {.profile = topic});
  writer.add(scene_schema());
  writer.add(scene_channel(1, topic));
  writer.write(mcap::Metadata{.name = "shared", .metadata = {}});
  writer.write(mcap::Metadata{.name = "own", .metadata = {{"fact", fact}}});
  mcap::write_message(writer, {.channel_id = 1, .log_time_ns = time_ns}, topic);
  writer.close();
  return sink.file();
}

TEST(Merge, ChannelsThatDifferGetNumbersOfTheirOwn) {
  const Lines lines = content_of(
      rewritten({single("b", 20, "1"), single("a", 10, "2"), single("b", 5, "3")}).at(0));

  EXPECT_THAT(mcap::only(lines, "Message"),
              ElementsAre("Message 1 0 5 0 b", "Message 2 0 10 0 a", "Message 1 0 20 0 b"));
  EXPECT_THAT(mcap::only(lines, "Schema"), SizeIs(1));
  EXPECT_THAT(mcap::only(lines, "Channel"), SizeIs(2));
}

TEST(Merge, WhatIsTheSameStandsOnce) {
  const Lines lines = content_of(rewritten({single("b", 20, "1"), single("b", 5, "2")}).at(0));

  EXPECT_THAT(mcap::only(lines, "Metadata"),
              ElementsAre("Metadata shared", "Metadata own fact=1", "Metadata own fact=2"));
}

TEST(Merge, MessagesOfOneTimeKeepTheOrderOfTheInputs) {
  const Lines lines =
      content_of(rewritten({single("b", 7, ""), single("a", 7, ""), single("c", 7, "")}).at(0));

  EXPECT_THAT(mcap::only(lines, "Message"),
              ElementsAre(HasSubstr(" b"), HasSubstr(" a"), HasSubstr(" c")));
}

// ---- Of our own logs ----

constexpr std::uint16_t kInfos = 2;

/// Messages of one channel, number 3, and what the broker knew of them, later.
std::string own_log(const std::string& topic, const std::vector<std::uint64_t>& times_ns) {
  mcap::StringSink sink;
  mcap::Writer writer(sink, {.profile = "fastcycle"});
  writer.add(mcap::Schema{.id = 1, .name = "fastcycle.log.MessageInfos", .encoding = "protobuf"});
  writer.add(mcap::Channel{.id = kInfos,
                           .schema_id = 1,
                           .topic = "fastcycle/message_infos",
                           .message_encoding = "protobuf"});
  writer.add(mcap::Channel{.id = 3, .topic = topic, .message_encoding = "raw"});
  writer.add(mcap::Channel{.id = 4, .topic = "other", .message_encoding = "raw"});
  log::MessageInfos infos;
  std::uint32_t sequence = 0;
  for (const std::uint64_t time_ns : times_ns) {
    ++sequence;
    for (const std::uint16_t channel : {std::uint16_t{3}, std::uint16_t{4}}) {
      mcap::write_message(
          writer, {.channel_id = channel, .sequence = sequence, .log_time_ns = time_ns}, "x");
      log::MessageInfo& info = *infos.add_infos();
      info.set_channel(channel);
      info.set_sequence((std::uint64_t{1} << 32U) + sequence);
    }
  }
  mcap::write_message(writer, {.channel_id = kInfos, .log_time_ns = 1000},
                      infos.SerializeAsString());
  writer.close();
  return sink.file();
}

/// `channel:sequence` of all infos, in order; the sequence without its upper half.
std::string infos_in(const std::string& file) {
  const mcap::MemorySource source(mcap::bytes_of(file));
  const mcap::Reader reader(source);
  mcap::MessageReader messages = reader.messages({.topics = {"fastcycle/message_infos"}});
  std::string text;
  while (const std::optional<mcap::StoredMessage> message = messages.next()) {
    log::MessageInfos infos;
    EXPECT_TRUE(infos.ParseFromArray(message->data.data(), static_cast<int>(message->data.size())));
    for (const log::MessageInfo& info : infos.infos()) {
      EXPECT_EQ(info.sequence() >> 32U, 1U);
      text += fmt::format("{}:{} ", info.channel(), info.sequence() & 0xFFFFFFFFU);
    }
  }
  return text;
}

TEST(Merge, InfosNameTheNewNumbers) {
  const std::string merged = rewritten({own_log("a", {1}), own_log("b", {2})}).at(0);

  EXPECT_EQ(infos_in(merged), "3:1 4:1 1:1 4:1 ");
  EXPECT_THAT(mcap::only(content_of(merged), "Channel"), SizeIs(4));
}

TEST(Filter, TopicsTakeWhatExplainsThem) {
  const std::string file =
      rewritten({own_log("a", {1, 2})}, {}, {.topics = {.topics = {"a"}}}).at(0);

  EXPECT_EQ(infos_in(file), "3:1 3:2 ");
  EXPECT_THAT(mcap::only(content_of(file), "Channel"),
              ElementsAre(HasSubstr("fastcycle/message_infos"), HasSubstr(" a ")));
}

TEST(Filter, InfosThatAreNotWantedAreLeftOut) {
  const std::string file =
      rewritten({own_log("a", {1, 2})}, {}, {.topics = {.except = {"fastcycle/**"}}}).at(0);

  EXPECT_EQ(infos_in(file), "");
  EXPECT_THAT(mcap::only(content_of(file), "Message"), SizeIs(4));
}

TEST(Filter, TimesCountFromTheFirstMessage) {
  const std::string file =
      rewritten({own_log("a", {100, 110, 120, 130})}, {}, {.begin_ns = 10, .end_ns = 30}).at(0);

  EXPECT_THAT(mcap::only(content_of(file), "Message"),
              ElementsAre(HasSubstr("Message 3 2 110 "), HasSubstr("Message 4 2 110 "),
                          HasSubstr("Message 3 3 120 "), HasSubstr("Message 4 3 120 "),
                          HasSubstr("Message 2 0 1000 ")));
  EXPECT_EQ(infos_in(file), "3:2 4:2 3:3 4:3 ") << "although they stand behind the end";
}

TEST(Filter, WhatExplainsTheLogIsKept) {
  const Lines lines = content_of(
      rewritten({rich_log(mcap::small_chunks())}, {}, {.topics = {.topics = {"camera/*"}}}).at(0));

  EXPECT_THAT(mcap::only(lines, "Message"), SizeIs(10));
  EXPECT_THAT(mcap::only(lines, "Channel"), SizeIs(1));
  EXPECT_THAT(mcap::only(lines, "Metadata"), SizeIs(3));
  EXPECT_THAT(mcap::only(lines, "Attachment"), SizeIs(4));
}

TEST(Filter, NoTopicGivesNoMessages) {
  const Lines lines = content_of(
      rewritten({rich_log(mcap::small_chunks())}, {}, {.topics = {.topics = {"no"}}}).at(0));

  EXPECT_THAT(mcap::only(lines, "Message"), SizeIs(0));
}

TEST(Rewrite, InputThatWasNotClosedIsTakenAndSaid) {
  const std::string file = mcap::drive(mcap::small_chunks(), false);
  const mcap::MemorySource source(mcap::bytes_of(file), "test.mcap");
  const mcap::Source* const inputs[] = {&source};
  mcap::StringSink sink;

  const Rewritten result = rewrite(inputs, [&](std::uint64_t) -> mcap::Sink& { return sink; });

  EXPECT_EQ(result.messages, 12U);
  EXPECT_THAT(result.problems, SizeIs(1));
  EXPECT_EQ(content_of(sink.file()), content_of(file));
}

TEST(Rewrite, AnInputThatIsCutOffBeforeItsFirstWholeMessageIsAnError) {
  const std::string file = mcap::drive(mcap::small_chunks(mcap::Compression::kLz4));
  const std::size_t chunk = mcap::find_record(file, mcap::Opcode::kChunk, 0);

  for (const std::size_t size : {chunk, chunk + 40}) {
    // Beside one that is whole, too: what is missing must not be hidden.
    EXPECT_THROW(rewritten({file.substr(0, size)}), mcap::Error) << size;
    EXPECT_THROW(rewritten({file, file.substr(0, size)}), mcap::Error) << size;
  }
}

TEST(Rewrite, DamageOfAnInputIsAnError) {
  std::string file = mcap::drive(mcap::small_chunks());
  const std::size_t chunk = mcap::find_record(file, mcap::Opcode::kChunk, 1);
  file[chunk + 80] = static_cast<char>(file[chunk + 80] ^ 1);

  EXPECT_THROW(rewritten({file}), mcap::Damage);
}

}  // namespace
}  // namespace fastcycle::archive
