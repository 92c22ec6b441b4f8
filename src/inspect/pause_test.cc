#include "inspect/pause.h"

#include <gtest/gtest.h>

namespace fastcycle::inspect {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;

TEST(Pause, IsBehindAMessageOfASteadyTopic) {
  for (const nanoseconds interval : {milliseconds(5), milliseconds(10), milliseconds(33)}) {
    for (nanoseconds age = milliseconds(0); age <= interval; age += microseconds(250)) {
      const nanoseconds wait = wait_for_pause(interval, age, milliseconds(20));

      const nanoseconds behind = (age + wait) % interval;
      EXPECT_GE(behind, milliseconds(1)) << interval.count() << " ns, age " << age.count();
      EXPECT_LE(behind, milliseconds(2)) << interval.count() << " ns, age " << age.count();
      EXPECT_GE(wait, milliseconds(20));
      EXPECT_LT(wait, milliseconds(20) + interval);
    }
  }
}

TEST(Pause, IsNotLookedForWhereThereIsNone) {
  EXPECT_EQ(wait_for_pause(milliseconds(1), microseconds(500), milliseconds(20)), milliseconds(20));
}

TEST(Pause, IsNotLookedForWithoutARhythm) {
  EXPECT_EQ(wait_for_pause(milliseconds(10), milliseconds(11), milliseconds(20)), milliseconds(20))
      << "it has fallen silent";
  EXPECT_EQ(wait_for_pause(milliseconds(10), milliseconds(-1), milliseconds(20)), milliseconds(20));
  EXPECT_EQ(wait_for_pause(milliseconds(500), milliseconds(1), milliseconds(20)), milliseconds(20));
  EXPECT_EQ(wait_for_pause(milliseconds(0), milliseconds(0), milliseconds(20)), milliseconds(20));
}

}  // namespace
}  // namespace fastcycle::inspect
