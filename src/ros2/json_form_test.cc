#include "ros2/json_form.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "ros2/error.h"

namespace fastcycle::ros2 {
namespace {

TEST(JsonForm, GoesThereAndBack) {
  Definitions definitions;
  definitions.add_text("demo_msgs/msg/All", R"(bool a
int64 b
float32 c
float64[2] d
string[] e
uint8[] f
char[2] g
)");
  const Definition& all = definitions.find("demo_msgs/msg/All");
  const auto value = nlohmann::ordered_json::parse(
      R"({"a": true, "b": -9007199254740993, "c": 0.1, "d": ["NaN", "-Infinity"],
          "e": ["x", ""], "f": {"base64": "AP8="}, "g": [1, 2]})");
  Buffer bytes;

  from_json(all, value, bytes);

  EXPECT_EQ(to_json(all, bytes.bytes()), value);
}

TEST(JsonForm, WhatIsNotGivenIsZero) {
  Definitions definitions;
  definitions.add_text("demo_msgs/msg/Few", "int8 a\nstring b");
  const Definition& few = definitions.find("demo_msgs/msg/Few");
  Buffer bytes;

  from_json(few, nlohmann::ordered_json::object(), bytes);

  EXPECT_EQ(to_json(few, bytes.bytes()).dump(), R"({"a":0,"b":""})");
}

}  // namespace
}  // namespace fastcycle::ros2
