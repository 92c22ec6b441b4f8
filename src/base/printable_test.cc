#include "base/printable.h"

#include <string>

#include <gtest/gtest.h>

#include "base/utf8.h"

namespace fastcycle::base {
namespace {

TEST(Printable, ControlCharactersAreShownAndDoNotSteerATerminal) {
  EXPECT_EQ(printable("a\x1b[31mä€\n\x7f"), "a\\x1b[31mä€\\x0a\\x7f");
  EXPECT_EQ(printable(std::string("\0\t\r", 3)), "\\x00\\x09\\x0d");
}

TEST(Printable, C1ControlsAreShownThoughTheyAreUtf8) {
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m\xc2\xa0"),
            "\\xc2\\x9b31m\xc2\xa0");
}

TEST(Printable, WhatIsNoUtf8IsShownByteByByte) {
  EXPECT_EQ(printable("\xff\x9b"
                      "A\xe2\x82"),
            "\\xff\\x9bA\\xe2\\x82");
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // Half of a pair.
}

TEST(Printable, WhatTurnsTextAroundIsShown) {
  for (const char* const text : {"\xe2\x80\xae", "\xe2\x80\xaa", "\xe2\x81\xa6", "\xe2\x81\xa9",
                                 "\xe2\x80\x8e", "\xe2\x80\xa8", "\xef\xbb\xbf"}) {
    EXPECT_EQ(printable(text).substr(0, 2), "\\x") << text;
  }
  EXPECT_EQ(printable("\xd8\x9c"), "\\xd8\\x9c");
  EXPECT_EQ(printable("\xf3\xa0\x80\xa1"), "\\xf3\\xa0\\x80\\xa1");  // A tag.
}

TEST(Printable, WordsOfAllLanguagesStayAsTheyAre) {
  const std::string words = "Größe 速度 سرعة скорость 👩‍🔧 µs €";
  EXPECT_EQ(printable(words), words);
  EXPECT_EQ(printable_json(words), words);
}

TEST(Printable, SeveralLinesStayLines) {
  EXPECT_EQ(printable_lines("a\tb\r\n\x1b[2Jc\n"), "a\tb\\x0d\n\\x1b[2Jc\n");
}

TEST(Printable, JsonGoesOnMeaningTheSame) {
  EXPECT_EQ(printable_json("{\"a\": \"\xc2\x9b\x7f\xe2\x80\xae\"}\n"),
            "{\"a\": \"\\u009b\\u007f\\u202e\"}\n");
  EXPECT_EQ(printable_json("\"\xf3\xa0\x80\xa1\xff\""), "\"\\udb40\\udc21\\ufffd\"");
}

TEST(Utf8, WhatIsNoneBecomesQuestionMarks) {
  EXPECT_EQ(to_utf8("Größe"), "Größe");
  EXPECT_EQ(to_utf8("Gr\xf6\xdf"
                    "e"),
            "Gr??e");
}

}  // namespace
}  // namespace fastcycle::base
