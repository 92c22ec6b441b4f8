#include "broker/read_ring.h"

#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::detail {
namespace {

TEST(AReadRing, GivesWhatItsActivationsLearned) {
  ReadRing ring(64);
  std::uint64_t next = 0;
  std::vector<Read> reads;
  ring.begin(7);
  ring.add(ReadKind::kTaken, 2, 11, 3);
  ring.add(ReadKind::kCredits, 0, 12, 0);
  EXPECT_EQ(ring.read(next, reads), 0U);
  ring.begin(9);
  ring.add(ReadKind::kMode, 0, 0, 1);
  EXPECT_EQ(ring.read(next, reads), 0U);

  ASSERT_EQ(reads.size(), 3U);
  EXPECT_EQ(reads[0].activation, 7U);
  EXPECT_EQ(reads[0].kind, ReadKind::kTaken);
  EXPECT_EQ(reads[0].place, 2U);
  EXPECT_EQ(reads[0].publisher, 11U);
  EXPECT_EQ(reads[0].value, 3U);
  EXPECT_EQ(reads[1].kind, ReadKind::kCredits);
  EXPECT_EQ(reads[2].activation, 9U);
  EXPECT_EQ(reads[2].kind, ReadKind::kMode);
}

TEST(AReadRing, CountsWhatWasWrittenOver) {
  ReadRing ring(64);
  for (std::uint64_t i = 0; i < 64 + 10; ++i) {
    ring.add(ReadKind::kTaken, 0, 1, i);
  }
  std::uint64_t next = 0;
  std::vector<Read> reads;

  EXPECT_EQ(ring.read(next, reads), 10U);

  ASSERT_EQ(reads.size(), 64U);
  EXPECT_EQ(reads.front().value, 10U);
}

TEST(AReadRing, GivesEachOnceOrCountsItWhileItIsWritten) {
  constexpr std::uint64_t kReads = 200'000;
  ReadRing ring(64);
  std::jthread writer([&] {
    for (std::uint64_t i = 0; i < kReads; ++i) {
      ring.begin(i);
      ring.add(ReadKind::kTaken, 5, i, i);
    }
  });
  std::uint64_t next = 0;
  std::uint64_t lost = 0;
  std::vector<Read> reads;
  while (next < kReads) {
    lost += ring.read(next, reads);
  }

  EXPECT_EQ(reads.size() + lost, kReads);
  std::uint64_t last = 0;
  for (const Read& read : reads) {
    EXPECT_EQ(read.activation, read.value);
    EXPECT_EQ(read.publisher, read.value);
    EXPECT_EQ(read.place, 5U);
    EXPECT_TRUE(read.value == 0 || read.value > last);
    last = read.value;
  }
}

}  // namespace
}  // namespace fastcycle::detail
