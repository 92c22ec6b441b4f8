#include "mcap/reader.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mcap/test_file.h"

namespace fastcycle::mcap {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// Remembers what was read of it.
class WatchedSource final : public Source {
 public:
  explicit WatchedSource(std::string file) : file_(std::move(file)) {}

  [[nodiscard]] std::uint64_t size() const override { return file_.size(); }
  [[nodiscard]] const std::string& name() const override { return name_; }
  void read(std::uint64_t offset, std::span<std::byte> into) const override {
    read_.insert(offset);
    std::ranges::copy(bytes_of(file_).subspan(offset, into.size()), into.begin());
  }

  [[nodiscard]] bool was_read_from(std::uint64_t offset) const { return read_.contains(offset); }
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  const std::string name_ = "test.mcap";
  const std::string file_;
  mutable std::set<std::uint64_t> read_;
};

/// A file of the camera's messages, each of these lists in a chunk of its own.
std::string chunks_at(const std::vector<std::vector<std::uint64_t>>& chunks,
                      const WriterOptions& options = {}) {
  StringSink sink;
  Writer writer(sink, options);
  writer.add(kCamera);
  std::size_t number = 0;
  for (const std::vector<std::uint64_t>& times : chunks) {
    for (const std::uint64_t time : times) {
      write_message(writer, head_at(time, kCamera), fmt::format("{}", number++));
    }
    writer.flush();
  }
  writer.close();
  return sink.file();
}

/// `time/number` of each message.
Lines found(std::string_view file, const MessageQuery& query = {},
            const ReadOptions& options = {}) {
  const MemorySource source(bytes_of(file), "test.mcap");
  const Reader reader(source, options);
  MessageReader messages = reader.messages(query);
  Lines lines;
  while (const std::optional<StoredMessage> message = messages.next()) {
    lines.push_back(fmt::format("{}/{}", message->log_time_ns, text_of(message->data)));
  }
  return lines;
}

std::string error_of(std::string_view file, const ReadOptions& options = {}) {
  try {
    (void)indexed(file, {}, options);
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::StartsWith("test.mcap: "));
    return error.what();
  }
  return "";
}

TEST(Reader, MessagesComeInTheOrderOfTheirLogTimes) {
  EXPECT_THAT(found(chunks_at({{5, 1, 3}, {4, 2, 9}, {7, 8, 6}})),
              ElementsAre("1/1", "2/4", "3/2", "4/3", "5/0", "6/8", "7/6", "8/7", "9/5"));
}

TEST(Reader, MessagesOfTheSameTimeComeInTheOrderOfTheFile) {
  EXPECT_THAT(found(chunks_at({{5, 3, 3}, {3, 4}, {3, 5, 5}})),
              ElementsAre("3/1", "3/2", "3/3", "3/5", "4/4", "5/0", "5/6", "5/7"));
}

TEST(Reader, RangeOfTimesIncludesItsBeginningAndNotItsEnd) {
  const std::string file = chunks_at({{1, 2, 3}, {4, 5, 6}, {7, 8, 9}});

  EXPECT_THAT(found(file, {.begin_ns = 3, .end_ns = 5}), ElementsAre("3/2", "4/3"));
  EXPECT_THAT(found(file, {.begin_ns = 9}), ElementsAre("9/8"));
  EXPECT_THAT(found(file, {.end_ns = 2}), ElementsAre("1/0"));
  EXPECT_THAT(found(file, {.begin_ns = 5, .end_ns = 5}), IsEmpty());
  EXPECT_THAT(found(file, {.begin_ns = 10}), IsEmpty());
}

TEST(Reader, LargestAndSmallestTimesAreFound) {
  constexpr std::uint64_t kLatest = ~std::uint64_t{0};

  EXPECT_THAT(found(chunks_at({{kLatest, 0}}), {.begin_ns = 1}),
              ElementsAre("18446744073709551615/0"));
  EXPECT_THAT(found(chunks_at({{kLatest, 0}})), SizeIs(2));
}

TEST(Reader, OnlyTopicsThatAreAskedForCome) {
  const std::string file = drive(small_chunks());

  EXPECT_THAT(indexed(file), SizeIs(12));
  EXPECT_THAT(indexed(file, {.topics = {"camera/front"}}), SizeIs(2));
  EXPECT_THAT(indexed(file, {.topics = {"camera/front", "control/speed"}}), SizeIs(12));
  EXPECT_THAT(indexed(file, {.topics = {"unknown"}}), IsEmpty());
  EXPECT_THAT(indexed(file, {.topics = {"camera/front"}, .begin_ns = 60}), SizeIs(1));
}

