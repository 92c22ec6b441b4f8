#include "archive/overview.h"

#include <cstdlib>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/test_log.h"

namespace fastcycle::archive {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::SizeIs;

Overview overview_of(const std::string& file, const OverviewOptions& options = {}) {
  const mcap::MemorySource source(mcap::bytes_of(file), "test.mcap");
  return overview(source, options);
}

TEST(Overview, TellsWhatIsThere) {
  const std::string file = good_log(mcap::small_chunks(mcap::Compression::kLz4));

  const Overview result = overview_of(file);

  EXPECT_EQ(result.bytes, file.size());
  EXPECT_EQ(result.header.library, "fastcycle");
  EXPECT_EQ(result.statistics.message_count, 12U);
  ASSERT_THAT(result.topics, SizeIs(2));
  const TopicOverview& scene = result.topics.at("scene");
  EXPECT_THAT(scene.types, ElementsAre("demo.Scene"));
  EXPECT_THAT(scene.encodings, ElementsAre("protobuf"));
  EXPECT_EQ(scene.messages, 8U);
  EXPECT_EQ(result.topics.at("camera/front").bytes, 4U * 40);
  EXPECT_EQ(result.chunks.at("lz4").count, result.statistics.chunk_count);
  EXPECT_THAT(result.attachments, SizeIs(1));
  EXPECT_THAT(result.metadata, SizeIs(1));
  EXPECT_TRUE(result.was_read);
  EXPECT_FALSE(result.was_scanned);
  EXPECT_FALSE(result.problem);
}

TEST(Overview, LargeFilesAreLookedAtByTheirSummary) {
  const std::string file = good_log(mcap::small_chunks(mcap::Compression::kLz4));

  const Overview result = overview_of(file, {.read_whole_bytes = 100});
  const Overview whole = overview_of(file);

  EXPECT_FALSE(result.was_read);
  EXPECT_FALSE(result.topics.at("scene").bytes);
  EXPECT_EQ(result.topics.at("scene").messages, 8U);
  EXPECT_EQ(result.chunks.at("lz4").count, whole.chunks.at("lz4").count);
  EXPECT_EQ(result.chunks.at("lz4").compressed_bytes, whole.chunks.at("lz4").compressed_bytes);
  EXPECT_EQ(result.chunks.at("lz4").uncompressed_bytes, whole.chunks.at("lz4").uncompressed_bytes);
}

TEST(Overview, FileThatWasNotClosedIsScanned) {
  const Overview result = overview_of(mcap::drive(mcap::small_chunks(), false));

  EXPECT_TRUE(result.was_scanned);
  EXPECT_TRUE(result.problem);
  EXPECT_EQ(result.statistics.message_count, 12U);
}

TEST(Overview, LossIsThatOfTheLog) {
  mcap::StringSink sink;
  mcap::Writer writer(sink);
  writer.add(mcap::kCamera);
  writer.write(mcap::Metadata{.name = "fastcycle.loss",
                              .metadata = {{"topic", "camera/front"},
                                           {"published", "10"},
                                           {"recorded", "8"},
                                           {"lost", "2"},
                                           {"lost.disk", "2"},
                                           {"lost.pool", "0"}}});
  writer.close();

  const Overview result = overview_of(sink.file());

  ASSERT_TRUE(result.topics.at("camera/front").loss);
  const TopicLoss& loss = *result.topics.at("camera/front").loss;
  EXPECT_EQ(loss.published, 10U);
  EXPECT_EQ(loss.recorded, 8U);
  EXPECT_EQ(loss.lost, 2U);
  EXPECT_THAT(loss.reasons, ElementsAre(std::pair<const std::string, std::uint64_t>("disk", 2)));
}

TEST(FilesOfRecording, AreFoundByTheNameThatWasSplit) {
  std::string name = (fs::temp_directory_path() / "fastcycle_files_XXXXXX").string();
  ASSERT_NE(mkdtemp(name.data()), nullptr);
  const fs::path folder = name;
  for (const char* file :
       {"drive_0002.mcap", "drive_0001.mcap", "drive_0010.mcap.active", "drive_1.mcap",
        "driver_0003.mcap", "drive_000x.mcap", "drive_0004.txt"}) {
    std::ofstream(folder / file) << "x";
  }

  const std::vector<fs::path> found = files_of_recording(folder / "drive.mcap");
  std::ofstream(folder / "drive.mcap") << "x";
  const std::vector<fs::path> itself = files_of_recording(folder / "drive.mcap");
  const std::vector<fs::path> none = files_of_recording(folder / "walk.mcap");
  fs::remove_all(folder);

  EXPECT_THAT(found, ElementsAre(folder / "drive_0001.mcap", folder / "drive_0002.mcap",
                                 folder / "drive_0010.mcap.active"));
  EXPECT_THAT(itself, ElementsAre(folder / "drive.mcap"));
  EXPECT_THAT(none, ElementsAre(folder / "walk.mcap"));
}

}  // namespace
}  // namespace fastcycle::archive
