#include "archive/message_type.h"

#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/message_text.h"
#include "archive/test_log.h"
#include "base/utf8.h"

namespace fastcycle::archive {
namespace {

using ::testing::HasSubstr;

std::string problem_of(const std::string& files, const std::string& name = "demo.Scene") {
  try {
    const MessageType type({.id = 1, .name = name, .encoding = "protobuf", .data = files});
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(MessageType, IsMadeOfTheSchemaAlone) {
  const MessageType type(scene_schema());

  const auto message = type.parse(mcap::bytes_of(scene("name: 'a' origin { x: 1.5 }")));

  EXPECT_EQ(to_text(*message), "name: \"a\"\norigin {\n  x: 1.5\n}\n");
}

TEST(MessageType, FilesOfASchemaMayStandInAnyOrder) {
  google::protobuf::FileDescriptorSet set;
  ASSERT_TRUE(google::protobuf::TextFormat::ParseFromString(kSceneFiles, &set));
  set.mutable_file()->SwapElements(0, 1);

  EXPECT_EQ(problem_of(set.SerializeAsString()), "");
}

TEST(MessageType, WrongSchemaSaysWhy) {
  const auto files = [](const std::string& text) { return descriptor_set(text); };

  EXPECT_THAT(problem_of("\xff\xff"), HasSubstr("its data is no FileDescriptorSet"));
  EXPECT_THAT(problem_of(files(kSceneFiles), "demo.Car"),
              HasSubstr("does not define \"demo.Car\""));
  EXPECT_THAT(problem_of(files("file { name: 'a' dependency: 'b' }")),
              HasSubstr("\"a\" imports \"b\", which is not in it"));
  EXPECT_THAT(
      problem_of(files("file { name: 'a' dependency: 'b' } file { name: 'b' dependency: 'a' }")),
      HasSubstr("in a circle"));
  EXPECT_THAT(problem_of(files("file { name: 'a' } file { name: 'a' }")), HasSubstr("twice"));
  EXPECT_THAT(problem_of(files("file { name: 'a' message_type { name: 'M' field { name: 'f' "
                               "number: 1 type: TYPE_MESSAGE type_name: '.X' } } }")),
              HasSubstr("X"));
  EXPECT_THROW(MessageType({.id = 1, .name = "x", .encoding = "jsonschema", .data = "{}"}),
               std::runtime_error);
}

TEST(MessageType, BytesThatAreFoundRightCanBeParsed) {
  const MessageType type(scene_schema());
  const std::string good = scene(
      "name: 'äöü' origin { x: 1 y: 2 } points { x: 3 } ranges: [1, -2, 300] image: '\\377' "
      "kind: YARD parts { parts { name: 'x' } } stamp: 7");
  ASSERT_FALSE(type.find_wrong(mcap::bytes_of(good)));

  int right = 0;
  int wrong = 0;
  const auto try_one = [&](const std::string& bytes) {
    if (type.find_wrong(mcap::bytes_of(bytes))) {
      ++wrong;
      EXPECT_THROW((void)type.parse(mcap::bytes_of(bytes)), std::runtime_error);
    } else {
      ++right;
      EXPECT_NO_THROW((void)type.parse(mcap::bytes_of(bytes)));
    }
  };
  for (std::size_t at = 0; at < good.size(); ++at) {
    try_one(good.substr(0, at));
    for (int value = 0; value < 256; ++value) {
      std::string bytes = good;
      bytes[at] = static_cast<char>(value);
      try_one(bytes);
    }
  }

  EXPECT_GT(right, 100);
  EXPECT_GT(wrong, 100);
}

TEST(MessageType, WhatIsWrongIsNamed) {
  const MessageType type(scene_schema());
  const auto wrong = [&](const std::string& bytes) {
    return type.find_wrong(mcap::bytes_of(bytes)).value_or("");
  };

  EXPECT_THAT(wrong("\x0a\x05"
                    "ab"),
              HasSubstr("demo.Scene"));
  EXPECT_THAT(wrong("\x0a\x01\xff"), HasSubstr("no UTF-8 in the text demo.Scene.name"));
  EXPECT_THAT(wrong("\x08\x01"), HasSubstr("wire type 0 for demo.Scene.name, which has 2"));
}

TEST(MessageType, FewBytesThatStandForManyAreRefused) {
  const MessageType type(scene_schema());
  std::string bytes;
  for (int i = 0; i < 2'000'000; ++i) {
    bytes += std::string("\x3a\x00", 2);  // An empty scene within the scene.
  }

  EXPECT_THAT(type.find_wrong(mcap::bytes_of(bytes)).value_or(""), HasSubstr("takes more than"));
}

TEST(MessageType, MessagesWithinEachOtherHaveALimit) {
  const MessageType type(scene_schema());
  const auto nested = [](int depth) {
    std::string bytes;
    for (int i = 0; i < depth; ++i) {
      std::string length;
      for (std::size_t rest = bytes.size(); length.empty() || rest > 0; rest >>= 7U) {
        length += static_cast<char>((rest & 0x7FU) | (rest > 0x7FU ? 0x80U : 0U));
      }
      bytes = "\x3a" + length + bytes;
    }
    return bytes;
  };

  EXPECT_FALSE(type.find_wrong(mcap::bytes_of(nested(90))));
  EXPECT_TRUE(type.find_wrong(mcap::bytes_of(nested(110))));
}

TEST(MessageTypes, ProblemOfASchemaIsKept) {
  MessageTypes types;

  EXPECT_NE(types.find(scene_schema(1)).type, nullptr);
  EXPECT_EQ(types.find(mcap::kSpeedSchema).type, types.find(scene_schema(1)).type) << "the same id";
  const MessageTypes::Found& found =
      types.find({.id = 2, .name = "x", .encoding = "protobuf", .data = "\xff"});
  EXPECT_EQ(found.type, nullptr);
  EXPECT_THAT(found.problem, HasSubstr("FileDescriptorSet"));
}

TEST(Utf8, IsWhatTheStandardSays) {
  for (const std::string_view right :
       {"", "a", "ä", "€", "𝄞", "\xED\x9F\xBF", "\xF4\x8F\xBF\xBF"}) {
    EXPECT_TRUE(base::is_utf8(right)) << right;
  }
  for (const std::string_view wrong :
       {"\x80", "\xC3", "\xC0\xAF", "\xE0\x80\xAF", "\xED\xA0\x80", "\xF0\x80\x80\x80",
        "\xF4\x90\x80\x80", "\xF5\x80\x80\x80"}) {
    EXPECT_FALSE(base::is_utf8(wrong));
  }
}

}  // namespace
}  // namespace fastcycle::archive
