#include "inspect/elide.h"

#include <string>
#include <string_view>

#include <gmock/gmock.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/version.h"
#include "status/status.pb.h"

namespace fastcycle::inspect {
namespace {

// In a program for the thread sanitizer protobuf's headers lay out maps in another way than the
// system's library, which was compiled without it (map_field.h): no map of its types can be
// touched.
constexpr bool kHasMaps = std::string_view(FASTCYCLE_SANITIZER) != "thread";
constexpr const char* kNoMaps = "the system's protobuf has other maps than the thread sanitizer's";

using Elisions = google::protobuf::RepeatedPtrField<protocol::Elision>;

TEST(AShortMessage, IsCopiedWhole) {
  status::Status from;
  from.set_application("demo");
  from.mutable_header()->set_taken_ns(7);
  from.add_components()->set_activations(3);
  status::Status to;
  Elisions elisions;
  copy_elided(from, to, {}, elisions);
  EXPECT_EQ(from.SerializeAsString(), to.SerializeAsString());
  EXPECT_TRUE(elisions.empty());
}

TEST(ALongMessage, IsCutWhereItIsLong) {
  status::Status from;
  for (int i = 0; i < 100; ++i) {
    from.add_components()->set_name(std::string(i == 3 ? 1000 : 4, 'n'));
  }
  status::Status to;
  Elisions elisions;
  copy_elided(from, to, {.elements = 5, .bytes = 10}, elisions);
  EXPECT_EQ(to.components().size(), 5);
  EXPECT_EQ(to.components(3).name().size(), 10U);
  ASSERT_EQ(elisions.size(), 2);
  EXPECT_EQ(elisions[0].name(), "components[3].name");
  EXPECT_EQ(elisions[0].size(), 1000U);
  EXPECT_EQ(elisions[0].kept(), 10U);
  EXPECT_EQ(elisions[1].name(), "components");
  EXPECT_EQ(elisions[1].size(), 100U);
  EXPECT_EQ(elisions[1].kept(), 5U);
}

TEST(ALongMessage, IsCutBetweenTwoLetters) {
  google::protobuf::StringValue from;
  from.set_value("aäää");
  google::protobuf::StringValue to;
  Elisions elisions;
  copy_elided(from, to, {.bytes = 4}, elisions);
  EXPECT_EQ(to.value(), "aä");
}

TEST(AMessageWithMaps, IsCopiedToo) {
  if (!kHasMaps) {
    GTEST_SKIP() << kNoMaps;
  }
  google::protobuf::Struct from;
  (*from.mutable_fields())["a"].set_number_value(1);
  (*from.mutable_fields())["b"].mutable_struct_value();
  google::protobuf::Struct to;
  Elisions elisions;
  copy_elided(from, to, {}, elisions);
  EXPECT_EQ(to.fields().size(), 2U);
  EXPECT_EQ(to.fields().at("a").number_value(), 1);
}

TEST(AMessageOfManyFields, IsCutAsAWhole) {
  if (!kHasMaps) {
    GTEST_SKIP() << kNoMaps;
  }
  google::protobuf::Struct from;
  google::protobuf::Struct* deep = &from;
  for (int i = 0; i < 200; ++i) {
    deep = (*deep->mutable_fields())["deeper"].mutable_struct_value();
  }
  google::protobuf::Struct to;
  Elisions elisions;
  copy_elided(from, to, {}, elisions);
  EXPECT_FALSE(elisions.empty());
}

}  // namespace
}  // namespace fastcycle::inspect