TEST(Reader, MessageKnowsItsChannel) {
  const std::string file = drive(small_chunks());
  const MemorySource source(bytes_of(file));
  const Reader reader(source);
  MessageReader messages = reader.messages({.topics = {"control/speed"}});

  const std::optional<StoredMessage> message = messages.next();

  ASSERT_TRUE(message);
  EXPECT_EQ(*message->channel, kSpeed);
  EXPECT_EQ(*reader.definitions().find_schema(message->channel->schema_id), kSpeedSchema);
}

TEST(Reader, AttachmentsAndMetadataAreFoundWithAndWithoutSummary) {
  for (const WriterOptions& options : {small_chunks(), without_summary(small_chunks())}) {
    const std::string file = drive(options);
    const MemorySource source(bytes_of(file));
    const Reader reader(source);
    ASSERT_THAT(reader.attachments(), SizeIs(1));
    ASSERT_THAT(reader.metadata(), SizeIs(1));

    std::vector<std::byte> memory;
    const Attachment attachment = reader.read(reader.attachments().front(), memory);

    EXPECT_EQ(LineOf{}(attachment), "Attachment 40 0 camera.txt text/plain f = 1.5");
    EXPECT_EQ(LineOf{}(reader.read(reader.metadata().front())), "Metadata car name=demo");
    EXPECT_EQ(reader.header().profile, "test");
  }
}

TEST(Reader, IndexThatNamesAnotherRecordIsDamage) {
  const std::string file = drive(small_chunks());
  const MemorySource source(bytes_of(file), "test.mcap");
  const Reader reader(source);
  const AttachmentIndex good = reader.attachments().front();
  std::vector<std::byte> memory;

  for (const std::uint64_t offset : {std::uint64_t{0}, std::uint64_t{25}, file.size() - 3,
                                     file.size(), ~std::uint64_t{0}, ~std::uint64_t{0} - 50}) {
    AttachmentIndex index = good;
    index.offset = offset;
    EXPECT_THROW((void)reader.read(index, memory), Damage) << offset;
    EXPECT_THROW((void)reader.read(MetadataIndex{.offset = offset, .length = 40}), Damage);
  }
  for (const std::uint64_t length : {std::uint64_t{0}, good.length + 1, ~std::uint64_t{0}}) {
    AttachmentIndex index = good;
    index.length = length;
    EXPECT_THROW((void)reader.read(index, memory), Damage) << length;
  }
  AttachmentIndex other_name = good;
  other_name.name = "other";
  EXPECT_THROW((void)reader.read(other_name, memory), Damage);
}

TEST(Reader, EveryKindOfFileGivesTheSameMessages) {
  const Lines expected = indexed(drive(small_chunks()));
  ASSERT_THAT(expected, SizeIs(12));
  std::vector<WriterOptions> kinds;
  for (const Compression compression :
       {Compression::kNone, Compression::kLz4, Compression::kZstd}) {
    kinds.push_back(small_chunks(compression));
    kinds.push_back(without_summary(small_chunks(compression)));
    kinds.push_back(without_crcs(small_chunks(compression)));
  }
  for (bool WriterOptions::* const option :
       {&WriterOptions::chunked, &WriterOptions::message_index, &WriterOptions::repeat_schemas,
        &WriterOptions::repeat_channels, &WriterOptions::statistics, &WriterOptions::chunk_index,
        &WriterOptions::attachment_index, &WriterOptions::metadata_index,
        &WriterOptions::summary_offsets}) {
    kinds.push_back(small_chunks());
    kinds.back().*option = false;
  }
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    EXPECT_EQ(indexed(drive(kinds[i])), expected) << i;
    EXPECT_EQ(indexed(drive(kinds[i], false)), expected) << i << ", not closed";
    EXPECT_EQ(indexed(drive(kinds[i]), {}, {.use_summary = false}), expected) << i;
  }
}

TEST(Reader, SummaryIsUsedIfItHasWhatIsNeeded) {
  const auto was_scanned = [](const std::string& file) {
    const MemorySource source(bytes_of(file));
    return Reader(source).was_scanned();
  };
  WriterOptions without_message_index = small_chunks();
  without_message_index.message_index = false;
  WriterOptions without_offsets = small_chunks();
  without_offsets.summary_offsets = false;
  WriterOptions without_channels = small_chunks();
  without_channels.repeat_channels = false;

  EXPECT_FALSE(was_scanned(drive(small_chunks())));
  EXPECT_FALSE(was_scanned(drive(without_message_index)));
  EXPECT_FALSE(was_scanned(drive(without_offsets)));
  EXPECT_TRUE(was_scanned(drive(without_channels)));
  EXPECT_TRUE(was_scanned(drive(without_summary(small_chunks()))));
  EXPECT_TRUE(was_scanned(drive(small_chunks(), false)));
}

