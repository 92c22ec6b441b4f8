#include "record/schema_difference.h"

#include <string>

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include "log/log.pb.h"
#include "record/descriptor_set.h"

namespace fastcycle::record {
namespace {

using google::protobuf::DescriptorProto;
using google::protobuf::FileDescriptorSet;
using testing::HasSubstr;

/// The schema of `log::MessageInfos` as it would stand in a file of another time.
class Schemas : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(set_.ParseFromString(descriptor_set_of(*log::MessageInfos::descriptor())));
  }

  DescriptorProto& message(const std::string& name) {
    for (DescriptorProto& message : *set_.mutable_file(0)->mutable_message_type()) {
      if (message.name() == name) {
        return message;
      }
    }
    throw std::runtime_error("no message " + name);
  }

  [[nodiscard]] std::string difference() const {
    return schema_difference(set_.SerializeAsString(), *log::MessageInfos::descriptor());
  }

  FileDescriptorSet set_;
};

TEST_F(Schemas, TheSameTypeHasNoDifference) {
  EXPECT_EQ(difference(), "");
}

TEST_F(Schemas, OtherMessagesOfTheFileMayDiffer) {
  message("Activation").mutable_field()->RemoveLast();
  EXPECT_EQ(difference(), "");
}

TEST_F(Schemas, AFieldOfAnotherTypeIsFoundWithinMessages) {
  message("MessageInfo")
      .mutable_field(0)
      ->set_type(google::protobuf::FieldDescriptorProto::TYPE_STRING);
  EXPECT_EQ(difference(),
            "field fastcycle.log.MessageInfo.channel = 1 is uint32, and was string when it was "
            "recorded");
}

TEST_F(Schemas, ARenamedFieldIsFound) {
  message("MessageInfo").mutable_field(0)->set_name("canal");
  EXPECT_THAT(difference(), HasSubstr("channel = 1 was called canal"));
}

TEST_F(Schemas, AFieldThatIsNewAndOneThatIsGoneAreFound) {
  message("MessageInfo").mutable_field(4)->set_number(99);
  EXPECT_THAT(difference(), HasSubstr("held = 99 (bool) of the recording no longer exists"));
  message("MessageInfo").mutable_field()->DeleteSubrange(4, 1);
  EXPECT_THAT(difference(), HasSubstr("held = 5 (bool) is not in the recording"));
}

TEST_F(Schemas, ASchemaThatIsNoneIsADifference) {
  EXPECT_THAT(schema_difference("\xff\xff", *log::MessageInfos::descriptor()),
              HasSubstr("cannot be read"));
  set_.mutable_file(0)->mutable_message_type()->Clear();
  EXPECT_THAT(difference(), HasSubstr("does not define fastcycle.log.MessageInfos"));
}

}  // namespace
}  // namespace fastcycle::record
