#include "ros2/type_hash.h"

#include <gtest/gtest.h>

#include "ros2/sha256.h"

namespace fastcycle::ros2 {
namespace {

TEST(Sha256, IsThatOfTheStandard) {
  EXPECT_EQ(sha256("abc")[0], std::byte{0xba});
  EXPECT_EQ(sha256("abc")[31], std::byte{0xad});
  EXPECT_EQ(sha256("")[0], std::byte{0xe3});
  EXPECT_EQ(sha256(std::string(1'000'000, 'a'))[0], std::byte{0xcd});
}

// components/ros2_types/samples_test.cc has the hashes of the types that ROS 2 wrote.
TEST(TypeHash, OfATextIsThatOfRos) {
  Definitions definitions;
  definitions.add_text("std_msgs/msg/String", "string data");

  EXPECT_EQ(type_hash(definitions.find("std_msgs/msg/String")),
            "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18");
}

}  // namespace
}  // namespace fastcycle::ros2
