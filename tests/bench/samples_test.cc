#include "measure/samples.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"

namespace fastcycle::measure {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const Samples kSamples = {{.number = 0, .made_ns = 10, .sent_ns = 20, .arrived_ns = 50},
                          {.number = 1, .made_ns = 110, .sent_ns = 120, .arrived_ns = 140},
                          {.number = 3, .made_ns = 310, .sent_ns = 330, .arrived_ns = 331}};

TEST(Samples, ComeBackFromAFileAsTheyWere) {
  const config::TestFolder folder;

  ASSERT_EQ(write_samples(folder / "samples", kSamples), "");
  Samples read = {{.number = 99}};
  ASSERT_EQ(read_samples(folder / "samples", read), "");

  ASSERT_EQ(read.size(), 3U);
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].number, kSamples[i].number);
    EXPECT_EQ(read[i].made_ns, kSamples[i].made_ns);
    EXPECT_EQ(read[i].sent_ns, kSamples[i].sent_ns);
    EXPECT_EQ(read[i].arrived_ns, kSamples[i].arrived_ns);
  }
  EXPECT_EQ(std::filesystem::file_size(folder / "samples"), 3 * 32U);
}

TEST(Samples, SayWhichFileIsMissing) {
  Samples samples;

  EXPECT_THAT(read_samples("/nonexistent/samples", samples), HasSubstr("/nonexistent/samples"));
  EXPECT_THAT(write_samples("/nonexistent/samples", samples), HasSubstr("/nonexistent/samples"));
}

TEST(Samples, DurationsAreFromPublishAndFromBeforeThePayload) {
  EXPECT_THAT(transfer_ns(kSamples), ElementsAre(30, 20, 1));
  EXPECT_THAT(end_to_end_ns(kSamples), ElementsAre(40, 30, 21));
}

TEST(Samples, IntervalsAreOfMessagesThatFollowEachOther) {
  EXPECT_THAT(interval_error_ns(kSamples), ElementsAre(-10));
}

TEST(Samples, WarmUpIsLeftOutByNumber) {
  const Samples measured = without_warmup(kSamples, 1);

  ASSERT_EQ(measured.size(), 2U);
  EXPECT_EQ(measured.front().number, 1);
}

}  // namespace
}  // namespace fastcycle::measure
