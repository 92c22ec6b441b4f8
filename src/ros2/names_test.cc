#include "ros2/names.h"

#include <gtest/gtest.h>

namespace fastcycle::ros2 {
namespace {

TEST(Names, OfTopicsServicesAndTypesAreThoseOfRos) {
  EXPECT_EQ(dds_topic("/a/b"), "rt/a/b");
  EXPECT_EQ(dds_topic("a"), "rt/a");
  EXPECT_EQ(dds_request_topic("/s"), "rq/sRequest");
  EXPECT_EQ(dds_reply_topic("/s"), "rr/sReply");
  EXPECT_EQ(ros_topic("rt/a/b"), "/a/b");
  EXPECT_EQ(ros_topic("rq/sRequest"), std::nullopt);
  EXPECT_EQ(dds_type("std_srvs/srv/SetBool_Request"), "std_srvs::srv::dds_::SetBool_Request_");
  EXPECT_EQ(ros_type("std_msgs::msg::dds_::String_"), "std_msgs/msg/String");
  EXPECT_EQ(ros_type("String"), std::nullopt);
}

TEST(Names, OfWhatIsNoneAreReported) {
  EXPECT_EQ(ros_name_error("/lidar/points_2"), std::nullopt);
  EXPECT_TRUE(ros_name_error("/lidar//points"));
  EXPECT_TRUE(ros_name_error("/2points"));
  EXPECT_TRUE(ros_name_error("points/"));
  EXPECT_TRUE(ros_name_error(""));
}

TEST(Names, UserDataHasItsValues) {
  EXPECT_EQ(value_of("enclave=/;", "enclave"), "/");
  EXPECT_EQ(value_of("clientid= 1.2;typehash=RIHS01_ab;", "typehash"), "RIHS01_ab");
  EXPECT_EQ(value_of("typehash", "typehash"), "");
  EXPECT_EQ(value_of("", "typehash"), "");
}

}  // namespace
}  // namespace fastcycle::ros2
