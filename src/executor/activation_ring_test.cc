#include "executor/activation_ring.h"

#include <thread>

#include <gtest/gtest.h>

namespace fastcycle::detail {
namespace {

ActivationRecord numbered(std::uint64_t number) {
  ActivationRecord record;
  record.component = 3;
  record.cause = Cause::kTick;
  record.number = number;
  record.key = 2 * number;
  record.cause_ns = 16;
  record.begin_ns = 17;
  return record;
}

TEST(ActivationRing, ShowsAnActivationBeforeItEnds) {
  ActivationRing ring;

  const std::uint64_t place = ring.begin(numbered(1));

  ASSERT_EQ(ring.snapshot().size(), 1U);
  EXPECT_EQ(ring.snapshot()[0].outcome, Outcome::kRunning);
  ring.end(
      place,
      {.outcome = Outcome::kFault, .duration_ns = 1234, .published_ns = 99, .publish_count = 2});
  const ActivationRecord record = ring.snapshot()[0];
  EXPECT_EQ(record.component, 3U);
  EXPECT_EQ(record.cause, Cause::kTick);
  EXPECT_EQ(record.outcome, Outcome::kFault);
  EXPECT_EQ(record.begin_ns, 17);
  EXPECT_EQ(record.cause_ns, 16);
  EXPECT_EQ(record.duration_ns, 1234);
  EXPECT_EQ(record.published_ns, 99);
  EXPECT_EQ(record.publish_count, 2U);
}

TEST(ActivationRing, KeepsTheLastOnes) {
  ActivationRing ring;

  for (std::uint64_t i = 1; i <= ActivationRing::kCapacity + 10; ++i) {
    ring.begin(numbered(i));
  }

  const auto records = ring.snapshot();
  ASSERT_EQ(records.size(), ActivationRing::kCapacity);
  EXPECT_EQ(records.front().number, 11U);
  EXPECT_EQ(records.back().number, ActivationRing::kCapacity + 10);
}

TEST(ActivationRing, AReaderNeverSeesHalfARecord) {
  ActivationRing ring;
  std::atomic<bool> is_over{false};
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= 100'000; ++i) {
      ring.end(ring.begin(numbered(i)), {.outcome = Outcome::kDone});
    }
    is_over = true;
  });

  do {
    for (const ActivationRecord& record : ring.snapshot()) {
      ASSERT_EQ(record.key, 2 * record.number);
    }
  } while (!is_over);

  writer.join();
}

}  // namespace
}  // namespace fastcycle::detail
