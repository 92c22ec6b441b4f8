#include "trace.h"

#include <gtest/gtest.h>

namespace rav4 {
namespace {

TEST(Trace, FewPointsAreAllKept) {
  Trace<int> trace(4);
  for (int point = 0; point < 4; ++point) {
    trace.add(point);
  }

  EXPECT_EQ(trace.points(), (std::vector<int>{0, 1, 2, 3}));
}

TEST(Trace, ManyPointsAreThinnedOutEvenly) {
  Trace<int> trace(4);
  for (int point = 0; point < 13; ++point) {
    trace.add(point);
  }

  EXPECT_EQ(trace.points(), (std::vector<int>{0, 4, 8, 12}));
}

}  // namespace
}  // namespace rav4
