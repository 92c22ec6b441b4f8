#include "mcap/record_reader.h"

#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mcap/test_file.h"

namespace fastcycle::mcap {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr auto kEnd = Stop::Reason::kEnd;
constexpr auto kTruncated = Stop::Reason::kTruncated;
constexpr auto kDamaged = Stop::Reason::kDamaged;

bool is_beginning_of(const Lines& lines, const Lines& whole) {
  return lines.size() <= whole.size() && std::equal(lines.begin(), lines.end(), whole.begin());
}

std::string one_message() {
  return encoded(kCamera) + encoded(Message{head_at(1, kCamera), bytes_of("image")});
}

std::string one_chunk() {
  const std::string records = one_message();
  return chunk_around(
      records,
      {.message_start_time_ns = 1, .message_end_time_ns = 1, .uncompressed_size = records.size()});
}

TEST(RecordReader, GivesAllRecordsInTheOrderOfTheFile) {
  StringSink sink;
  Writer writer(sink, without_summary({.profile = "p", .library = "l"}));
  writer.add(kCamera);
  write_message(writer, head_at(1, kCamera), "image");
  writer.write(Metadata{.name = "car", .metadata = {{"a", "b"}}});
  writer.close();

  const Streamed read = stream(sink.file());

  EXPECT_THAT(read.lines, ElementsAre("Header p l", "Metadata car a=b", "Chunk 1 1 76",
                                      "Channel 2 0 camera/front raw", "Message 2 1 1 0 image",
                                      "MessageIndex 2 1@40", ::testing::StartsWith("DataEnd "),
                                      ::testing::StartsWith("Footer 0 0 ")));
  EXPECT_EQ(read.stop.reason, kEnd);
}

TEST(RecordReader, FileThatWasNotClosedGivesWhatIsThere) {
  const Lines whole = stream(drive(small_chunks())).lines;

  const Streamed read = stream(drive(small_chunks(), false));

  EXPECT_EQ(read.stop.reason, kTruncated);
  EXPECT_EQ(only(read.lines, "Message"), only(whole, "Message"));
  EXPECT_THAT(to_string(read.stop.problem), HasSubstr("expected a record, found the end of the"));
}

class Truncation : public ::testing::TestWithParam<Compression> {};

INSTANTIATE_TEST_SUITE_P(All, Truncation,
                         ::testing::Values(Compression::kNone, Compression::kLz4,
                                           Compression::kZstd));

TEST_P(Truncation, EveryBeginningOfAFileGivesABeginningOfItsRecords) {
  for (const bool chunked : {true, false}) {
    WriterOptions options = small_chunks(GetParam());
    options.chunked = chunked;
    const std::string file = drive(options);
    // Of a chunk that is cut off its records come, but not itself.
    const Lines whole = stream(file).lines;
    const Lines messages = only(whole, "Message");

    for (std::size_t size = 0; size < file.size(); ++size) {
      const Streamed read = stream(file.substr(0, size));

      EXPECT_EQ(read.stop.reason, kTruncated) << size << to_string(read.stop.problem);
      EXPECT_TRUE(is_beginning_of(only(read.lines, "Message"), messages)) << size;
      EXPECT_TRUE(is_beginning_of(only(read.lines, "Chunk"), only(whole, "Chunk"))) << size;
      EXPECT_LE(read.stop.problem.place.offset, size);
    }
  }
}

TEST_P(Truncation, EveryBeginningOfAFileIsReadByItsMessages) {
  const std::string file = drive(small_chunks(GetParam()));
  for (std::size_t size = kMagic.size(); size < file.size(); ++size) {
    const std::string begun = file.substr(0, size);
    const MemorySource source(bytes_of(begun), "test.mcap");
    const Reader reader(source);

    Lines expected = only(stream(begun).lines, "Message");
    Lines found = messages_of(reader);

    std::ranges::sort(expected);
    std::ranges::sort(found);
    EXPECT_EQ(found, expected) << size;
    EXPECT_TRUE(reader.was_scanned());
    EXPECT_TRUE(reader.problem());
  }
}

TEST(RecordReader, LastChunkThatIsCutOffGivesItsWholeRecords) {
  StringSink sink;
  Writer writer(sink);
  writer.add(kCamera);
  for (std::uint64_t i = 0; i < 10; ++i) {
    write_message(writer, head_at(i, kCamera), "an image of 23 bytes...");
  }
  writer.flush();
  const std::size_t end_of_fourth =
      find_record(sink.file(), Opcode::kChunk) + 9 + 40 + 40 + 4 * (31 + 23);

  const Streamed exactly = stream(sink.file().substr(0, end_of_fourth));
  const Streamed within = stream(sink.file().substr(0, end_of_fourth + 20));

  EXPECT_THAT(only(exactly.lines, "Message"), SizeIs(4));
  EXPECT_EQ(within.lines, exactly.lines);
  EXPECT_EQ(exactly.stop.reason, kTruncated);
  EXPECT_EQ(to_string(exactly.stop.problem),
            "test.mcap: byte 25, byte 256 of the chunk's records: Chunk: expected more records, "
            "found the end of the file, at byte 330");
}

TEST(RecordReader, UnknownRecordsArePassedOver) {
  const std::string unknown = raw_record(0x42, "reserved") + raw_record(0xFE, "private");
  const std::string records = encoded(kCamera) + unknown + one_message();
  const std::string chunk = chunk_around(records, {.uncompressed_size = records.size()});

  const Streamed read = stream(file_of(unknown + chunk + unknown));

  EXPECT_EQ(read.stop.reason, kEnd) << to_string(read.stop.problem);
  EXPECT_THAT(only(read.lines, "Message"), SizeIs(1));
  EXPECT_THAT(indexed(file_of(unknown + chunk + unknown)), SizeIs(1));
}

TEST(RecordReader, LargeUnknownRecordsArePassedOver) {
  const Streamed read = stream(file_of(raw_record(0x80, std::string(1'000'000, 'x'))),
                               {.limits = {.record_bytes = 1000, .small_record_bytes = 1000}});

  EXPECT_EQ(read.stop.reason, kEnd) << to_string(read.stop.problem);
}

TEST(RecordReader, BytesBehindTheKnownFieldsArePassedOver) {
  const auto longer = [](std::string record) {
    const std::uint64_t length = record.size() - 9 + 3;
    return with(record, 1, length) + "\x01\xFF\xFF";
  };
  const std::string records =
      longer(encoded(kSpeedSchema)) + longer(encoded(kSpeed)) + longer(encoded(Metadata{}));

  const Streamed read = stream(magic() + longer(encoded(Header{})) + records +
                               longer(encoded(DataEnd{})) + encoded(Footer{}) + magic());

  EXPECT_EQ(read.stop.reason, kEnd) << to_string(read.stop.problem);
  EXPECT_THAT(read.lines, SizeIs(6));
}

TEST(RecordReader, SchemaOfIdZeroIsPassedOver) {
  const Streamed read = stream(file_of(encoded(Schema{}) + encoded(Schema{.name = "other"})));

  EXPECT_EQ(read.stop.reason, kEnd) << to_string(read.stop.problem);
  EXPECT_THAT(only(read.lines, "Schema"), IsEmpty());
}

TEST(RecordReader, DamageIsNamedWithItsPlace) {
  std::string file = drive(small_chunks());
  const std::size_t chunk = find_record(file, Opcode::kChunk);
  file[chunk + 9 + 40 + 20] = '?';

  const Streamed read = stream(file);

  EXPECT_EQ(read.stop.reason, kDamaged);
  EXPECT_THAT(to_string(read.stop.problem),
              ::testing::MatchesRegex("test\\.mcap: byte [0-9]+: Chunk: expected CRC "
                                      "0x[0-9a-f]{8} of its records, found 0x[0-9a-f]{8}"));
  EXPECT_EQ(read.stop.problem.place.offset, chunk);
}

TEST(RecordReader, CrcsAreNotLookedAtIfNobodyWants) {
  std::string file = drive(small_chunks());
  file[file.find("number 0")] = 'N';

  EXPECT_EQ(stream(file).stop.reason, kDamaged);
  EXPECT_EQ(stream(file, {.check_crcs = false}).stop.reason, kEnd);
  EXPECT_THAT(indexed(file, {}, {.check_crcs = false}), Contains(HasSubstr("Number 0")));
}

/// All that can be read, and how often something could not.
struct Recovered {
  Lines lines;
  std::size_t damage_count = 0;
  Stop stop;
};

Recovered recover(const std::string& file) {
  const MemorySource source(bytes_of(file), "test.mcap");
  RecordReader reader(source);
  Recovered result;
  do {
    while (const std::optional<Record> record = reader.next()) {
      result.lines.push_back(std::visit(LineOf{}, *record));
    }
    result.damage_count += reader.stop()->reason == kDamaged ? 1 : 0;
  } while (reader.resume());
  result.stop = *reader.stop();
  return result;
}

TEST(RecordReader, ReadingGoesOnBehindADamagedChunk) {
  std::string file = drive(small_chunks());
  file[file.find("number 11")] = '?';

  const Recovered recovered = recover(file);

  EXPECT_EQ(recovered.damage_count, 1U);
  EXPECT_EQ(recovered.stop.reason, kEnd);
  EXPECT_THAT(only(recovered.lines, "Chunk"), SizeIs(4));
  EXPECT_THAT(recovered.lines, Contains(HasSubstr("number 8,")));
  EXPECT_THAT(recovered.lines, ::testing::Not(Contains(HasSubstr("number 11,"))));
}

TEST(RecordReader, ReadingGoesOnBehindARecordThatIsWrongInAChunk) {
  const std::string records =
      one_message() + encoded(Message{head_at(2), {}}) + one_message();  // An unknown channel.
  const std::string chunk = chunk_around(records, {.uncompressed_size = records.size()});

  const Recovered recovered = recover(file_of(chunk));

  EXPECT_EQ(recovered.damage_count, 1U);
  EXPECT_EQ(recovered.stop.reason, kEnd);
  EXPECT_THAT(only(recovered.lines, "Message"), SizeIs(2));
}

TEST(RecordReader, ZeroesAtTheEndAreDamage) {
  const Streamed read = stream(drive(small_chunks(), false) + std::string(100, '\0'));

  EXPECT_EQ(read.stop.reason, kDamaged);
  EXPECT_THAT(only(read.lines, "Message"), SizeIs(12));
  EXPECT_THAT(to_string(read.stop.problem), HasSubstr("opcode 0"));
}

/// What is wrong with a file, which must be damaged; it has to say where and what.
std::string damage_of(const std::string& file, const ReadOptions& options = {}) {
  const Streamed read = stream(file, options);
  EXPECT_EQ(read.stop.reason, kDamaged);
  const std::string text = to_string(read.stop.problem);
  EXPECT_THAT(text, HasSubstr("test.mcap: byte "));
  EXPECT_THAT(text, HasSubstr("expected "));
  EXPECT_THAT(text, HasSubstr("found "));
  return text;
}

TEST(RecordReader, RecordsStandOnlyWhereTheyMay) {
  const std::string header = encoded(Header{});
  const std::string end = encoded(DataEnd{});
  const std::string footer = encoded(Footer{});

  EXPECT_THAT(damage_of("not an MCAP file"), HasSubstr("the magic bytes of MCAP"));
  EXPECT_THAT(damage_of(magic() + end + footer + magic()), HasSubstr("a Header first"));
  EXPECT_THAT(damage_of(magic() + header + footer + magic()),
              HasSubstr("Footer: expected a record"));
  EXPECT_THAT(damage_of(magic() + raw_record(0x99, "") + header), HasSubstr("a Header first"));
  EXPECT_THAT(damage_of(file_of(header)), HasSubstr("Header: expected a record of the data"));
  EXPECT_THAT(damage_of(file_of(encoded(Statistics{}))), HasSubstr("one of another section"));
  EXPECT_THAT(damage_of(file_of(end + one_message())), HasSubstr("Message: expected a record of"));
  EXPECT_THAT(damage_of(file_of("") + "x"), HasSubstr("found 1 more bytes"));
  EXPECT_THAT(damage_of(file_of("") + magic()), HasSubstr("found 8 more bytes"));
}

TEST(RecordReader, WhatFollowsTheEndIsToldFromAMissingEnd) {
  const std::string whole = file_of("");

  EXPECT_TRUE(is_behind_end(stream(whole + whole).stop.problem));
  EXPECT_FALSE(is_behind_end(stream(whole.substr(0, whole.size() - 1)).stop.problem));
  EXPECT_FALSE(is_behind_end(stream(whole).stop.problem));
}

TEST(RecordReader, OnlyDefinitionsAndMessagesStandInChunks) {
  for (const std::string& record :
       {one_chunk(), encoded(Metadata{}), encoded(DataEnd{}), raw_record(0, "")}) {
    const std::string chunk = chunk_around(record, {.uncompressed_size = record.size()});

    EXPECT_THAT(damage_of(file_of(chunk)), HasSubstr("a Schema, Channel or Message in a chunk"));
  }
}

TEST(RecordReader, WhatAMessageNeedsComesBeforeIt) {
  const std::string message = encoded(Message{head_at(1), {}});

  EXPECT_THAT(damage_of(file_of(message)), HasSubstr("a channel_id that was defined before"));
  EXPECT_THAT(damage_of(file_of(encoded(kSpeed))), HasSubstr("a schema_id that was defined"));
}

TEST(RecordReader, SameIdWithOtherContentIsDamage) {
  Channel other = kCamera;
  other.topic = "camera/rear";
  Schema other_schema = kSpeedSchema;
  other_schema.data += "x";

  EXPECT_THAT(damage_of(file_of(encoded(kCamera) + encoded(other))), HasSubstr("id 2 as before"));
  EXPECT_THAT(damage_of(file_of(encoded(kSpeedSchema) + encoded(other_schema))),
              HasSubstr("id 1 as before"));
  EXPECT_EQ(stream(file_of(encoded(kCamera) + encoded(kCamera))).stop.reason, kEnd);
}

TEST(RecordReader, LengthsThatLieAreNamed) {
  constexpr std::uint64_t kHuge = ~std::uint64_t{0};
  const std::string good = drive(small_chunks());
  for (const Opcode opcode :
       {Opcode::kHeader, Opcode::kChunk, Opcode::kAttachment, Opcode::kMetadata,
        Opcode::kMessageIndex, Opcode::kDataEnd, Opcode::kStatistics, Opcode::kFooter}) {
    const std::size_t at = find_record(good, opcode);
    for (const std::uint64_t length : {kHuge, kHuge - 8, kHuge >> 1U, std::uint64_t{1} << 40U}) {
      EXPECT_THAT(damage_of(with(good, at + 1, length)), HasSubstr("found the end of the file"));
    }
  }
  // The length of a text, and that of the records in a chunk.
  EXPECT_THAT(damage_of(with(good, find_record(good, Opcode::kHeader) + 9, ~std::uint32_t{0})),
              HasSubstr("Header: expected profile of 4294967295 bytes, found"));
  EXPECT_THAT(damage_of(with(good, find_record(good, Opcode::kChunk) + 9 + 32, kHuge)),
              HasSubstr("records of 18446744073709551615 bytes"));
}

TEST(RecordReader, WhatAFileMayAskForIsLimited) {
  const std::string text(5000, 'x');
  const std::string message =
      encoded(kCamera) + encoded(Message{{.channel_id = 2}, bytes_of(text)});
  const std::string chunk = chunk_around(message, {.uncompressed_size = message.size()});
  const auto with_limits = [](const ReadLimits& limits) { return ReadOptions{.limits = limits}; };

  EXPECT_THAT(damage_of(file_of(message), with_limits({.record_bytes = 5000})),
              HasSubstr("Message: expected at most 5000 bytes of content, found 5022"));
  EXPECT_THAT(damage_of(file_of(encoded(Metadata{.name = text})),
                        with_limits({.small_record_bytes = 5000})),
              HasSubstr("Metadata: expected at most 5000 bytes of content, found 5008"));
  EXPECT_THAT(damage_of(file_of(chunk), with_limits({.chunk_bytes = 5000})),
              HasSubstr("Chunk: expected at most 5000 bytes of records"));
  EXPECT_THAT(damage_of(file_of(encoded(Schema{.id = 1, .name = text})),
                        with_limits({.definition_bytes = 5000})),
              HasSubstr("at most 5000 bytes of schemas and channels"));
}

TEST(RecordReader, ReadingGoesOnBehindARecordThatIsTooLarge) {
  const std::string text(5000, 'x');
  const std::string file = file_of(encoded(Metadata{.name = text}) + one_message());
  const MemorySource source(bytes_of(file));
  RecordReader reader(source, {.limits = {.small_record_bytes = 1000}});
  while (reader.next()) {
  }
  ASSERT_EQ(reader.stop()->reason, kDamaged);

  ASSERT_TRUE(reader.resume());

  std::size_t message_count = 0;
  while (const std::optional<Record> record = reader.next()) {
    message_count += std::holds_alternative<Message>(*record) ? 1 : 0;
  }
  EXPECT_EQ(message_count, 1U);
  EXPECT_EQ(reader.stop()->reason, kEnd);
  EXPECT_FALSE(reader.resume());
}

TEST(RecordReader, ChunksThatLieOfTheirSizeAreNamed) {
  const std::string records(100'000, 'x');
  std::vector<std::byte> compressed;
  const Bytes part = bytes_of(records);
  Compressor().compress(Compression::kZstd, 0, {&part, 1}, compressed);
  const auto chunk = [&](std::uint64_t size, const std::string& compression) {
    return file_of(
        chunk_around(text_of(compressed), {.uncompressed_size = size, .compression = compression}));
  };

  EXPECT_THAT(damage_of(chunk(~std::uint64_t{0}, "zstd")), HasSubstr("at most 536870912 bytes"));
  EXPECT_THAT(damage_of(chunk(500'000'000, "zstd")), HasSubstr("that cannot become as many"));
  EXPECT_THAT(damage_of(chunk(99'999, "zstd")), HasSubstr("zstd says"));
  EXPECT_THAT(damage_of(chunk(100'001, "zstd")), HasSubstr("found 100000 bytes"));
  EXPECT_THAT(damage_of(chunk(1000, "lz4")), HasSubstr("lz4 says"));
  EXPECT_THAT(damage_of(chunk(1000, "")), HasSubstr("that cannot become as many"));
  EXPECT_THAT(damage_of(chunk(1000, "rar")), HasSubstr("found \"rar\""));
}

TEST(RecordReader, FooterHasToFit) {
  const std::string good = drive(small_chunks());
  const std::size_t footer = find_record(good, Opcode::kFooter);
  const std::string without = drive(without_crcs(small_chunks()));

  EXPECT_THAT(damage_of(with(good, footer + 9, std::uint64_t{8})), HasSubstr("summary_start"));
  EXPECT_THAT(damage_of(with(without, footer + 9, std::uint64_t{0})), HasSubstr("summary_start"));
  EXPECT_THAT(damage_of(with(good, footer + 9 + 8, std::uint64_t{8})),
              HasSubstr("Footer: expected CRC"));
}

}  // namespace
}  // namespace fastcycle::mcap
