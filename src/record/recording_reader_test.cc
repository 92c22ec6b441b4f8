#include "record/recording_reader.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "log/log.pb.h"
#include "mcap/writer.h"
#include "record/log_format.h"

namespace fastcycle::record {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::uint16_t kInfos = 1;
constexpr std::uint16_t kFast = 2;
constexpr std::uint16_t kSlow = 3;

/// A file as a recorder writes it.
class Written {
 public:
  explicit Written(const std::filesystem::path& path)
      : sink_(path), writer_(sink_, {.library = "fastcycle"}) {
    writer_.add(mcap::Channel{.id = kInfos,
                              .schema_id = 0,
                              .topic = kInfosTopic,
                              .message_encoding = "protobuf",
                              .metadata = {}});
    add(kFast, "fast");
    add(kSlow, "slow");
  }

  void metadata(const std::string& name, const std::string& key, const std::string& value) {
    writer_.write(mcap::Metadata{.name = name, .metadata = {{key, value}}});
  }
  void message(std::uint16_t channel, std::uint32_t sequence, std::uint64_t time_ns,
               const std::string& data = "x") {
    write({.channel_id = channel,
           .sequence = sequence,
           .log_time_ns = time_ns,
           .publish_time_ns = time_ns},
          data);
  }
  void repeat(std::uint16_t channel, std::uint32_t sequence, std::uint64_t time_ns,
              std::uint64_t published_ns) {
    write({.channel_id = channel,
           .sequence = sequence,
           .log_time_ns = time_ns,
           .publish_time_ns = published_ns},
          "repeated");
  }
  log::MessageInfo& info(std::uint16_t channel, std::uint64_t sequence) {
    log::MessageInfo& info = *infos_.add_infos();
    info.set_channel(channel);
    info.set_sequence(sequence);
    return info;
  }
  void end_chunk(std::uint64_t time_ns) {
    write({.channel_id = kInfos, .log_time_ns = time_ns, .publish_time_ns = time_ns},
          infos_.SerializeAsString());
    infos_.Clear();
    writer_.flush();
  }
  void close() { writer_.close(); }

 private:
  void add(std::uint16_t id, const std::string& topic) {
    writer_.add(mcap::Channel{.id = id,
                              .schema_id = 0,
                              .topic = topic,
                              .message_encoding = "protobuf",
                              .metadata = {{"publisher", "driver"}}});
  }
  void write(const mcap::MessageHead& head, const std::string& data) {
    writer_.write(mcap::Message{head, mcap::bytes_of(data)});
  }

  mcap::FileSink sink_;
  mcap::Writer writer_;
  log::MessageInfos infos_;
};

class Readers : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "fastcycle_read_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// "sequence@time/step", all of them in order.
  static std::vector<std::string> read(RecordingReader& reader,
                                       RecordingReader::Selection selection) {
    reader.rewind(std::move(selection));
    std::vector<std::string> lines;
    for (auto moment = reader.next(); !moment.empty(); moment = reader.next()) {
      for (const RecordedMessage& message : moment) {
        lines.push_back(std::to_string(message.info.sequence) + "@" +
                        std::to_string(base::to_ns(message.due)) + "/" +
                        std::to_string(message.step));
      }
    }
    return lines;
  }
  static std::vector<std::string> read_all(RecordingReader& reader) {
    return read(reader, {.wanted = std::vector<bool>(reader.streams().size(), true),
                         .from = reader.begin(),
                         .to = reader.end()});
  }

  std::filesystem::path folder_;
};

TEST_F(Readers, GiveMessagesInTheOrderOfTimeRoundPublisherAndSequence) {
  Written file(folder_ / "a.mcap");
  // A large message goes to the file before the small ones that were published before it.
  file.message(kFast, 2, 100);
  file.end_chunk(100);
  file.message(kFast, 1, 100);
  file.message(kSlow, 1, 100);
  file.message(kFast, 3, 200);
  file.info(kSlow, 1).set_step(0);
  file.info(kFast, 3).set_step(4);
  file.end_chunk(300);
  file.close();
  RecordingReader reader({folder_ / "a.mcap"});

  EXPECT_THAT(read_all(reader), ElementsAre("1@100/0", "1@100/1", "2@100/1", "3@200/4"));
  EXPECT_THAT(read_all(reader), ElementsAre("1@100/0", "1@100/1", "2@100/1", "3@200/4"));
  EXPECT_EQ(reader.parted_infos(), 0U);
}

