#include "base/output_file.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Output : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "fastcycle_output_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    path_ = folder_ / "out.json";
  }
  void TearDown() override { fs::remove_all(folder_); }

  static void write(const OutputFile& file, const std::string& text) {
    ASSERT_EQ(::write(file.descriptor(), text.data(), text.size()),
              static_cast<ssize_t>(text.size()));
  }
  static std::string read(const fs::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(fs::directory_iterator(folder_), fs::directory_iterator());
  }

  fs::path folder_;
  fs::path path_;
};

TEST_F(Output, HasItsNameOnceItIsCommitted) {
  std::ofstream(path_) << "old";
  OutputFile file(path_);
  write(file, "new");
  EXPECT_EQ(read(path_), "old");

  file.commit();
  write(file, ", and more");
  file.close();

  EXPECT_EQ(read(path_), "new, and more");
  EXPECT_EQ(files(), 1);
  EXPECT_EQ(fs::status(path_).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(Output, IsNotLeftIfItIsNotCommitted) {
  {
    const OutputFile file(path_);
  }

  EXPECT_EQ(OutputFile::find_obstacle(path_), "");
  EXPECT_EQ(files(), 0);
}

TEST_F(Output, FollowsNoLink) {
  std::ofstream(folder_ / "precious") << "precious";
  fs::create_symlink(folder_ / "precious", path_);

  EXPECT_THROW(OutputFile{path_}, std::runtime_error);

  EXPECT_THAT(OutputFile::find_obstacle(path_), HasSubstr("it is a symbolic link"));
  EXPECT_EQ(read(folder_ / "precious"), "precious");
}

TEST_F(Output, LeavesAloneAnotherFileOfTheSameContent) {
  std::ofstream(folder_ / "precious") << "precious";
  fs::create_hard_link(folder_ / "precious", path_);

  OutputFile file(path_);
  write(file, "new");
  file.commit();

  EXPECT_EQ(read(path_), "new");
  EXPECT_EQ(read(folder_ / "precious"), "precious");
}

TEST_F(Output, WaitsForNoReaderOfAFifo) {
  ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);

  EXPECT_THAT(OutputFile::find_obstacle(path_), HasSubstr("it is no regular file"));
  EXPECT_TRUE(fs::is_fifo(path_));
}

TEST_F(Output, IsNoFolderAndNotInOneThatIsMissing) {
  EXPECT_EQ(OutputFile::find_obstacle(folder_), "it is a folder");
  EXPECT_EQ(OutputFile::find_obstacle(folder_ / "none/a"), "No such file or directory");
}

TEST_F(Output, IsNoneOfTheInputsWhateverTheyAreCalled) {
  std::ofstream(path_) << "application";
  fs::create_hard_link(path_, folder_ / "app.json");
  fs::create_symlink(path_, folder_ / "link.json");

  for (const char* const name : {"app.json", "link.json"}) {
    const std::vector<fs::path> inputs{folder_ / "missing", folder_ / name};
    EXPECT_THAT(OutputFile::find_obstacle(path_, inputs), HasSubstr("it is read by this command"));
    EXPECT_THROW(OutputFile(path_, inputs), std::runtime_error);
  }
  EXPECT_EQ(read(path_), "application");
}

TEST_F(Output, DoesNotReplaceALinkThatCameMeanwhile) {
  std::ofstream(folder_ / "precious") << "precious";
  OutputFile file(path_);
  fs::create_symlink(folder_ / "precious", path_);

  EXPECT_THROW(file.commit(), std::runtime_error);

  EXPECT_TRUE(fs::is_symlink(path_));
}

TEST_F(Output, MayBeAStream) {
  int ends[2] = {};
  ASSERT_EQ(::pipe(ends), 0);
  {
    OutputFile file("/dev/fd/" + std::to_string(ends[1]));
    write(file, "text");
    file.commit();
    file.close();
  }
  char text[8] = {};
  EXPECT_EQ(::read(ends[0], text, sizeof(text)), 4);
  EXPECT_STREQ(text, "text");
  ::close(ends[0]);
  ::close(ends[1]);
  EXPECT_EQ(OutputFile::find_obstacle("/dev/null"), "");
}

}  // namespace
}  // namespace fastcycle::base
