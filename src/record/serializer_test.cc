#include "record/serializer.h"

#include <string>
#include <string_view>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/version.h"
#include "record/descriptor_set.h"

namespace fastcycle::record {
namespace {

std::string joined(std::span<const mcap::Bytes> parts) {
  std::string all;
  for (const mcap::Bytes& part : parts) {
    all += mcap::text_of(part);
  }
  return all;
}

TEST(Serializer, GivesTheBytesThatProtobufGives) {
  Serializer serializer;
  for (const std::size_t size : {0UL, 1UL, 100UL, 511UL, 512UL, 513UL, 5'000UL, 4'000'000UL}) {
    google::protobuf::BytesValue message;
    message.set_value(std::string(size, 'x'));
    EXPECT_EQ(joined(serializer.serialize(message)), message.SerializeAsString()) << size;
    EXPECT_EQ(serializer.size(), message.ByteSizeLong());
  }
  google::protobuf::FileDescriptorProto many;
  many.set_name("demo/many.proto");
  for (int i = 0; i < 1000; ++i) {
    many.add_message_type()->set_name("Message" + std::to_string(i));
  }
  EXPECT_EQ(joined(serializer.serialize(many)), many.SerializeAsString());
}

TEST(Serializer, OrdersTheEntriesOfMaps) {
  // In a program for the thread sanitizer protobuf's headers lay out maps in another way than the
  // system's library (map_field.h): no map of its types can be touched.
  if (std::string_view(FASTCYCLE_SANITIZER) == "thread") {
    GTEST_SKIP() << "the system's protobuf has other maps than the thread sanitizer's";
  }
  // Entries lie where their object has them; what is written must not show it.
  google::protobuf::Struct first;
  google::protobuf::Struct second;
  for (int i = 0; i < 100; ++i) {
    (*first.mutable_fields())[std::to_string(i)].set_number_value(i);
    (*second.mutable_fields())[std::to_string(99 - i)].set_number_value(99 - i);
  }
  Serializer serializer;
  const std::string bytes = joined(serializer.serialize(first));
  EXPECT_EQ(joined(serializer.serialize(second)), bytes);
  google::protobuf::Struct again;
  ASSERT_TRUE(again.ParseFromString(bytes));
  EXPECT_EQ(again.fields_size(), 100);
}

TEST(Serializer, CopiesNoLargeField) {
  google::protobuf::BytesValue image;
  image.set_value(std::string(1'000'000, 'x'));
  Serializer serializer;
  bool is_borrowed = false;
  for (const mcap::Bytes& part : serializer.serialize(image)) {
    is_borrowed |= reinterpret_cast<const char*>(part.data()) == image.value().data() &&
                   part.size() == image.value().size();
  }
  EXPECT_TRUE(is_borrowed);
}

TEST(DescriptorSet, HasAllThatATypeNeedsAfterWhatThatNeeds) {
  google::protobuf::FileDescriptorSet set;
  ASSERT_TRUE(
      set.ParseFromString(descriptor_set_of(*google::protobuf::FileDescriptorSet::descriptor())));
  ASSERT_EQ(set.file_size(), 1);

  google::protobuf::DescriptorPool elsewhere;
  for (const auto& file : set.file()) {
    ASSERT_NE(elsewhere.BuildFile(file), nullptr);
  }
  EXPECT_NE(elsewhere.FindMessageTypeByName("google.protobuf.FileDescriptorSet"), nullptr);
}

}  // namespace
}  // namespace fastcycle::record
