#include "archive/message_text.h"

#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <google/protobuf/message.h>
#include <gtest/gtest.h>

#include "archive/test_log.h"

namespace fastcycle::archive {
namespace {

using ::testing::ElementsAre;
using ::testing::Field;

class MessageText : public ::testing::Test {
 protected:
  std::unique_ptr<google::protobuf::Message> message(const std::string& text) const {
    return type_.parse(mcap::bytes_of(scene(text)));
  }

  const MessageType type_{scene_schema()};
};

TEST_F(MessageText, HasALineForEachField) {
  EXPECT_EQ(
      to_text(*message("name: 'a' origin { x: 0.1 y: -2 } points { x: 3 } points { y: 1e300 } "
                       "ranges: [1, 2] image: 'ab' kind: YARD stamp: 18446744073709551615")),
      "name: \"a\"\n"
      "origin {\n"
      "  x: 0.1\n"
      "  y: -2\n"
      "}\n"
      "points {\n"
      "  x: 3\n"
      "}\n"
      "points {\n"
      "  y: 1e+300\n"
      "}\n"
      "ranges: [1, 2]\n"
      "image: 6162\n"
      "kind: YARD\n"
      "stamp: 18446744073709551615\n");
}

TEST_F(MessageText, LargeFieldsAreShortened) {
  std::string text =
      "image: '" + std::string(1000, 'x') + "' name: '" + std::string(500, 'n') + "'";
  for (int i = 0; i < 2000; ++i) {
    text += " ranges: 7 points { x: 1 }";
  }

  const std::string shown = to_text(*message(text), {.elements = 2, .bytes = 64, .letters = 3});

  EXPECT_EQ(shown,
            "name: \"nnn\"… 497 more\n"
            "points {\n  x: 1\n}\npoints {\n  x: 1\n}\n"
            "points: [… 1998 more]\n"
            "ranges: [7, 7, … 1998 more]\n"
            "image: <1000 bytes>\n");
}

TEST_F(MessageText, IsWholeWithoutLimits) {
  std::string text = "image: '" + std::string(1000, 'x') + "'";
  for (int i = 0; i < 100; ++i) {
    text += " ranges: 7";
  }

  const std::string shown = to_text(*message(text), TextLimits::none());

  EXPECT_EQ(shown.find("…"), std::string::npos);
  EXPECT_GT(shown.size(), 2300U);
}

TEST_F(MessageText, JsonSaysWhatIsMissing) {
  const MessageJson json =
      to_json(*message("name: 'long name' points { x: 1 } points { x: 2 } points { x: 3 } "
                       "parts { image: 'abcde' } stamp: 9007199254740993"),
              {.elements = 2, .bytes = 4, .letters = 4});

  EXPECT_EQ(
      json.data,
      R"({"name":"long","points":[{"x":1},{"x":2}],"parts":[{}],"stamp":"9007199254740993"})");
  EXPECT_THAT(json.elided,
              ElementsAre(Field(&Elided::field, "name"), Field(&Elided::field, "points"),
                          Field(&Elided::field, "parts[0].image")));
  EXPECT_EQ(json.elided[1].left_out, 1U);
  EXPECT_EQ(json.elided[2].left_out, 5U);
}

TEST_F(MessageText, WhatIsCutAlreadyCountsAsLeftOut) {
  const auto cut_message = message("image: 'ab' name: 'n' points { x: 1 } ranges: [7, 8]");
  const std::vector<Elided> cut{{.field = "image", .left_out = 998},
                                {.field = "name", .left_out = 4},
                                {.field = "points", .left_out = 9},
                                {.field = "ranges", .left_out = 100}};

  EXPECT_EQ(to_text(*cut_message, {.elements = 1}, 0, cut),
            "name: \"n\"… 4 more\n"
            "points {\n  x: 1\n}\n"
            "points: [… 9 more]\n"
            "ranges: [7, … 101 more]\n"
            "image: <1000 bytes>\n");
  const MessageJson json = to_json(*cut_message, TextLimits::none(), cut);
  ASSERT_EQ(json.elided.size(), 4U);
  EXPECT_EQ(json.elided[3].field, "image");
  EXPECT_EQ(json.elided[3].left_out, 1000U);
}

TEST(Hex, IsCutWhereItIsLong) {
  EXPECT_EQ(to_hex(mcap::bytes_of("\x01\xab"), {}), "01ab");
  EXPECT_EQ(to_hex(mcap::bytes_of("abcd"), {.bytes = 2}), "6162… 2 more");
}

}  // namespace
}  // namespace fastcycle::archive
