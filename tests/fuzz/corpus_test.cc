// What a fuzzer begins with, and what it found once, as an ordinary test.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

std::size_t take_all_of(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    SCOPED_TRACE(entry.path().string());
    std::ifstream stream(entry.path(), std::ios::binary);
    const std::string file{std::istreambuf_iterator<char>(stream), {}};
    EXPECT_EQ(
        LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(file.data()), file.size()), 0);
    ++count;
  }
  return count;
}

TEST(Corpus, IsSurvived) {
  EXPECT_GT(take_all_of(FASTCYCLE_CORPUS), 5U);
}

TEST(Corpus, WhatFuzzingFoundIsSurvived) {
  if (!std::filesystem::exists(FASTCYCLE_FOUND)) {
    GTEST_SKIP() << "nothing is kept of it";
  }
  EXPECT_GT(take_all_of(FASTCYCLE_FOUND), 100U);
}

TEST(Corpus, FilesOfOtherTestsAreSurvived) {
  EXPECT_GT(take_all_of(std::filesystem::path(FASTCYCLE_TEST_DATA) / "mcap"), 5U);
}

}  // namespace
