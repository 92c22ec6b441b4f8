#include "base/files.h"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A file of seven bytes that is open, in a folder that is gone afterwards.
class OpenFile : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "fastcycle_files_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    name_ = folder_ / "logs" / "a";
    fs::create_directory(folder_ / "logs");
    write(name_, "content");
    descriptor_ = ::open(name_.c_str(), O_RDWR | O_CLOEXEC);
    ASSERT_GE(descriptor_, 0);
  }
  void TearDown() override {
    ::close(descriptor_);
    fs::remove_all(folder_);
  }

  static void write(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }
  static std::string read(const fs::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }
  [[nodiscard]] FileState look() const { return look_at(descriptor_, name_, 7); }

  fs::path folder_;
  fs::path name_;
  int descriptor_ = -1;
};

TEST_F(OpenFile, IsThereUnderItsName) {
  const FileState state = look();

  EXPECT_EQ(state.kind, FileState::Kind::kThere);
  EXPECT_EQ(state.words, "");
}

TEST_F(OpenFile, IsLostOnceItIsDeleted) {
  fs::remove(name_);

  EXPECT_EQ(look().kind, FileState::Kind::kLost);
  EXPECT_EQ(look().words, "it was deleted");

  write(name_, "another");
  EXPECT_EQ(look().kind, FileState::Kind::kLost);
}

TEST_F(OpenFile, IsLostWithItsFolder) {
  fs::remove_all(folder_ / "logs");

  EXPECT_EQ(look().kind, FileState::Kind::kLost);
}

TEST_F(OpenFile, IsLostOnceItIsCutOff) {
  ASSERT_EQ(::truncate(name_.c_str(), 6), 0);

  EXPECT_EQ(look().kind, FileState::Kind::kLost);
  EXPECT_THAT(look().words, HasSubstr("it has 6 of 7 bytes"));
}

TEST_F(OpenFile, IsElsewhereOnceItIsMoved) {
  fs::rename(folder_ / "logs", folder_ / "other");

  EXPECT_EQ(look().kind, FileState::Kind::kElsewhere);
  EXPECT_THAT(look().words, HasSubstr("moved to " + (folder_ / "other/a").string()));
}

TEST_F(OpenFile, IsElsewhereWhereAnotherFileHasItsName) {
  fs::rename(name_, folder_ / "b");
  write(name_, "another");

  EXPECT_EQ(look().kind, FileState::Kind::kElsewhere);
  EXPECT_THAT(look().words, HasSubstr("another file has its name"));
}

TEST_F(OpenFile, GetsANameThatIsFree) {
  EXPECT_EQ(rename_to_free(name_, folder_ / "b"), 0);
  EXPECT_EQ(link_to_free(folder_ / "b", folder_ / "c"), 0);

  EXPECT_EQ(read(folder_ / "c"), "content");
  EXPECT_FALSE(fs::exists(name_));
  EXPECT_FALSE(fs::exists(folder_ / "b"));
}

TEST_F(OpenFile, DoesNotGetTheNameOfAnother) {
  write(folder_ / "b", "precious");
  fs::create_symlink(folder_ / "nowhere", folder_ / "link");

  for (const auto& rename : {rename_to_free, link_to_free}) {
    EXPECT_EQ(rename(name_, folder_ / "b"), EEXIST);
    EXPECT_EQ(rename(name_, folder_ / "link"), EEXIST);
    EXPECT_EQ(rename(folder_ / "none", folder_ / "c"), ENOENT);
  }

  EXPECT_EQ(read(folder_ / "b"), "precious");
  EXPECT_EQ(look().kind, FileState::Kind::kThere);
}

TEST_F(OpenFile, GetsTheNextNumberWhereItsNameIsTaken) {
  std::ofstream(folder_ / "b.mcap") << "another";
  std::ofstream(folder_ / "b_0002.mcap") << "and one more";
  EXPECT_EQ(rename_to_next_free(name_, folder_ / "b.mcap"), folder_ / "b_0003.mcap");
  EXPECT_TRUE(fs::exists(folder_ / "b_0003.mcap"));
  EXPECT_FALSE(fs::exists(name_));
}

TEST_F(OpenFile, ThatIsGoneGetsNoName) {
  fs::remove(name_);
  EXPECT_THROW(static_cast<void>(rename_to_next_free(name_, folder_ / "b.mcap")),
               fs::filesystem_error);
}

TEST(ANumberedName, HasItsNumberBeforeTheSuffix) {
  EXPECT_EQ(numbered("logs/drive.mcap", 2), "logs/drive_0002.mcap");
  EXPECT_EQ(numbered("drive", 12345), "drive_12345");
}

}  // namespace
}  // namespace fastcycle::base
