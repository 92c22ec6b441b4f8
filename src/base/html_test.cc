#include "base/html.h"

#include <gtest/gtest.h>

namespace fastcycle::base {
namespace {

TEST(Html, HasNoLetterThatMeansSomethingElse) {
  EXPECT_EQ(to_html("a < b && \"c\" > d"), "a &lt; b &amp;&amp; &quot;c&quot; &gt; d");
  EXPECT_EQ(to_html("größer"), "größer");
}

}  // namespace
}  // namespace fastcycle::base
