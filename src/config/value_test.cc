#include "config/value.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/utf8.h"
#include "config/parse.h"

namespace fastcycle::config {
namespace {

Value value_of(std::string_view text) {
  Problems problems;
  const auto source = std::make_shared<const Source>(Source{"folder/app.json", "folder", true});
  return parse(text, source, problems).value();
}

TEST(Value, HoldsWhatTheTextSays) {
  const Value value = value_of(R"([null, true, -3, 18446744073709551615, 2.5, "text", [], {}])");

  EXPECT_TRUE(value[0].is_null());
  EXPECT_TRUE(value[1].as_bool());
  EXPECT_EQ(value[2].as_int64(), -3);
  EXPECT_EQ(value[3].as_uint64(), UINT64_MAX);
  EXPECT_EQ(value[4].as_double(), 2.5);
  EXPECT_EQ(value[5].as_string(), "text");
  EXPECT_TRUE(value[6].is_array());
  EXPECT_TRUE(value[7].is_object());
}

TEST(Value, HasOneTypeForEachInteger) {
  const Value value = value_of("[9223372036854775807, 9223372036854775808, -9223372036854775808]");

  EXPECT_EQ(value[0].type(), Value::Type::kInt);
  EXPECT_EQ(value[1].type(), Value::Type::kUint);
  EXPECT_EQ(value[2].as_int64(), INT64_MIN);
  EXPECT_EQ(value[0].as_uint64(), 9223372036854775807U);
}

TEST(Value, KeepsTheOrderOfKeys) {
  const Value value = value_of(R"({"z": 1, "a": 2, "m": 3})");

  EXPECT_EQ(value.to_text(), R"({"z":1,"a":2,"m":3})");
}

TEST(Value, EveryPartKnowsItsPlace) {
  const Value value = value_of("{\n  \"a/b\": [\n    1,\n    {\"c\": 2}\n  ]\n}");

  EXPECT_EQ(to_string(value.place()), "folder/app.json:1");
  EXPECT_EQ(to_string(value["a/b"].place()), "folder/app.json:2: /a~1b");
  EXPECT_EQ(to_string(value["a/b"][0].place()), "folder/app.json:3: /a~1b/0");
  EXPECT_EQ(to_string(value["a/b"][1]["c"].place()), "folder/app.json:4: /a~1b/1/c");
}

TEST(Value, FindsThroughNestedObjectsByDots) {
  const Value value = value_of(R"({"limits": {"jerk": {"max": 3}}})");

  EXPECT_EQ(value.find_dotted("limits.jerk.max")->as_int64(), 3);
  EXPECT_EQ(value.find_dotted("limits.snap"), nullptr);
  EXPECT_EQ(value.find_dotted("limits.jerk.max.more"), nullptr);
}

TEST(Value, PathsAreRelativeToTheirFile) {
  const Value value = value_of(R"(["maps/town.osm", "/maps/town.osm", "../town.osm"])");

  EXPECT_EQ(value[0].as_path(), "folder/maps/town.osm");
  EXPECT_EQ(value[1].as_path(), "/maps/town.osm");
  EXPECT_EQ(value[2].as_path(), "town.osm");
}

TEST(Value, PathsOfOptionsAreRelativeToTheWorkingFolder) {
  const Value value = parse_option("maps/town.osm", "--set limiter.map=maps/town.osm");

  EXPECT_EQ(value.as_path(), "maps/town.osm");
}

TEST(Value, SameContentDoesNotAskWhere) {
  EXPECT_TRUE(value_of("[1, {\"a\": 2}]").same_content(value_of("[1,\n{\"a\": 2}]")));
  EXPECT_FALSE(value_of("[1]").same_content(value_of("[2]")));
}

TEST(Value, ErasesAndReplacesMembers) {
  Value value = value_of(R"({"a": 1, "b": 2})");

  value.set("a", value_of("3"));
  value.set("c", value_of("4"));

  EXPECT_TRUE(value.erase("b"));
  EXPECT_FALSE(value.erase("b"));
  EXPECT_EQ(value.to_text(), R"({"a":3,"c":4})");
}

TEST(Value, IsShownShortAndOnOneLine) {
  EXPECT_EQ(shown(value_of("\"two\\nlines\"")), "\"two\\nlines\"");
  EXPECT_EQ(shown(value_of("[1, 2]")), "[1,2]");
  EXPECT_EQ(in_quotes(std::string(100, 'a')), '"' + std::string(59, 'a') + "…\"");
  EXPECT_EQ(in_quotes("\x1b[31m"), "\"\\u001b[31m\"");
}

TEST(Value, IsNotCutInsideACharacter) {
  std::string text;
  for (int i = 0; i < 40; ++i) {
    text += "ü";
  }

  EXPECT_TRUE(base::is_utf8(in_quotes(text)));
  EXPECT_TRUE(base::is_utf8(in_quotes('a' + text)));
}

}  // namespace
}  // namespace fastcycle::config
