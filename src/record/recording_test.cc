#include "record/recording.h"

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::record {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Recordings of the same name in one folder.
class RecordingsOfOneName : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "fastcycle_recording_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] std::unique_ptr<Recording> recording(
      const Recording::Preamble& preamble = {}) const {
    return std::make_unique<Recording>(
        Recording::Options{.file = folder_ / "drive.mcap"},
        preamble ? preamble : [](mcap::Writer&) {}, [](mcap::Writer&) {});
  }
  [[nodiscard]] std::set<std::string> names() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      names.insert(entry.path().filename().string());
    }
    return names;
  }

  fs::path folder_;
};

// To `exists` a link to nowhere is no file, and to `open` it is one: as if another recording made
// its file between the two.
TEST_F(RecordingsOfOneName, GoOnToTheNextNumberWhereMakingTheFileFailsSinceItIsThere) {
  fs::create_symlink(folder_ / "nowhere", folder_ / "drive.mcap.active");
  const auto one = recording();

  EXPECT_TRUE(one->open()) << one->problem();
  EXPECT_TRUE(one->close()) << one->problem();

  EXPECT_THAT(one->problem(), IsEmpty());
  EXPECT_EQ(one->files(), std::vector{folder_ / "drive_0002.mcap"});
}

TEST_F(RecordingsOfOneName, LeaveAloneWhatGotTheNameMeanwhileAndSayWhereTheyAre) {
  const auto one = recording();
  ASSERT_TRUE(one->open());
  std::ofstream(folder_ / "drive.mcap") << "precious";

  EXPECT_TRUE(one->close()) << one->problem();

  EXPECT_EQ(fs::file_size(folder_ / "drive.mcap"), 8U);
  EXPECT_EQ(one->files(), std::vector{folder_ / "drive_0002.mcap"});
  const auto news = one->take_news();
  ASSERT_EQ(news.size(), 1U);
  EXPECT_THAT(news[0].text, HasSubstr("drive.mcap is another file by now"));
  EXPECT_THAT(news[0].text, HasSubstr("drive_0002.mcap"));
  EXPECT_FALSE(news[0].is_trouble);
}

TEST_F(RecordingsOfOneName, MayAllBeginAndEndAtTheSameTime) {
  constexpr int kThreads = 8;
  for (int round = 0; round < 20; ++round) {
    std::vector<std::unique_ptr<Recording>> all;
    for (int i = 0; i < kThreads; ++i) {
      all.push_back(recording());
    }
    std::atomic<int> ready{0};
    std::atomic<int> failed{0};
    std::vector<std::thread> threads;
    for (const auto& one : all) {
      threads.emplace_back([&, recording = one.get()] {
        ++ready;
        while (ready < kThreads) {
          std::this_thread::yield();
        }
        failed += recording->open() ? 0 : 1;
        failed += recording->close() ? 0 : 1;
      });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
    EXPECT_EQ(failed, 0);
    std::set<std::string> said;
    for (const auto& one : all) {
      ASSERT_EQ(one->files().size(), 1U) << one->problem();
      said.insert(one->files()[0].filename().string());
    }
    EXPECT_EQ(said, names());
    EXPECT_EQ(said.size(), static_cast<std::size_t>(kThreads));
    for (const std::string& name : said) {
      fs::remove(folder_ / name);
    }
  }
}

}  // namespace
}  // namespace fastcycle::record
