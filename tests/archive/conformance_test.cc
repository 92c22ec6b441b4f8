// Every file of the public conformance suite goes through everything that is done with logs. A few
// are here, under tests/data/mcap; those of the folder $FASTCYCLE_DATA/mcap_conformance as well.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/doctor.h"
#include "archive/overview.h"
#include "archive/recover.h"
#include "archive/test_log.h"

namespace fastcycle::archive {
namespace {

namespace fs = std::filesystem;

/// Copies what can be copied, and compares; how many files there are.
std::size_t check_files(const fs::path& folder) {
  std::size_t count = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".mcap") {
      continue;
    }
    SCOPED_TRACE(entry.path().string());
    ++count;
    std::ifstream stream(entry.path(), std::ios::binary);
    const std::string file{std::istreambuf_iterator<char>(stream), {}};
    const mcap::MemorySource source(mcap::bytes_of(file), entry.path().string());

    EXPECT_FALSE(overview(source).problem);

    const auto complain = [](const Finding& finding) {
      EXPECT_TRUE(finding.is_warning) << to_string(finding.problem);
    };
    EXPECT_EQ(diagnose(source, complain).errors, 0U);

    const mcap::Lines content = content_of(file);
    EXPECT_EQ(content_of(rewritten({file}).at(0)), content);

    mcap::StringSink sink;
    const Recovery recovery = recover(source, sink);
    const mcap::MemorySource written(mcap::bytes_of(sink.file()));
    verify(written, recovery.kept);
    EXPECT_EQ(recovery.loss_count, 0U);
    EXPECT_EQ(content_of(sink.file()), content);
  }
  return count;
}

TEST(ArchiveConformance, ShippedFilesAreUnderstoodAndKept) {
  EXPECT_EQ(check_files(fs::path(FASTCYCLE_TEST_DATA) / "mcap"), 12U);
}

TEST(ArchiveConformance, AllFilesOfTheSuiteAreUnderstoodAndKept) {
  const char* const data = std::getenv("FASTCYCLE_DATA");
  if (data == nullptr || !fs::is_directory(fs::path(data) / "mcap_conformance")) {
    GTEST_SKIP() << "FASTCYCLE_DATA names no folder with mcap_conformance";
  }

  EXPECT_GT(check_files(fs::path(data) / "mcap_conformance"), 0U);
}

}  // namespace
}  // namespace fastcycle::archive
