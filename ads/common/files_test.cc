#include "common/files.h"

#include <filesystem>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(Files, WhatWasWrittenIsRead) {
  const std::filesystem::path file = std::filesystem::path(testing::TempDir()) / "files_test.txt";
  for (const std::string content : {"longer than the next", "a\0b", ""}) {
    write_file(file, content);

    EXPECT_EQ(read_file(file), content);
  }
  std::filesystem::remove(file);
}

TEST(Files, ReasonIsGivenWhereNothingCanBeWritten) {
  EXPECT_THAT([] { write_file("/nowhere/drive.svg", "x"); },
              ThrowsMessage<std::runtime_error>(
                  "/nowhere/drive.svg: cannot be written: No such file or directory"));
  EXPECT_THAT([] { write_file("/dev/full", std::string(100'000, 'x')); },
              ThrowsMessage<std::runtime_error>(HasSubstr("No space left on device")));
}

}  // namespace
}  // namespace ads
