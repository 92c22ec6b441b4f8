#include "archive/recover.h"

#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/test_log.h"

namespace fastcycle::archive {
namespace {

using mcap::Compression;
using mcap::Lines;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

struct Recovered {
  std::string file;
  Recovery recovery;
};

/// Recovers and verifies.
Recovered recovered(std::string_view file) {
  const mcap::MemorySource source(mcap::bytes_of(file), "test.mcap");
  mcap::StringSink sink;
  Recovered result;
  result.recovery = recover(source, sink);
  result.file = sink.file();
  const mcap::MemorySource written(mcap::bytes_of(result.file), "out.mcap");
  verify(written, result.recovery.kept);
  return result;
}

Lines messages_in(std::string_view file) {
  return mcap::only(mcap::stream(file).lines, "Message");
}

bool is_part_of(const Lines& lines, const Lines& whole) {
  return std::ranges::all_of(
      lines, [&](const std::string& line) { return std::ranges::count(whole, line) > 0; });
}

mcap::WriterOptions unchunked() {
  mcap::WriterOptions options = mcap::small_chunks();
  options.chunked = false;
  return options;
}

class Recover : public ::testing::TestWithParam<mcap::WriterOptions> {};

INSTANTIATE_TEST_SUITE_P(Kinds, Recover,
                         ::testing::Values(mcap::small_chunks(),
                                           mcap::small_chunks(Compression::kLz4),
                                           mcap::small_chunks(Compression::kZstd), unchunked(),
                                           mcap::without_summary(mcap::small_chunks())));

TEST_P(Recover, FileInOrderLosesNothing) {
  const std::string file = mcap::drive(GetParam());

  const Recovered result = recovered(file);

  EXPECT_EQ(content_of(result.file), content_of(file));
  EXPECT_EQ(messages_in(result.file), messages_in(file)) << "in the order of the file";
  EXPECT_EQ(result.recovery.kept.messages, 12U);
  EXPECT_EQ(result.recovery.loss_count, 0U);
  EXPECT_THAT(result.recovery.mended, IsEmpty());
}

TEST_P(Recover, AnyTruncationGivesTheWholeMessages) {
  const std::string file = mcap::drive(GetParam());
  const mcap::Streamed whole = mcap::stream(file);
  for (std::size_t size = 0; size < file.size(); ++size) {
    SCOPED_TRACE(size);
    const std::string begun = file.substr(0, size);
    const Lines expected = messages_in(begun);

    const Recovered result = recovered(begun);

    EXPECT_EQ(messages_in(result.file), expected);
    EXPECT_EQ(result.recovery.kept.messages, expected.size());
    EXPECT_GT(result.recovery.loss_count + result.recovery.mended.size(), 0U);
    if (expected.size() == 12) {
      EXPECT_EQ(result.recovery.loss_count, 0U);
    }
  }
}

TEST_P(Recover, AnyCorruptionGivesAFileThatCanBeRead) {
  const std::string good = mcap::drive(GetParam());
  const Lines whole = messages_in(good);
  for (std::size_t at = 0; at < good.size(); ++at) {
    for (const int change : {0x01, 0x80, 0xFF}) {
      SCOPED_TRACE(at);
      std::string file = good;
      file[at] = static_cast<char>(file[at] ^ change);

      const Recovered result = recovered(file);

      EXPECT_GT(result.recovery.loss_count + result.recovery.mended.size(), 0U);
      if (GetParam().chunked) {
        EXPECT_TRUE(is_part_of(messages_in(result.file), whole));
      }
    }
  }
}

TEST(RecoverDamage, ChunkThatIsDamagedIsLostAloneAndItsMessagesAreCounted) {
  std::string file = mcap::drive(mcap::small_chunks());
  const Lines whole = messages_in(file);
  const std::size_t second = mcap::find_record(file, mcap::Opcode::kChunk, 1);
  const std::size_t after = mcap::find_record(file, mcap::Opcode::kMessageIndex, 1);
  file[second + 80] = static_cast<char>(file[second + 80] ^ 1);

  const Recovered result = recovered(file);

  ASSERT_THAT(result.recovery.losses, SizeIs(1));
  const Loss& loss = result.recovery.losses.front();
  EXPECT_EQ(loss.problem.place.offset, second);
  EXPECT_GT(loss.bytes, 0U);
  EXPECT_LT(loss.bytes, after);
  ASSERT_TRUE(loss.messages);
  EXPECT_GT(*loss.messages, 0U);
  EXPECT_EQ(result.recovery.lost_messages, *loss.messages);
  EXPECT_EQ(result.recovery.kept.messages + *loss.messages, whole.size());
  EXPECT_TRUE(is_part_of(messages_in(result.file), whole));
}

TEST(RecoverDamage, WrongLengthIsPassedOverToTheNextChunk) {
  const std::string good = mcap::drive(mcap::small_chunks(Compression::kLz4));
  const std::size_t second = mcap::find_record(good, mcap::Opcode::kChunk, 1);
  const std::size_t third = mcap::find_record(good, mcap::Opcode::kChunk, 2);
  const std::string file = mcap::with(good, second + 1, std::uint64_t{1} << 40U);

  const Recovered result = recovered(file);

  ASSERT_THAT(result.recovery.losses, SizeIs(1));
  EXPECT_EQ(result.recovery.losses[0].problem.place.offset, second);
  EXPECT_EQ(result.recovery.losses[0].bytes, third - second);
  const Lines kept = messages_in(result.file);
  EXPECT_EQ(kept.back(), messages_in(good).back());
  EXPECT_TRUE(is_part_of(kept, messages_in(good)));
}

TEST(RecoverDamage, BeginningThatIsGoneCostsOnlyWhatStoodThere) {
  std::string file = mcap::drive(mcap::small_chunks());
  const std::size_t second = mcap::find_record(file, mcap::Opcode::kChunk, 1);
  const Lines whole = messages_in(file);
  std::fill_n(file.begin(), second - 10, '\0');

  const Recovered result = recovered(file);

  EXPECT_GT(result.recovery.kept.messages, 0U) << "channels are known from the summary";
  EXPECT_TRUE(is_part_of(messages_in(result.file), whole));
  EXPECT_EQ(result.recovery.losses.front().problem.place.offset, 0U);
}

TEST(RecoverDamage, ChannelsOfALostChunkAreFoundInTheSummary) {
  std::string file = mcap::drive(mcap::small_chunks());
  const Lines whole = messages_in(file);
  const std::size_t first = mcap::find_record(file, mcap::Opcode::kChunk);
  file[first + 60] = static_cast<char>(file[first + 60] ^ 1);  // It defines the channel.

  const Recovered result = recovered(file);

  ASSERT_THAT(result.recovery.losses, SizeIs(1));
  EXPECT_EQ(result.recovery.kept.messages + result.recovery.lost_messages, whole.size());
  EXPECT_GT(result.recovery.kept.messages, whole.size() / 2);
}

TEST(RecoverDamage, EndThatIsMissingCostsNothing) {
  const std::string open = mcap::drive(mcap::small_chunks(), false);
  const std::string closed = mcap::drive(mcap::small_chunks());
  const std::size_t end = mcap::find_record(closed, mcap::Opcode::kDataEnd);

  for (const std::string& file :
       {open, closed.substr(0, end), closed.substr(0, end + 5), closed.substr(0, end + 40),
        closed.substr(0, closed.size() - 1)}) {
    const Recovered result = recovered(file);

    EXPECT_EQ(result.recovery.loss_count, 0U);
    EXPECT_THAT(result.recovery.mended, SizeIs(1));
    EXPECT_EQ(result.recovery.kept.messages, 12U);
  }
}

TEST(RecoverDamage, RecordThatIsCutOffIsALoss) {
  const std::string good = mcap::drive(mcap::small_chunks(Compression::kZstd));
  const std::size_t last = mcap::find_record(good, mcap::Opcode::kChunk, 2);

  const Recovered result = recovered(good.substr(0, last + 70));

  ASSERT_THAT(result.recovery.losses, SizeIs(1));
  EXPECT_EQ(result.recovery.losses[0].bytes, 70U);
  EXPECT_FALSE(result.recovery.is_hopeless());
}

TEST(RecoverDamage, FileOfSomethingElseIsHopeless) {
  for (const std::string& file : {std::string(), std::string(5000, 'x'), mcap::magic()}) {
    EXPECT_TRUE(recovered(file).recovery.is_hopeless());
  }
  EXPECT_FALSE(recovered(mcap::file_of("")).recovery.is_hopeless()) << "empty, but in order";
}

TEST(Verify, FindsWhatIsNotAsItWasWritten) {
  const std::string file = mcap::drive(mcap::small_chunks());
  const Recovered result = recovered(file);
  ContentSum other = result.recovery.kept;
  ++other.messages_crc;
  const mcap::MemorySource written(mcap::bytes_of(result.file));
  const mcap::MemorySource cut(mcap::bytes_of(result.file).first(result.file.size() - 1));

  EXPECT_NO_THROW(verify(written, result.recovery.kept));
  EXPECT_THROW(verify(written, other), mcap::Error);
  EXPECT_THROW(verify(cut, result.recovery.kept), mcap::Error);
}

}  // namespace
}  // namespace fastcycle::archive
