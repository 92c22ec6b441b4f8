#include "record/syncer.h"

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::record {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// Files in a folder that is gone afterwards.
class SyncedFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "fastcycle_sync_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// A file with something in it, that is still being written.
  [[nodiscard]] Syncer::File open_file(const std::string& name) const {
    Syncer::File file;
    file.active = folder_ / (name + ".active");
    file.sink = std::make_shared<mcap::FileSink>(file.active);
    const mcap::Bytes bytes = mcap::bytes_of("content");
    file.sink->append({&bytes, 1});
    return file;
  }
  /// One that was ended.
  [[nodiscard]] Syncer::File whole_file(const std::string& name) const {
    Syncer::File file = open_file(name);
    file.whole = folder_ / name;
    return file;
  }

  std::filesystem::path folder_;
};

TEST_F(SyncedFiles, AreRenamedOnceTheyAreWhole) {
  Syncer syncer;
  for (const char* const name : {"a", "b", "c", "d", "e", "f"}) {
    syncer.sync(open_file(std::string("open_") + name));
    syncer.sync(whole_file(name));
  }

  const auto outcomes = syncer.wait();

  ASSERT_THAT(outcomes, SizeIs(6));
  EXPECT_EQ(outcomes[0].active, folder_ / "a.active");
  EXPECT_EQ(outcomes[5].whole, folder_ / "f");
  for (const Syncer::Outcome& outcome : outcomes) {
    EXPECT_THAT(outcome.problem, IsEmpty());
    EXPECT_EQ(std::filesystem::file_size(outcome.whole), 7U);
    EXPECT_FALSE(std::filesystem::exists(outcome.active));
  }
  EXPECT_TRUE(std::filesystem::exists(folder_ / "open_a.active"));
  EXPECT_THAT(syncer.outcomes(), IsEmpty());
}

TEST_F(SyncedFiles, ThatCannotBeRenamedStayAsTheyAreAndTheProblemIsSaid) {
  Syncer syncer;
  Syncer::File file = whole_file("a");
  file.whole = folder_ / "gone" / "a";
  syncer.sync(file);

  const auto outcomes = syncer.wait();

  ASSERT_THAT(outcomes, SizeIs(1));
  EXPECT_EQ(outcomes[0].active, file.active);
  EXPECT_THAT(outcomes[0].problem, HasSubstr("gone/a"));
  EXPECT_TRUE(std::filesystem::exists(file.active));
}

TEST_F(SyncedFiles, AreNotRenamedOverAnother) {
  Syncer syncer;
  std::ofstream(folder_ / "a.mcap") << "precious";
  std::ofstream(folder_ / "a_0002.mcap") << "precious";
  syncer.sync(whole_file("a.mcap"));

  const auto outcomes = syncer.wait();

  ASSERT_THAT(outcomes, SizeIs(1));
  EXPECT_THAT(outcomes[0].problem, IsEmpty());
  EXPECT_EQ(outcomes[0].asked, folder_ / "a.mcap");
  EXPECT_EQ(outcomes[0].whole, folder_ / "a_0003.mcap");
  EXPECT_EQ(std::filesystem::file_size(folder_ / "a.mcap"), 8U);
  EXPECT_EQ(std::filesystem::file_size(folder_ / "a_0003.mcap"), 7U);
}

TEST_F(SyncedFiles, ThatAreGoneAreReported) {
  Syncer syncer;
  const Syncer::File file = open_file("a");
  std::filesystem::remove(file.active);
  syncer.sync(file);

  const auto outcomes = syncer.wait();

  ASSERT_THAT(outcomes, SizeIs(1));
  EXPECT_EQ(outcomes[0].state, base::FileState::Kind::kLost);
  EXPECT_THAT(outcomes[0].problem, HasSubstr("a.active: it was deleted"));
}

TEST_F(SyncedFiles, ThatWereMovedGiveNoNameToWhatTookTheirs) {
  Syncer syncer;
  const Syncer::File file = whole_file("a");
  std::filesystem::rename(file.active, folder_ / "moved");
  std::ofstream(file.active) << "precious";
  syncer.sync(file);

  const auto outcomes = syncer.wait();

  ASSERT_THAT(outcomes, SizeIs(1));
  EXPECT_EQ(outcomes[0].state, base::FileState::Kind::kElsewhere);
  EXPECT_THAT(outcomes[0].problem, HasSubstr("moved"));
  EXPECT_EQ(std::filesystem::file_size(file.active), 8U);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a"));
}

TEST_F(SyncedFiles, AreWaitedForAtTheEnd) {
  {
    Syncer syncer;
    syncer.sync(whole_file("a"));
  }
  EXPECT_TRUE(std::filesystem::exists(folder_ / "a"));
}

}  // namespace
}  // namespace fastcycle::record
