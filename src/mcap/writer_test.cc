#include "mcap/writer.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "mcap/test_file.h"

namespace fastcycle::mcap {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// What `act` throws, or nothing.
template <typename Act>
std::string error_of(const Act& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Writer, EmptyFileIsWhatTheFormatSays) {
  StringSink sink;
  Writer writer(sink, without_summary({}));

  writer.close();

  const std::string expected =
      magic() + raw_record(0x01, std::string(8, '\0')) +
      raw_record(0x0F, std::string("\x73\xc3\xfa\xeb", 4)) +
      raw_record(0x02, std::string(16, '\0') + std::string("\xb0\xc9\xc4\x6f", 4)) + magic();
  EXPECT_EQ(sink.file(), expected);
}

TEST(Writer, EveryCompressionIsReadBack) {
  const Lines plain = stream(drive(small_chunks())).lines;
  ASSERT_THAT(only(plain, "Message"), SizeIs(12));

  for (const Compression compression : {Compression::kLz4, Compression::kZstd}) {
    const Streamed read = stream(drive(small_chunks(compression)));

    EXPECT_EQ(read.stop.reason, Stop::Reason::kEnd) << to_string(read.stop.problem);
    EXPECT_EQ(only(read.lines, "Message"), only(plain, "Message"));
    EXPECT_EQ(only(read.lines, "Statistics"), only(plain, "Statistics"));
  }
}

TEST(Writer, CrcOfTheFileIsRightWhetherOrNotItsChunksHaveOne) {
  for (const Compression compression :
       {Compression::kNone, Compression::kLz4, Compression::kZstd}) {
    for (const bool crc : {true, false}) {
      WriterOptions options = small_chunks(compression);
      options.chunk.crc = crc;

      const Streamed read = stream(drive(options));

      EXPECT_EQ(read.stop.reason, Stop::Reason::kEnd) << to_string(read.stop.problem);
      EXPECT_NE(only(read.lines, "DataEnd"), Lines{"DataEnd 0"});
    }
  }
}

TEST(Writer, StatisticsCountWhatWasWritten) {
  EXPECT_THAT(only(stream(drive(small_chunks())).lines, "Statistics"),
              ElementsAre("Statistics 12 1 2 1 1 5 0 110 1=10 2=2"));
}

TEST(Writer, EachPartOfTheSummaryCanBeLeftOut) {
  const auto count = [](const WriterOptions& options, std::string_view record) {
    const Streamed read = stream(drive(options));
    EXPECT_EQ(read.stop.reason, Stop::Reason::kEnd) << to_string(read.stop.problem);
    return only(read.lines, record).size();
  };
  const WriterOptions all = small_chunks();
  const std::vector<std::pair<std::string, bool WriterOptions::*>> parts{
      {"Statistics", &WriterOptions::statistics},
      {"ChunkIndex", &WriterOptions::chunk_index},
      {"AttachmentIndex", &WriterOptions::attachment_index},
      {"MetadataIndex", &WriterOptions::metadata_index},
      {"SummaryOffset", &WriterOptions::summary_offsets},
      {"MessageIndex", &WriterOptions::message_index}};
  for (const auto& [record, option] : parts) {
    WriterOptions options = all;
    options.*option = false;

    EXPECT_GT(count(all, record), 0U) << record;
    EXPECT_EQ(count(options, record), 0U) << record;
  }
  WriterOptions without_definitions = all;
  without_definitions.repeat_schemas = without_definitions.repeat_channels = false;
  EXPECT_EQ(count(all, "Schema") + count(all, "Channel"), 6U);
  EXPECT_EQ(count(without_definitions, "Schema") + count(without_definitions, "Channel"), 3U);
}

TEST(Writer, DataOfSeveralPartsIsOneMessage) {
  for (const bool chunked : {true, false}) {
    StringSink sink;
    Writer writer(sink, {.chunked = chunked});
    writer.add(kCamera);

    const std::vector<Bytes> parts{bytes_of("head "), Bytes{}, bytes_of("and tail")};
    writer.write(head_at(7, kCamera), parts);
    writer.close();

    EXPECT_THAT(only(stream(sink.file()).lines, "Message"),
                ElementsAre("Message 2 7 7 6 head and tail"));
  }
}

TEST(Writer, ChunkNeverGrowsBeyondItsSizeUnlessForOneMessage) {
  StringSink sink;
  Writer writer(sink, {.chunk_bytes = 1000});
  writer.add(kCamera);
  writer.flush();
  for (const std::size_t size : {100U, 100U, 5000U, 100U, 600U, 100U, 300U}) {
    write_message(writer, head_at(1, kCamera), std::string(size, 'x'));
  }
  writer.close();

  // Each message has 31 bytes beside its data.
  EXPECT_THAT(only(stream(sink.file()).lines, "Chunk"),
              ElementsAre("Chunk 1 1 262", "Chunk 1 1 5031", "Chunk 1 1 893", "Chunk 1 1 331"));
}

TEST(Writer, DefinitionsAloneNeedNoChunk) {
  StringSink sink;
  Writer writer(sink);
  writer.add(kSpeedSchema);
  writer.add(kSpeed);
  writer.close();

  const Streamed read = stream(sink.file());

  EXPECT_EQ(read.stop.reason, Stop::Reason::kEnd);
  EXPECT_THAT(only(read.lines, "Chunk"), IsEmpty());
  EXPECT_THAT(only(read.lines, "Channel"), SizeIs(2));
}

TEST(Writer, SameDefinitionTwiceIsWrittenOnce) {
  StringSink sink;
  Writer writer(sink, {.repeat_channels = false});
  writer.add(kCamera);
  writer.add(kCamera);
  writer.close();

  EXPECT_THAT(only(stream(sink.file()).lines, "Channel"), SizeIs(1));
}

TEST(Writer, WhatTheFormatForbidsIsRefusedAndWritingGoesOn) {
  StringSink sink;
  Writer writer(sink);
  writer.add(kSpeedSchema);
  writer.add(kSpeed);
  Schema schema_zero = kSpeedSchema;
  schema_zero.id = 0;
  Schema other_schema = kSpeedSchema;
  other_schema.name = "demo.Other";
  Channel other_channel = kSpeed;
  other_channel.topic = "other";
  Channel orphan = kCamera;
  orphan.schema_id = 9;

  EXPECT_EQ(error_of([&] { writer.add(schema_zero); }),
            "test.mcap: byte 25: Schema: expected an id that is not 0, found 0 for \"demo.Speed\"");
  EXPECT_THAT(error_of([&] { writer.add(other_schema); }), HasSubstr("found another one"));
  EXPECT_THAT(error_of([&] { writer.add(other_channel); }), HasSubstr("found another one"));
  EXPECT_THAT(error_of([&] { writer.add(orphan); }), HasSubstr("found 9 for \"camera/front\""));
  EXPECT_THAT(error_of([&] { write_message(writer, head_at(1, kCamera), "x"); }),
              HasSubstr("expected a channel that was added, found 2"));

  write_message(writer, head_at(1), "x");
  writer.close();
  EXPECT_EQ(stream(sink.file()).stop.reason, Stop::Reason::kEnd);
  EXPECT_THAT(indexed(sink.file()), SizeIs(1));
}

TEST(Writer, ClosedFileTakesNothing) {
  StringSink sink;
  Writer writer(sink);
  writer.add(kCamera);
  writer.close();
  const std::string before = sink.file();

  EXPECT_THAT(error_of([&] { write_message(writer, head_at(1, kCamera), "x"); }),
              HasSubstr("found one that was closed"));
  EXPECT_THAT(error_of([&] { writer.close(); }), HasSubstr("found one that was closed"));
  EXPECT_EQ(sink.file(), before);
}

/// A disk that is full after some bytes.
class FullSink final : public Sink {
 public:
  explicit FullSink(std::size_t capacity) : capacity_(capacity) {}