TEST(Reader, StatisticsOfAScanAreThoseOfTheFile) {
  const std::string file = drive(small_chunks());
  const MemorySource source(bytes_of(file));

  const Reader by_summary(source);
  const Reader by_scan(source, {.use_summary = false});

  EXPECT_EQ(by_scan.statistics(), by_summary.statistics());
  EXPECT_FALSE(by_scan.problem());
}

TEST(Reader, FileThatWasNotClosedSaysWhereItEnds) {
  const std::string file = drive(small_chunks(), false);
  const MemorySource source(bytes_of(file), "test.mcap");

  const Reader reader(source);

  ASSERT_TRUE(reader.problem());
  EXPECT_THAT(to_string(*reader.problem()), HasSubstr("expected a record, found the end of the"));
}

TEST(Reader, DamagedSummaryStopsOnlyThoseWhoUseIt) {
  std::string file = drive(small_chunks());
  file[find_record(file, Opcode::kStatistics) + 12] = 'x';
  const MemorySource source(bytes_of(file), "test.mcap");

  EXPECT_THROW(const Reader reader(source), Damage);
  const Reader reader(source, {.use_summary = false});

  EXPECT_THAT(messages_of(reader), SizeIs(12));
  ASSERT_TRUE(reader.problem());
  EXPECT_THAT(to_string(*reader.problem()), HasSubstr("Footer: expected CRC"));
}

TEST(Reader, ChunksAreReadWhenTheirTurnComes) {
  const WatchedSource source(chunks_at({{1, 2}, {3, 4}, {5, 6}}));
  const auto chunk = [&](std::size_t index) {
    return find_record(source.file(), Opcode::kChunk, index);
  };
  const Reader reader(source);
  MessageReader messages = reader.messages();
  EXPECT_FALSE(source.was_read_from(chunk(0)));

  (void)messages.next();
  EXPECT_TRUE(source.was_read_from(chunk(0)));
  (void)messages.next();
  EXPECT_FALSE(source.was_read_from(chunk(1)));

  (void)messages.next();
  EXPECT_TRUE(source.was_read_from(chunk(1)));
  EXPECT_FALSE(source.was_read_from(chunk(2)));
}

TEST(Reader, ChunksWithoutWhatIsAskedForAreNotRead) {
  const WatchedSource source(drive(small_chunks()));
  const Reader reader(source);

  EXPECT_THAT(messages_of(reader, {.topics = {"camera/front"}}), SizeIs(2));
  EXPECT_FALSE(source.was_read_from(find_record(source.file(), Opcode::kChunk, 0)));

  const WatchedSource again(source.file());
  EXPECT_THAT(messages_of(Reader(again), {.end_ns = 30}), SizeIs(3));
  EXPECT_FALSE(again.was_read_from(find_record(source.file(), Opcode::kChunk, 3)));
}

TEST(Reader, MemoryIsForThoseChunksOnlyThatOverlap) {
  // A message record with one digit has 32 bytes.
  const std::string one_after_the_other = chunks_at({{1, 2}, {3, 4}, {5, 6}, {7, 8}});
  const std::string all_at_once = chunks_at({{1, 9}, {1, 9}, {1, 9}, {1, 9}});
  const ReadOptions two_chunks{.limits = {.open_chunk_bytes = 150}};

  EXPECT_THAT(found(one_after_the_other, {}, two_chunks), SizeIs(8));
  EXPECT_THAT(found(all_at_once), SizeIs(8));
  EXPECT_THAT(error_of(all_at_once, two_chunks),
              HasSubstr("at most 150 bytes of chunks whose times overlap"));
}

TEST(Reader, IndexIsLimited) {
  const std::string file = drive(small_chunks());

  EXPECT_THAT(error_of(file, {.limits = {.index_bytes = 100}}),
              HasSubstr("a summary of at most 100 bytes"));
  EXPECT_THAT(error_of(file, {.use_summary = false, .limits = {.index_bytes = 100}}),
              HasSubstr("an index of at most 100 bytes"));
}

/// A file without CRCs whose summary can be changed.
class LyingSummary : public ::testing::Test {
 protected:
  [[nodiscard]] std::size_t chunk_index(std::size_t index) const {
    return find_record(file_, Opcode::kChunkIndex, index) + kFrameBytes;
  }

  const std::string file_ = chunks_at({{1, 2}, {3, 4}}, without_crcs({}));
};

TEST_F(LyingSummary, TruthIsTaken) {
  EXPECT_EQ(error_of(file_), "");
}

TEST_F(LyingSummary, OffsetsOutsideOfTheFileAreNamed) {
  for (const std::uint64_t offset :
       {std::uint64_t{0}, std::uint64_t{10}, file_.size(), ~std::uint64_t{0}, ~std::uint64_t{60}}) {
    EXPECT_THAT(error_of(with(file_, chunk_index(0) + 16, offset)),
                HasSubstr("bytes at byte " + std::to_string(offset)));
    EXPECT_THAT(error_of(with(file_, find_record(file_, Opcode::kFooter) + 9, offset | 1U)),
                HasSubstr("expected "));
  }
  for (const std::uint64_t length : {std::uint64_t{0}, std::uint64_t{48}, ~std::uint64_t{0}}) {
    EXPECT_THAT(error_of(with(file_, chunk_index(0) + 24, length)), HasSubstr("ChunkIndex"));
  }
}

