#include "archive/doctor.h"

#include <cstddef>
#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/test_log.h"

namespace fastcycle::archive {
namespace {

using mcap::Opcode;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

struct Diagnosed {
  std::vector<std::string> errors;
  std::vector<std::string> warnings;
  Diagnosis diagnosis;
};

Diagnosed diagnosed(std::string_view file, const mcap::ReadLimits& limits = {}) {
  const mcap::MemorySource source(mcap::bytes_of(file), "test.mcap");
  Diagnosed result;
  result.diagnosis = diagnose(
      source,
      [&](const Finding& finding) {
        (finding.is_warning ? result.warnings : result.errors)
            .push_back(to_string(finding.problem));
      },
      limits);
  return result;
}

mcap::WriterOptions unchunked() {
  mcap::WriterOptions options = mcap::small_chunks();
  options.chunked = false;
  return options;
}

class Doctor : public ::testing::TestWithParam<mcap::WriterOptions> {};

INSTANTIATE_TEST_SUITE_P(Kinds, Doctor,
                         ::testing::Values(mcap::small_chunks(),
                                           mcap::small_chunks(mcap::Compression::kLz4),
                                           mcap::small_chunks(mcap::Compression::kZstd),
                                           unchunked(),
                                           mcap::without_summary(mcap::small_chunks())));

TEST_P(Doctor, FindsNothingInAFileInOrder) {
  const Diagnosed result = diagnosed(good_log(GetParam()));

  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_THAT(result.warnings, IsEmpty());
  EXPECT_EQ(result.diagnosis.messages, 12U);
}

TEST_P(Doctor, FindsAnyTruncation) {
  const std::string file = good_log(GetParam());
  for (std::size_t size = 0; size < file.size(); ++size) {
    EXPECT_GT(diagnosed(file.substr(0, size)).diagnosis.errors, 0U) << size;
  }
}

TEST_P(Doctor, FindsAnyCorruption) {
  const std::string good = good_log(GetParam());
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string file = good;
    file[at] = static_cast<char>(file[at] ^ 0x10);

    EXPECT_GT(diagnosed(file).diagnosis.errors, 0U) << at;
  }
}

/// A file without CRCs, in which a number was changed.
class Changed : public ::testing::Test {
 protected:
  /// Adds one to what stands `at` bytes behind the beginning of a record's content.
  void change(Opcode opcode, std::size_t at, std::size_t index = 0) {
    const std::size_t place = mcap::find_record(file_, opcode, index) + mcap::kFrameBytes + at;
    file_[place] = static_cast<char>(file_[place] + 1);
  }
  void expect_error(const std::string& expected) const {
    const Diagnosed result = diagnosed(file_);
    ASSERT_THAT(result.errors, SizeIs(1)) << expected;
    EXPECT_THAT(result.errors[0], HasSubstr(expected));
  }

  std::string file_ = good_log(mcap::without_crcs(mcap::small_chunks()));
};

TEST_F(Changed, TimeOfAChunkIsFound) {
  change(Opcode::kChunk, 8);
  const Diagnosed result = diagnosed(file_);

  // Its index then differs as well.
  ASSERT_THAT(result.errors, SizeIs(2));
  EXPECT_THAT(result.errors[0], HasSubstr("Chunk: expected message_end_time "));
  EXPECT_THAT(result.errors[1], HasSubstr("ChunkIndex: expected message_end_time "));
}

TEST_F(Changed, EntryOfAMessageIndexIsFound) {
  change(Opcode::kMessageIndex, 2 + 4);
  expect_error("MessageIndex: expected log_time 100 at byte ");
}

TEST_F(Changed, ChannelOfAMessageIndexIsFound) {
  change(Opcode::kMessageIndex, 0);
  const Diagnosed result = diagnosed(file_);

  EXPECT_GE(result.errors.size(), 2U);
  EXPECT_THAT(result.errors[0], HasSubstr("MessageIndex: expected"));
}

TEST_F(Changed, FieldsOfAChunkIndexAreFound) {
  change(Opcode::kChunkIndex, 0);
  expect_error("ChunkIndex: expected message_start_time 100, as the file has it, found 101");
}

TEST_F(Changed, PlaceInAChunkIndexIsFound) {
  change(Opcode::kChunkIndex, 16);
  expect_error("ChunkIndex: expected the offset of the record that it names");
}

TEST_F(Changed, OffsetOfAMessageIndexIsFound) {
  change(Opcode::kChunkIndex, 8 + 8 + 8 + 8 + 4 + 2);
  expect_error("ChunkIndex: expected message_index_offsets 1@");
}

TEST_F(Changed, StatisticsAreFound) {
  change(Opcode::kStatistics, 0);
  expect_error("Statistics: expected message_count 12, as the file has it, found 13");
}

TEST_F(Changed, CountOfAChannelIsFound) {
  change(Opcode::kStatistics, 8 + 2 + 4 + 4 + 4 + 4 + 8 + 8 + 4 + 2);
  expect_error("channel_message_counts of channel 1: 8, as the file has it, found 9");
}

TEST_F(Changed, AttachmentIndexIsFound) {
  change(Opcode::kAttachmentIndex, 16);
  expect_error("AttachmentIndex: expected log_time 5, as the file has it, found 6");
}

TEST_F(Changed, MetadataIndexIsFound) {
  change(Opcode::kMetadataIndex, 8 + 8 + 4);
  expect_error("MetadataIndex: expected name \"car\"");
}

TEST_F(Changed, SummaryOffsetsAreFound) {
  change(Opcode::kSummaryOffset, 1);
  expect_error("SummaryOffset: expected the beginning of the records Schema");
}

TEST_F(Changed, LengthOfAGroupIsFound) {
  change(Opcode::kSummaryOffset, 9);
  expect_error("SummaryOffset: expected group_length ");
}

TEST_F(Changed, PlaceOfTheSummaryOffsetsIsFound) {
  change(Opcode::kFooter, 8);
  expect_error("Footer: expected summary_offset_start ");
}

std::string with_records(const std::string& records) {
  return mcap::magic() + mcap::encoded(mcap::Header{.profile = "", .library = "test"}) + records +
         mcap::encoded(mcap::DataEnd{}) + mcap::encoded(mcap::Footer{}) + mcap::magic();
}

TEST(DoctorOf, NamelessLibraryWarns) {
  const Diagnosed result = diagnosed(mcap::file_of(""));

  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("Header: expected the name of the library")));
}