TEST_F(Readers, ReportWhatTheBrokerKnew) {
  Written file(folder_ / "a.mcap");
  const std::uint64_t large = (std::uint64_t{3} << 32U) + 5;
  file.message(kFast, 5, 1'000, "bytes");
  auto& info = file.info(kFast, large);
  info.set_age_ns(400);
  info.set_root(77);
  info.set_held(true);
  file.message(kFast, 6, 2'000);
  file.end_chunk(2'000);
  file.close();
  RecordingReader reader({folder_ / "a.mcap"});
  reader.rewind({.wanted = {true, true}, .from = reader.begin(), .to = reader.end()});

  const auto first = reader.next();
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].info.sequence, large);
  EXPECT_EQ(first[0].info.origin.taken, base::from_ns(600));
  EXPECT_EQ(first[0].info.origin.root, 77U);
  EXPECT_TRUE(first[0].info.origin.held);
  EXPECT_EQ(mcap::text_of(mcap::Bytes(first[0].data)), "bytes");
  // Without a word about it, the upper bits go on.
  const auto second = reader.next();
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(second[0].info.sequence, large + 1);
  EXPECT_EQ(second[0].info.origin.taken, second[0].info.publish_time);
  EXPECT_EQ(second[0].info.origin.root, 0U);
}

TEST_F(Readers, JoinTheFilesOfARecordingAndDropWhatIsRepeated) {
  Written first(folder_ / "a_0001.mcap");
  first.metadata(kRunMetadata, "start_ns", "50");
  first.message(kSlow, 1, 100);
  first.end_chunk(100);
  first.message(kFast, 1, 320);
  first.end_chunk(320);
  first.close();
  Written second(folder_ / "a_0002.mcap");
  second.metadata(kRunMetadata, "start_ns", "50");
  second.repeat(kSlow, 1, 300, 100);
  second.message(kFast, 2, 310);
  second.end_chunk(330);
  second.metadata(kEndMetadata, "time_ns", "900");
  second.metadata(kEndMetadata, "timers_ns", "60");
  second.close();

  RecordingReader both({folder_ / "a_0001.mcap", folder_ / "a_0002.mcap"});
  EXPECT_EQ(both.begin(), base::from_ns(50));
  EXPECT_EQ(both.begin_of_timers(), base::from_ns(60));
  EXPECT_EQ(both.end(), base::from_ns(900));
  EXPECT_THAT(read_all(both), ElementsAre("1@100/1", "2@310/1", "1@320/1"));
  EXPECT_EQ(both.streams().size(), 2U);
  EXPECT_EQ(both.streams()[0].messages, 2U);

  RecordingReader last({folder_ / "a_0002.mcap"});
  EXPECT_THAT(read_all(last), ElementsAre("1@300/1", "2@310/1"));
}

// A live replay that is recorded: its first messages have times before it began to record.
TEST_F(Readers, BeginWithTheFirstMessageAtTheLatest) {
  Written file(folder_ / "a.mcap");
  file.metadata(kRunMetadata, "start_ns", "500");
  file.message(kFast, 1, 400);
  file.message(kFast, 2, 600);
  file.close();
  RecordingReader reader({folder_ / "a.mcap"});

  EXPECT_EQ(reader.begin(), base::from_ns(400));
  EXPECT_EQ(reader.begin_of_timers(), base::from_ns(400));
  EXPECT_THAT(read_all(reader), ElementsAre("1@400/1", "2@600/1"));
}

TEST_F(Readers, GiveWhatIsSelectedOnly) {
  Written file(folder_ / "a.mcap");
  for (std::uint32_t i = 1; i <= 4; ++i) {
    file.message(kFast, i, i * 100);
    file.message(kSlow, i, i * 100);
    file.info(kFast, i).set_step(i + 1);
  }
  file.end_chunk(400);
  file.close();
  RecordingReader reader({folder_ / "a.mcap"});

  EXPECT_THAT(
      read(reader, {.wanted = {true, false}, .from = base::from_ns(200), .to = base::from_ns(300)}),
      ElementsAre("2@200/3", "3@300/4"));
  EXPECT_THAT(read(reader, {.wanted = {false, false}, .from = {}, .to = reader.end()}),
              ElementsAre());
}

// A tool that cuts a file into other chunks may do that.
TEST_F(Readers, CountWhatIsSaidTooLate) {
  Written file(folder_ / "a.mcap");
  file.message(kFast, 1, 100);
  file.end_chunk(100);
  file.info(kFast, 1).set_step(3);
  file.message(kFast, 2, 200);
  file.end_chunk(200);
  file.close();
  RecordingReader reader({folder_ / "a.mcap"});

  EXPECT_THAT(read_all(reader), ElementsAre("1@100/1", "2@200/1"));
  EXPECT_EQ(reader.parted_infos(), 1U);
}

TEST_F(Readers, ReadAFileWithoutAnEndUpToItsLastChunk) {
  {
    Written file(folder_ / "a.mcap.active");
    file.message(kFast, 1, 100);
    file.end_chunk(100);
    file.message(kFast, 2, 200);
  }
  RecordingReader reader({folder_ / "a.mcap.active"});

  EXPECT_THAT(read_all(reader), ElementsAre("1@100/1"));
  EXPECT_THAT(reader.notes(), ElementsAre(HasSubstr("a.mcap.active")));
}

TEST_F(Readers, SurviveTimesThatAreNone) {
  Written file(folder_ / "a.mcap");
  file.message(kFast, 1, 0);
  file.message(kFast, 2, std::numeric_limits<std::uint64_t>::max());
  file.close();
  RecordingReader reader({folder_ / "a.mcap"});

  EXPECT_EQ(
      read(reader, {.wanted = {true, true}, .from = reader.begin(), .to = reader.end()}).front(),
      "1@0/1");
}

TEST_F(Readers, SayWhatIsDamaged) {
  std::ofstream(folder_ / "a.mcap") << "no recording at all, whoever looks at it";
  EXPECT_THROW(RecordingReader({folder_ / "a.mcap"}), mcap::Error);
  EXPECT_THROW(RecordingReader({folder_ / "none.mcap"}), mcap::Error);
}

}  // namespace
}  // namespace fastcycle::record