TEST_F(LyingSummary, ChunksThatOverlapInTheFileAreNamed) {
  const std::uint64_t first = find_record(file_, Opcode::kChunk, 0);

  EXPECT_THAT(error_of(with(file_, chunk_index(1) + 16, first)),
              HasSubstr("expected a chunk between"));
  EXPECT_THAT(error_of(with(file_, chunk_index(1) + 16, first + 1)),
              HasSubstr("expected a chunk between"));
}

TEST_F(LyingSummary, OffsetOfAnotherRecordIsNamed) {
  const std::uint64_t first = find_record(file_, Opcode::kChunk, 0);

  EXPECT_THAT(error_of(with(file_, chunk_index(0) + 16, first - 1)), HasSubstr("expected "));
}

TEST_F(LyingSummary, TimesThatAreNotThoseOfTheMessagesAreNamed) {
  EXPECT_THAT(error_of(with(file_, chunk_index(0), std::uint64_t{2})),
              HasSubstr("Message: expected log_time from 2 to 2, as the index of its chunk says"));
  EXPECT_THAT(error_of(with(file_, chunk_index(1) + 8, std::uint64_t{3})), HasSubstr("found 4"));
}

TEST_F(LyingSummary, SizesThatAreNotThoseOfTheChunkAreNamed) {
  const std::size_t uncompressed_size =
      chunk_index(0) + 32 + 4 + 10 + 8 + 4 + 8;  // Behind one message index offset.

  EXPECT_THAT(error_of(with(file_, uncompressed_size, std::uint64_t{1})),
              HasSubstr("as its index says"));
  EXPECT_THAT(error_of(with(file_, uncompressed_size, ~std::uint64_t{0})), HasSubstr("at most"));
}

TEST_F(LyingSummary, MessagesThatAreNotInChunksAreMissed) {
  const std::size_t statistics = find_record(file_, Opcode::kStatistics) + kFrameBytes;

  EXPECT_THAT(error_of(with(file_, statistics, std::uint64_t{5})),
              HasSubstr("Statistics: expected message_count 4"));
  EXPECT_THAT(error_of(with(file_, statistics, std::uint64_t{3})),
              HasSubstr("Statistics: expected message_count 4"));
}

TEST_F(LyingSummary, ChannelsThatAreOthersInTheChunkAreNamed) {
  StringSink sink;
  Writer writer(sink, without_crcs({}));
  ChunkBuilder chunk({.crc = false});
  chunk.add(kCamera);
  chunk.add(Message{head_at(1, kCamera), {}});
  writer.write(chunk);
  writer.close();
  std::string other = sink.file();
  other[other.rfind("camera/front")] = 'k';

  EXPECT_THAT(error_of(other), HasSubstr("what the summary has for id 2"));
}

TEST(Reader, HeadsComeBeforeTheMessagesOfTheirChunk) {
  StringSink sink;
  Writer writer(sink, {});
  writer.add(kSpeedSchema);
  writer.add(kSpeed);
  writer.add(kCamera);
  for (std::uint64_t chunk = 1; chunk <= 3; ++chunk) {
    write_message(writer, head_at(chunk * 10), "speed");
    write_message(writer, head_at(chunk * 10 + 5, kCamera), "about it");
    writer.flush();
  }
  writer.close();
  const MemorySource source(bytes_of(sink.file()));
  const Reader reader(source);
  MessageReader messages = reader.messages(
      {.topics = {kSpeed.topic}, .begin_ns = 20, .end_ns = {}, .heads = {kCamera.topic}});
  std::vector<std::uint64_t> times;
  while (const std::optional<StoredMessage> message = messages.next()) {
    times.push_back(message->log_time_ns);
  }

  EXPECT_EQ(times, (std::vector<std::uint64_t>{25, 20, 35, 30}));
}

TEST(Reader, EmptyFileHasNoMessages) {
  StringSink sink;
  Writer(sink).close();

  EXPECT_THAT(indexed(sink.file()), IsEmpty());
}

TEST(Reader, WhatIsNoFileIsDamage) {
  for (const std::string& file : {std::string("not an MCAP file at all"), std::string(200, 'x'),
                                  magic() + std::string(100, 'x') + magic()}) {
    const MemorySource source(bytes_of(file));
    EXPECT_THROW(const Reader reader(source), Damage) << file;
  }
}

}  // namespace
}  // namespace fastcycle::mcap
