#include "executor/due_time.h"

#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::detail {
namespace {

class NotingWatch final : public TimerWatch {
 public:
  void timer_armed(std::int64_t due_ns) noexcept override { reported.push_back(due_ns); }

  std::vector<std::int64_t> reported;
};

TEST(DueTime, TellsOfEachNewTimeOnce) {
  NotingWatch watch;
  DueTime due;

  due.set(base::kNever, &watch);
  due.set(20, &watch);
  due.set(20, &watch);
  due.set(10, &watch);
  due.set(base::kNever, &watch);

  EXPECT_EQ(watch.reported, (std::vector<std::int64_t>{20, 10}));
  EXPECT_EQ(due.get(), base::kNever);
}

TEST(DueTime, IsTakenByOneForTheTimeThatWasSet) {
  NotingWatch watch;
  DueTime due;
  due.set(20, &watch);

  EXPECT_FALSE(due.take(10));
  EXPECT_TRUE(due.take(20));
  EXPECT_FALSE(due.take(20));
  due.set(20, &watch);
  EXPECT_TRUE(due.take(20)) << "it was set again";
  EXPECT_EQ(watch.reported.size(), 2U);
}

}  // namespace
}  // namespace fastcycle::detail
