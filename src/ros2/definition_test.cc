#include "ros2/definition.h"

#include <gmock/gmock.h>

namespace fastcycle::ros2 {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const Definition& read(Definitions& definitions, std::string_view text) {
  definitions.add_text("demo_msgs/msg/Speed", text);
  return definitions.find("demo_msgs/Speed");
}

TEST(Definition, HasItsFieldsInTheirOrder) {
  Definitions definitions;
  definitions.add_text("std_msgs/msg/Header", "string frame_id");
  definitions.add_text("demo_msgs/msg/Wheel", "int16 ticks");

  const Definition& speed = read(definitions, R"(# How fast.
std_msgs/Header header   # when
float32 mps 1.5
uint8 GEAR_NEUTRAL=0
string GREETING = "a # b"
string<=8 unit "m/s"
Wheel[4] wheels
int32[<=3] few
byte[] rest
)");

  std::vector<std::string> fields;
  for (const Field& field : speed.fields) {
    fields.push_back(to_text(field) + " " + field.name);
  }
  EXPECT_THAT(fields, ::testing::ElementsAre("std_msgs/msg/Header header", "float32 mps",
                                             "string<=8 unit", "demo_msgs/msg/Wheel[4] wheels",
                                             "int32[<=3] few", "byte[] rest"));
  ASSERT_EQ(speed.constants.size(), 2U);
  EXPECT_EQ(speed.constants[1].value, "\"a # b\"");
  EXPECT_EQ(speed.least_bytes, 4U + 4U + 4U + 8U + 4U + 4U);
}

TEST(Definition, WithoutFieldsHasOneByte) {
  Definitions definitions;

  EXPECT_EQ(read(definitions, "").least_bytes, 1U);
}

TEST(Definition, OfAServiceHasTwoHalves) {
  Definitions definitions;
  definitions.add_text("demo_srvs/srv/Reset", "bool hard\n---\nbool success\nstring message\n");

  EXPECT_EQ(definitions.find("demo_srvs/srv/Reset_Request").fields.size(), 1U);
  EXPECT_EQ(definitions.find("demo_srvs/srv/Reset_Response").fields.at(1).name, "message");
}

TEST(Definition, ErrorsAreReported) {
  const auto reading = [](std::string_view text) {
    return [text] {
      Definitions definitions;
      read(definitions, text);
    };
  };

  EXPECT_THAT(reading("float32"), ThrowsMessage<DefinitionError>(HasSubstr(
                                      "demo_msgs/msg/Speed: line 1: expected a type and a name")));
  EXPECT_THAT(reading("Speed inner"), ThrowsMessage<DefinitionError>(HasSubstr("contains itself")));
  EXPECT_THAT(reading("Sped inner"),
              ThrowsMessage<DefinitionError>(HasSubstr("demo_msgs/msg/Sped: there is no")));
  EXPECT_THAT(reading("int8[0] none"), ThrowsMessage<DefinitionError>(HasSubstr("a count from 1")));
  EXPECT_THAT(reading("../../etc/passwd x"), ThrowsMessage<DefinitionError>(HasSubstr("a type")));
}

}  // namespace
}  // namespace fastcycle::ros2
