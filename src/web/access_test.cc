#include "web/access.h"

#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::web {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Access kAccess{.token = "0123456789abcdef0123456789abcdef",
                     .origins = {"https://app.foxglove.dev"},
                     .hosts = {"truck.local"}};

Caller caller() {
  return {.target = "/?token=0123456789abcdef0123456789abcdef",
          .host = "127.0.0.1:8765",
          .origin = "",
          .authorization = ""};
}

TEST(Access, IsGivenToWhoKnowsTheToken) {
  EXPECT_THAT(find_refusal(kAccess, caller()), IsEmpty());
  Caller by_header = caller();
  by_header.target = "/";
  by_header.authorization = "Bearer 0123456789abcdef0123456789abcdef";
  EXPECT_THAT(find_refusal(kAccess, by_header), IsEmpty());
  Caller behind_others = caller();
  behind_others.target = "/ws?a=b&token=0123456789abcdef0123456789abcdef&c=d";
  EXPECT_THAT(find_refusal(kAccess, behind_others), IsEmpty());
}

TEST(Access, IsRefusedWithoutTheRightToken) {
  Caller none = caller();
  none.target = "/";
  EXPECT_THAT(find_refusal(kAccess, none), HasSubstr("a token is missing"));
  for (const char* wrong :
       {"/?token=", "/?token", "/?token=0", "/?token=0123456789abcdef0123456789abcdee",
        "/?token=0123456789abcdef0123456789abcdef0", "/?token=0123456789ABCDEF0123456789ABCDEF",
        "/?othertoken=0123456789abcdef0123456789abcdef"}) {
    Caller other = caller();
    other.target = wrong;
    EXPECT_FALSE(find_refusal(kAccess, other).empty()) << wrong;
  }
}

TEST(Access, IsRefusedToPagesOfOtherSites) {
  Caller page = caller();
  page.origin = "https://evil.example";
  EXPECT_THAT(find_refusal(kAccess, page), HasSubstr("https://evil.example"));
  page.origin = "null";
  EXPECT_FALSE(find_refusal(kAccess, page).empty());
  page.origin = "http://127.0.0.1:80";
  EXPECT_FALSE(find_refusal(kAccess, page).empty());
  page.origin = "http://127.0.0.1:8765";  // Its own.
  EXPECT_THAT(find_refusal(kAccess, page), IsEmpty());
  page.origin = "https://app.foxglove.dev";
  EXPECT_THAT(find_refusal(kAccess, page), IsEmpty());
}

TEST(Access, IsRefusedUnderNamesOfOthersThatLeadHere) {
  for (const char* host : {"evil.example:8765", "evil.example", "", "127.0.0.1.evil.example",
                           "localhost.evil.example", "[::1", "[evil]"}) {
    Caller rebound = caller();
    rebound.host = host;
    EXPECT_FALSE(find_refusal(kAccess, rebound).empty()) << host;
  }
  for (const char* host : {"localhost:8765", "127.0.0.1", "[::1]:8765", "truck.local:1"}) {
    Caller own = caller();
    own.host = host;
    EXPECT_THAT(find_refusal(kAccess, own), IsEmpty()) << host;
  }
}

TEST(Access, HasATokenThatNobodyGuesses) {
  std::set<std::string> all;
  for (int i = 0; i < 100; ++i) {
    const std::string token = make_token();
    EXPECT_EQ(token.size(), 32);
    EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos) << token;
    all.insert(token);
  }
  EXPECT_EQ(all.size(), 100);
}

TEST(Access, ComparesWholeSecrets) {
  EXPECT_TRUE(is_same_secret("abc", "abc"));
  EXPECT_FALSE(is_same_secret("abc", "abd"));
  EXPECT_FALSE(is_same_secret("abc", "ab"));
  EXPECT_FALSE(is_same_secret("ab", "abc"));
  EXPECT_FALSE(is_same_secret("abcabc", "abc"));
  EXPECT_FALSE(is_same_secret("", ""));
}

}  // namespace
}  // namespace fastcycle::web
