#include "top/keys.h"

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::tool::top {
namespace {

using Kind = Key::Kind;
using testing::ElementsAre;

Key text(const char* character) {
  return {Kind::kText, character};
}

std::vector<Key> keys_of(std::string_view bytes) {
  KeyReader reader;
  reader.add(bytes);
  std::vector<Key> keys;
  while (auto key = reader.next()) {
    keys.push_back(*key);
  }
  EXPECT_FALSE(reader.is_within_key());
  return keys;
}

TEST(Keys, AreLettersAndWhatTheyWrite) {
  EXPECT_THAT(keys_of("q?é激"), ElementsAre(text("q"), text("?"), text("é"), text("激")));
  EXPECT_THAT(keys_of("\r\t\x7f"),
              ElementsAre(Key{Kind::kEnter}, Key{Kind::kTab}, Key{Kind::kBackspace}));
}

TEST(Keys, AreTheSameInAllTerminals) {
  EXPECT_THAT(keys_of("\x1b[A\x1bOA\x1b[1;5A"),
              ElementsAre(Key{Kind::kUp}, Key{Kind::kUp}, Key{Kind::kUp}));
  EXPECT_THAT(keys_of("\x1b[H\x1b[1~\x1b[7~\x1bOF\x1b[4~"),
              ElementsAre(Key{Kind::kHome}, Key{Kind::kHome}, Key{Kind::kHome}, Key{Kind::kEnd},
                          Key{Kind::kEnd}));
  EXPECT_THAT(keys_of("\x1b[5~\x1b[6~\x1b[Z"),
              ElementsAre(Key{Kind::kPageUp}, Key{Kind::kPageDown}, Key{Kind::kBackTab}));
  EXPECT_THAT(keys_of("\x1b[15~x"), ElementsAre(Key{Kind::kOther}, text("x")));
}

TEST(Keys, ThatComeInPiecesAreWhole) {
  KeyReader reader;
  for (const std::string_view piece : {"\x1b", "[", "6"}) {
    reader.add(piece);
    EXPECT_EQ(reader.next(), std::nullopt);
    EXPECT_TRUE(reader.is_within_key());
  }
  reader.add("~");
  EXPECT_EQ(reader.next(), (Key{Kind::kPageDown}));
}

TEST(Keys, EscapeIsAKeyWhenNothingFollows) {
  KeyReader reader;
  reader.add("\x1b");

  EXPECT_EQ(reader.next(), std::nullopt);
  EXPECT_EQ(reader.finish(), (Key{Kind::kEscape}));
  EXPECT_FALSE(reader.is_within_key());
}

TEST(Keys, EscapeIsAKeyBeforeALetter) {
  EXPECT_THAT(keys_of("\x1bq"), ElementsAre(Key{Kind::kEscape}, text("q")));
  EXPECT_THAT(keys_of("\x1b\x1b[A"), ElementsAre(Key{Kind::kEscape}, Key{Kind::kUp}));
}

}  // namespace
}  // namespace fastcycle::tool::top
