#include "archive/output_file.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mcap/error.h"
#include "mcap/records.h"

namespace fastcycle::archive {
namespace {

namespace fs = std::filesystem;

class Output : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "fastcycle_output_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    path_ = folder_ / "out.mcap";
  }
  void TearDown() override { fs::remove_all(folder_); }

  static void write(OutputFile& file, std::string_view text) {
    const mcap::Bytes bytes = mcap::bytes_of(text);
    file.sink().append({&bytes, 1});
  }
  [[nodiscard]] std::string content() const {
    std::ifstream stream(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(fs::directory_iterator(folder_), fs::directory_iterator());
  }

  fs::path folder_;
  fs::path path_;
};

TEST_F(Output, AppearsWhenItIsWhole) {
  OutputFile file(path_, {});
  write(file, "half");
  EXPECT_FALSE(fs::exists(path_));
  write(file, " and half");

  file.commit();

  EXPECT_EQ(content(), "half and half");
  EXPECT_EQ(files(), 1);
}

TEST_F(Output, NamesTheFolderThatIsNotThere) {
  try {
    const OutputFile file(folder_ / "none" / "out.mcap", {});
    ADD_FAILURE() << "it was opened";
  } catch (const mcap::Error& error) {
    EXPECT_THAT(error.what(), ::testing::EndsWith("none/out.mcap: expected a name in a folder that "
                                                  "is there, found no folder " +
                                                  (folder_ / "none").string()));
  }
}

TEST_F(Output, LeavesNothingIfItIsNotCommitted) {
  {
    OutputFile file(path_, {});
    write(file, "half");
  }

  EXPECT_EQ(files(), 0);
}

TEST_F(Output, DoesNotReplaceUnlessItMay) {
  std::ofstream(path_) << "old";
  EXPECT_THROW(OutputFile(path_, {}), mcap::Error);
  EXPECT_EQ(content(), "old");

  OutputFile file(path_, {.may_replace = true});
  write(file, "new");
  EXPECT_EQ(content(), "old");
  file.commit();

  EXPECT_EQ(content(), "new");
}

TEST_F(Output, DoesNotReplaceWhatAppearedMeanwhile) {
  OutputFile file(path_, {});
  std::ofstream(path_) << "other";

  EXPECT_THROW(file.commit(), mcap::Error);

  EXPECT_EQ(content(), "other");
}

TEST_F(Output, IsNoneOfTheInputs) {
  std::ofstream(path_) << "input";
  fs::create_hard_link(path_, folder_ / "link.mcap");
  const std::vector<fs::path> inputs{folder_ / "link.mcap"};

  EXPECT_THROW(OutputFile(path_, {.may_replace = true, .inputs = inputs}), mcap::Error);
  EXPECT_THROW(OutputFile(folder_, {.may_replace = true}), mcap::Error);
}

}  // namespace
}  // namespace fastcycle::archive
