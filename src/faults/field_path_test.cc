#include "faults/field_path.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include <gmock/gmock.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/timestamp.pb.h>
#include <gtest/gtest.h>

namespace fastcycle::faults {
namespace {

using config::Corruption;
using google::protobuf::ListValue;
using google::protobuf::Timestamp;
using testing::HasSubstr;

template <typename Message>
void corrupt(Message& message, const char* field, Corruption corruption, double value = 0,
             std::uint64_t bits = 0, const Message* before = nullptr) {
  std::string why;
  const auto path = FieldPath::find(field, *Message::descriptor(), corruption, why);
  ASSERT_TRUE(path) << why;
  path->corrupt(message, corruption, value, bits, before);
}

ListValue list_of(std::initializer_list<double> values) {
  ListValue list;
  for (const double value : values) {
    list.add_values()->set_number_value(value);
  }
  return list;
}

TEST(FieldPath, MeansAllElementsOfARepeatedFieldOrOne) {
  ListValue all = list_of({1, 2, 3});
  ListValue one = list_of({1, 2, 3});
  ListValue none = list_of({1});
  corrupt(all, "values.number_value", Corruption::kNan);
  corrupt(one, "values.1.number_value", Corruption::kNan);
  corrupt(none, "values.1.number_value", Corruption::kNan);

  for (const auto& value : all.values()) {
    EXPECT_TRUE(std::isnan(value.number_value()));
  }
  EXPECT_EQ(one.values(0).number_value(), 1);
  EXPECT_TRUE(std::isnan(one.values(1).number_value()));
  EXPECT_EQ(one.values(2).number_value(), 3);
  EXPECT_EQ(none.values(0).number_value(), 1);
}

TEST(FieldPath, SetsAValueWithinWhatTheFieldCanHold) {
  Timestamp stamp;
  corrupt(stamp, "seconds", Corruption::kValue, -12);
  corrupt(stamp, "nanos", Corruption::kValue, 1e30);

  EXPECT_EQ(stamp.seconds(), -12);
  EXPECT_EQ(stamp.nanos(), std::numeric_limits<std::int32_t>::max());
}

TEST(FieldPath, FlipsOneBit) {
  Timestamp stamp;
  stamp.set_seconds(0b1000);
  stamp.set_nanos(0);
  ListValue list = list_of({1});
  corrupt(stamp, "seconds", Corruption::kBitFlip, 0, 64 + 3);
  corrupt(stamp, "nanos", Corruption::kBitFlip, 0, 32 + 4);
  corrupt(list, "values.number_value", Corruption::kBitFlip, 0, 63);

  EXPECT_EQ(stamp.seconds(), 0);
  EXPECT_EQ(stamp.nanos(), 16);
  EXPECT_EQ(list.values(0).number_value(), -1);
}

TEST(FieldPath, TakesWhatTheFieldWasBefore) {
  Timestamp before;
  before.set_seconds(5);
  before.set_nanos(6);
  Timestamp stamp;
  stamp.set_seconds(50);
  stamp.set_nanos(60);
  corrupt(stamp, "seconds", Corruption::kStale, 0, 0, &before);
  ListValue list = list_of({1, 2});
  const ListValue old = list_of({7});
  corrupt(list, "values.number_value", Corruption::kStale, 0, 0, &old);
  Timestamp first = stamp;
  corrupt(first, "seconds", Corruption::kStale);

  EXPECT_EQ(stamp.seconds(), 5);
  EXPECT_EQ(stamp.nanos(), 60);
  EXPECT_EQ(before.seconds(), 5);
  EXPECT_EQ(list.values(0).number_value(), 7);
  EXPECT_EQ(list.values(1).number_value(), 2);
  EXPECT_EQ(first.seconds(), 5);
}

TEST(FieldPath, SaysWhyAFieldCannotBeCorrupted) {
  const auto why_not = [](const char* field, Corruption corruption) {
    std::string why;
    EXPECT_FALSE(FieldPath::find(field, *ListValue::descriptor(), corruption, why)) << field;
    return why;
  };

  EXPECT_THAT(why_not("valus", Corruption::kNan), HasSubstr("has no field \"valus\""));
  EXPECT_THAT(why_not("values.bool_value", Corruption::kNan), HasSubstr("only a double"));
  EXPECT_THAT(why_not("values", Corruption::kBitFlip), HasSubstr("name one of its fields"));
  EXPECT_THAT(why_not("values.string_value", Corruption::kValue), HasSubstr("only a number"));
  EXPECT_THAT(why_not("values.number_value.0", Corruption::kNan), HasSubstr("no repeated field"));
  EXPECT_THAT(why_not("values.number_value.x", Corruption::kNan), HasSubstr("no message"));
  EXPECT_THAT(why_not("", Corruption::kNan), HasSubstr("names no field"));
}

}  // namespace
}  // namespace fastcycle::faults
