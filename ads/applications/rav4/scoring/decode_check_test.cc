#include "decode_check.h"

#include <array>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace rav4 {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""ns;

DecodeCheck three_rows() {
  return {{10ms, 20ms, 30ms}, ads::NumberTable(3, 1, {1.0, 2.0, 3.0})};
}

void compare(DecodeCheck& check, fastcycle::Duration offset, double value) {
  check.compare(offset, std::array{value});
}

TEST(DecodeCheck, EqualRowsHaveNoError) {
  DecodeCheck check = three_rows();
  compare(check, 10ms, 1.0);
  compare(check, 20ms + 1ns, 2.0);
  compare(check, 30ms, 3.0);

  EXPECT_EQ(check.compared(), 3);
  EXPECT_EQ(check.unmatched(), 0);
  EXPECT_EQ(check.max_error(), 0.0);
}

TEST(DecodeCheck, LargestErrorIsKept) {
  DecodeCheck check = three_rows();
  compare(check, 10ms, 1.5);
  compare(check, 20ms, 1.75);

  EXPECT_EQ(check.max_error(), 0.5);
}

TEST(DecodeCheck, RowsAndMessagesWithoutPartnerAreCounted) {
  DecodeCheck check = three_rows();
  compare(check, 5ms, 1.0);
  compare(check, 20ms, 2.0);
  compare(check, 30ms, 3.0);
  compare(check, 40ms, 4.0);

  EXPECT_EQ(check.compared(), 2);
  EXPECT_EQ(check.unmatched(), 3);
}

TEST(DecodeCheck, NotANumberIsAnError) {
  DecodeCheck check = three_rows();
  compare(check, 10ms, std::numeric_limits<double>::quiet_NaN());

  EXPECT_TRUE(std::isnan(check.max_error()));
}

}  // namespace
}  // namespace rav4