TEST(DoctorOf, SchemaThatLacksAnImportIsAnError) {
  mcap::Schema schema = scene_schema();
  schema.data = descriptor_set("file { name: 'scene.proto' dependency: 'point.proto' }");

  const Diagnosed result = diagnosed(with_records(mcap::encoded(schema)));

  EXPECT_THAT(
      result.errors,
      ElementsAre(HasSubstr("\"scene.proto\" imports \"point.proto\", which is not in it")));
}

TEST(DoctorOf, ProtobufWithoutASchemaOfProtobufIsAnError) {
  mcap::Channel channel = scene_channel();
  channel.schema_id = 0;

  const Diagnosed result = diagnosed(with_records(mcap::encoded(channel)));

  EXPECT_THAT(result.errors, ElementsAre(HasSubstr("expected a schema of protobuf for \"scene\"")));
}

std::string log_of(const std::vector<mcap::MessageHead>& heads, const std::string& data = "") {
  mcap::StringSink sink;
  mcap::Writer writer(sink, {.library = "test"});
  writer.add(scene_schema());
  writer.add(scene_channel());
  for (const mcap::MessageHead& head : heads) {
    mcap::write_message(writer, head, data);
  }
  writer.close();
  return sink.file();
}

TEST(DoctorOf, MessageThatIsNotOfItsTypeIsAnError) {
  const Diagnosed result = diagnosed(log_of({{.channel_id = 1}}, "\x0a\x05"));

  EXPECT_THAT(result.errors, ElementsAre(HasSubstr("Message: expected a demo.Scene")));
}

TEST(DoctorOf, TimesThatGoBackWarn) {
  const Diagnosed result = diagnosed(log_of({{.channel_id = 1, .sequence = 1, .log_time_ns = 5},
                                             {.channel_id = 1, .sequence = 2, .log_time_ns = 4},
                                             {.channel_id = 1, .sequence = 3, .log_time_ns = 3}}));

  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("found 2 decreasing ones, the first here")));
}

TEST(DoctorOf, NumbersThatAreMissingWarn) {
  const auto head = [](std::uint32_t sequence) {
    return mcap::MessageHead{.channel_id = 1, .sequence = sequence};
  };

  EXPECT_THAT(diagnosed(log_of({head(4), head(7), head(6)})).warnings,
              ElementsAre(HasSubstr("found 1 missing")));
  EXPECT_THAT(diagnosed(log_of({head(0xFFFFFFFF), head(0), head(2)})).warnings,
              ElementsAre(HasSubstr("found 1 missing")));
  EXPECT_THAT(diagnosed(log_of({head(0), head(0), head(0)})).warnings, IsEmpty());
}

std::string loss(const std::string& recorded, const std::string& disk) {
  return with_records(mcap::encoded(mcap::Metadata{.name = "fastcycle.loss",
                                                   .metadata = {{"topic", "scene"},
                                                                {"published", "10"},
                                                                {"recorded", recorded},
                                                                {"lost", "3"},
                                                                {"lost.disk", disk},
                                                                {"lost.pool", "1"}}}));
}

TEST(DoctorOf, LossThatDoesNotAddUpIsAnError) {
  EXPECT_THAT(diagnosed(loss("7", "2")).errors, IsEmpty());
  EXPECT_THAT(
      diagnosed(loss("8", "2")).errors,
      ElementsAre(HasSubstr("published = recorded + lost for \"scene\", found 10 = 8 + 3")));
  EXPECT_THAT(diagnosed(loss("7", "5")).errors,
              ElementsAre(HasSubstr("lost 6 for \"scene\", the sum of its reasons, found 3")));
  EXPECT_THAT(diagnosed(loss("many", "2")).errors, ElementsAre(HasSubstr("a number for")));
}

TEST(DoctorOf, MessageIndexWithoutAChunkIsAnError) {
  const Diagnosed result =
      diagnosed(with_records(mcap::encoded(mcap::MessageIndex{.channel_id = 1})));

  EXPECT_THAT(result.errors, ElementsAre(HasSubstr("MessageIndex: expected a chunk before it")));
}

TEST(DoctorOf, ManyFindingsAreCountedButNotAllReported) {
  std::string records;
  for (int i = 0; i < 3000; ++i) {
    records += mcap::encoded(mcap::MessageIndex{.channel_id = 1});
  }

  const Diagnosed result = diagnosed(with_records(records));

  EXPECT_EQ(result.diagnosis.errors, 3000U);
  EXPECT_THAT(result.errors, SizeIs(Diagnosis::kReportedMax));
}

TEST(DoctorOf, IndexBeyondTheLimitIsSaid) {
  const Diagnosed result = diagnosed(good_log(), {.index_bytes = 300});

  EXPECT_THAT(result.errors, ElementsAre(HasSubstr("at most 300 bytes of index")));
}

}  // namespace
}  // namespace fastcycle::archive
