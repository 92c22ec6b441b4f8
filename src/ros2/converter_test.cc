#include "ros2/converter.h"

#include <gmock/gmock.h>
#include <google/protobuf/timestamp.pb.h>
#include <google/protobuf/type.pb.h>
#include <google/protobuf/wrappers.pb.h>
#include <nlohmann/json.hpp>

#include "ros2/json_form.h"

namespace fastcycle::ros2 {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// One type, made by its fields' names.
class Single {
 public:
  Single(std::string_view text, const google::protobuf::Message& ours) {
    definitions_.add_text("demo_msgs/msg/Single", text);
    converter_.emplace(definitions_.find("demo_msgs/msg/Single"), *ours.GetDescriptor(), mappings_,
                       Conversions{});
  }
  const Converter* operator->() const { return &*converter_; }
  [[nodiscard]] Buffer bytes(const char* json) const {
    Buffer bytes;
    from_json(converter_->definition(), nlohmann::ordered_json::parse(json), bytes);
    return bytes;
  }
  [[nodiscard]] std::string json(const google::protobuf::Message& message) const {
    Buffer bytes;
    converter_->to_ros(message, bytes);
    return to_json(converter_->definition(), bytes.bytes()).dump();
  }

 private:
  Definitions definitions_;
  Mappings mappings_;
  std::optional<Converter> converter_;
};

TEST(Converter, FieldsGoByTheirNames) {
  const Single single("int32 nanos\nint32 seconds\nbool other",
                      google::protobuf::Timestamp::default_instance());
  google::protobuf::Timestamp time;

  single->to_message(single.bytes(R"({"nanos": 5, "seconds": 7, "other": true})").bytes(), time);

  EXPECT_EQ(time.seconds(), 7);
  EXPECT_EQ(time.nanos(), 5);
  EXPECT_EQ(single.json(time), R"({"nanos":5,"seconds":7,"other":false})");
  EXPECT_THAT(single->unmapped(), ::testing::ElementsAre("other"));
}

TEST(Converter, NumbersThatHaveNoRoomAreErrors) {
  const Single single("int64 nanos\nint8 seconds", google::protobuf::Timestamp::default_instance());
  google::protobuf::Timestamp time;

  EXPECT_THAT(
      [&] { single->to_message(single.bytes(R"({"nanos": 3000000000})").bytes(), time); },
      ThrowsMessage<CdrError>(HasSubstr("demo_msgs/msg/Single: byte 12: nanos: expected a number "
                                        "from -2147483648 to 2147483647, found 3000000000")));
  time.set_seconds(128);
  EXPECT_THAT([&] { (void)single.json(time); },
              ThrowsMessage<CdrError>(HasSubstr("seconds: expected a number from -128 to 127")));
}

TEST(Converter, TextsListsAndEnumsAreConverted) {
  const Single single("string name\nstring[] oneofs\nuint8 syntax",
                      google::protobuf::Type::default_instance());
  google::protobuf::Type type;
  const char* const kJson = R"({"name":"a","oneofs":["b","c"],"syntax":1})";

  single->to_message(single.bytes(kJson).bytes(), type);

  EXPECT_EQ(type.oneofs(1), "c");
  EXPECT_EQ(type.syntax(), google::protobuf::SYNTAX_PROTO3);
  EXPECT_EQ(single.json(type), kJson);
  EXPECT_THAT([&] { single->to_message(single.bytes(R"({"syntax": 77})").bytes(), type); },
              ThrowsMessage<CdrError>(HasSubstr("a number of google.protobuf.Syntax")));
}

TEST(Converter, BytesAreCopiedWhole) {
  const Single single("uint8[] value", google::protobuf::BytesValue::default_instance());
  google::protobuf::BytesValue value;

  single->to_message(single.bytes(R"({"value": {"base64": "AP8="}})").bytes(), value);

  EXPECT_EQ(value.value(), std::string("\0\xff", 2));
  EXPECT_EQ(single.json(value), R"({"value":{"base64":"AP8="}})");
}

TEST(Converter, ArraysAreAsLongAsTheirTypeSays) {
  const Single single("uint8[3] value", google::protobuf::BytesValue::default_instance());
  google::protobuf::BytesValue value;
  value.set_value("ab");

  EXPECT_THAT([&] { (void)single.json(value); },
              ThrowsMessage<CdrError>(HasSubstr("value: expected 3 elements, found 2")));
  value.clear_value();
  EXPECT_EQ(single.json(value), R"({"value":[0,0,0]})");
}

TEST(Converter, TypesWithoutAnythingInCommonAreErrors) {
  EXPECT_THAT(
      [] { const Single single("bool a", google::protobuf::Timestamp::default_instance()); },
      ThrowsMessage<MappingError>(HasSubstr("no field has the same name")));
  EXPECT_THAT(
      [] {
        const Single single("string seconds", google::protobuf::Timestamp::default_instance());
      },
      ThrowsMessage<MappingError>(HasSubstr("seconds (string) cannot become")));
}

}  // namespace
}  // namespace fastcycle::ros2