  void append(std::span<const Bytes> parts) override {
    for (const Bytes part : parts) {
      size_ += part.size();
    }
    if (size_ > capacity_) {
      throw Error({.place = {.file = name_, .offset = size_},
                   .record = {},
                   .expected = "to append to it",
                   .found = "No space left on device"});
    }
  }
  [[nodiscard]] const std::string& name() const override { return name_; }

 private:
  const std::string name_ = "full.mcap";
  const std::size_t capacity_;
  std::size_t size_ = 0;
};

TEST(Writer, FullDiskIsNamedAndNothingIsWrittenAfterIt) {
  FullSink sink(200);
  Writer writer(sink, {.chunked = false});
  writer.add(kCamera);

  EXPECT_THAT(error_of([&] { write_message(writer, head_at(1, kCamera), std::string(500, 'x')); }),
              HasSubstr("full.mcap: byte 596: expected to append to it, found No space left"));
  EXPECT_THAT(error_of([&] { write_message(writer, head_at(1, kCamera), "x"); }),
              HasSubstr("found one where that failed before"));
  EXPECT_THAT(error_of([&] { writer.close(); }), HasSubstr("found one where that failed before"));
}

TEST(Writer, ChunkComposedOutsideAndClosedOnAnotherThreadIsAppended) {
  StringSink sink;
  Writer writer(sink, {.chunk = {.compression = Compression::kZstd}});
  writer.add(kSpeedSchema);
  writer.add(kSpeed);
  write_message(writer, head_at(5), "own");
  ChunkBuilder chunk({.compression = Compression::kLz4});
  chunk.add(kCamera);
  chunk.add(Message{head_at(9, kCamera), bytes_of("image")});
  chunk.add(Message{head_at(3), bytes_of("late")});

  std::thread([&] { chunk.close(); }).join();
  writer.write(chunk);
  write_message(writer, head_at(4, kCamera), "own again");
  writer.close();

  EXPECT_EQ(stream(sink.file()).stop.reason, Stop::Reason::kEnd);
  EXPECT_THAT(indexed(sink.file()), ElementsAre("Message 1 3 3 2 late", "Message 2 4 4 3 own again",
                                                "Message 1 5 5 4 own", "Message 2 9 9 8 image"));
}

TEST(Writer, BorrowedDataIsTheSameAsCopiedData) {
  const std::string image(100'000, 'i');
  for (const Compression compression :
       {Compression::kNone, Compression::kLz4, Compression::kZstd}) {
    const auto file = [&](auto add) {
      StringSink sink;
      Writer writer(sink);
      writer.add(kCamera);
      ChunkBuilder chunk({.compression = compression});
      const std::vector<Bytes> parts{bytes_of("head"), bytes_of(image)};
      add(chunk, head_at(1, kCamera), parts);
      add(chunk, head_at(2, kCamera), parts);
      writer.write(chunk);
      writer.close();
      return sink.file();
    };

    const std::string copied = file([](ChunkBuilder& chunk, const MessageHead& head,
                                       std::span<const Bytes> parts) { chunk.add(head, parts); });
    const std::string borrowed =
        file([](ChunkBuilder& chunk, const MessageHead& head, std::span<const Bytes> parts) {
          chunk.borrow(head, parts);
        });

    EXPECT_EQ(stream(borrowed).stop.reason, Stop::Reason::kEnd);
    EXPECT_EQ(indexed(borrowed), indexed(copied));
    if (compression == Compression::kNone) {
      EXPECT_EQ(borrowed, copied);
    }
  }
}

TEST(Writer, ClearedChunkIsAsNew) {
  StringSink once;
  StringSink twice;
  ChunkBuilder chunk({.compression = Compression::kZstd});
  for (StringSink* sink : {&once, &twice}) {
    Writer writer(*sink);
    writer.add(kCamera);
    chunk.add(Message{head_at(1, kCamera), bytes_of("image")});
    writer.write(chunk);
    writer.close();
    chunk.clear();
  }

  EXPECT_EQ(once.file(), twice.file());
}

TEST(Writer, ChunkThatCouldNotBeReadInOrderIsRefused) {
  StringSink sink;
  Writer writer(sink);
  ChunkBuilder unknown;
  unknown.add(Message{head_at(1, kCamera), bytes_of("x")});
  ChunkBuilder late;
  late.add(Message{head_at(1, kCamera), bytes_of("x")});
  late.add(kCamera);
  ChunkBuilder orphan;
  orphan.add(kSpeed);
  const std::string before = sink.file();

  EXPECT_THAT(error_of([&] { writer.write(unknown); }), HasSubstr("found one of channel 2"));
  EXPECT_THAT(error_of([&] { writer.write(late); }), HasSubstr("found one of channel 2"));
  EXPECT_THAT(error_of([&] { writer.write(orphan); }), HasSubstr("found 1 for"));
  EXPECT_EQ(sink.file(), before);
}

TEST(Writer, FileWithoutChunksTakesNone) {
  StringSink sink;
  Writer writer(sink, {.chunked = false});
  ChunkBuilder chunk;

  EXPECT_THAT(error_of([&] { writer.write(chunk); }), HasSubstr("found a chunk"));
}

TEST(Writer, IndexGrowsAsItIsSaid) {
  StringSink sink;
  Writer writer(sink, {.chunk_bytes = 1});
  writer.add(kCamera);
  for (std::uint64_t i = 0; i < 1000; ++i) {
    write_message(writer, head_at(i, kCamera), "x");
  }

  EXPECT_GT(writer.index_bytes(), 1000U * 80);
  EXPECT_LT(writer.index_bytes(), 1000U * 100);
  EXPECT_EQ(writer.statistics().chunk_count, 1000U);
  EXPECT_EQ(writer.size(), sink.file().size());
}

class Files : public ::testing::Test {
 protected:
  Files() {
    std::string name = (std::filesystem::temp_directory_path() / "fastcycle_XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) {
      folder_ = name;
    }
  }
  ~Files() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_;
};

TEST_F(Files, FileOnTheDiskIsTheSameAsInMemory) {
  const std::filesystem::path path = folder_ / "drive.mcap";
  {
    FileSink sink(path);
    Writer writer(sink, {.chunked = false});
    writer.add(kCamera);
    const std::vector<Bytes> parts(200, bytes_of("0123456789"));  // More than one call takes.
    writer.write(head_at(1, kCamera), parts);
    writer.close();
    sink.sync();
  }

  const FileSource source(path);
  const Reader reader(source);
  MessageReader messages = reader.messages();
  const std::optional<StoredMessage> message = messages.next();

  ASSERT_TRUE(message);
  EXPECT_EQ(message->data.size(), 2000U);
  EXPECT_EQ(message->channel->topic, "camera/front");
  EXPECT_EQ(source.size(), std::filesystem::file_size(path));
  struct stat status{};
  ASSERT_EQ(::stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0077U, 0U) << "nobody else may read it";
}

TEST_F(Files, ExistingFileIsNotOverwritten) {
  const std::filesystem::path path = folder_ / "drive.mcap";
  std::ofstream(path) << "precious";

  EXPECT_THAT(error_of([&] { const FileSink sink(path); }), HasSubstr("File exists"));
}

TEST_F(Files, WhatIsNoFileIsNamed) {
  const std::filesystem::path fifo = folder_ / "fifo";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);

  EXPECT_THAT(error_of([&] { const FileSource source(folder_ / "none.mcap"); }),
              HasSubstr("none.mcap: expected a file that can be read, found No such file"));
  EXPECT_THAT(error_of([&] { const FileSource source(folder_); }),
              HasSubstr("a regular file, found a folder"));
  EXPECT_THAT(error_of([&] { const FileSource source(fifo); }), HasSubstr("a regular file"));
}

}  // namespace
}  // namespace fastcycle::mcap
