#include "dds_gateway/settings.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>

namespace fastcycle::dds_gateway {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<TopicSettings> read(const std::string& json) {
  google::protobuf::ListValue list;
  EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(json, &list).ok());
  return topics_of(list);
}

TEST(Settings, HaveWhatIsSaidAndDefaults) {
  const auto topics = read(R"([
    {"topic": "lidar/cloud", "direction": "in", "ros": "points", "type": "sensor_msgs/PointCloud2",
     "reliability": "best_effort", "durability": "transient_local", "depth": 3, "rate_limit_hz": 10,
     "age_max_ms": 150, "on_error": "degrade"},
    {"topic": "a", "direction": "out", "ros": "/a", "type": "std_msgs/msg/String"}])");

  ASSERT_EQ(topics.size(), 2U);
  EXPECT_EQ(topics[0].ros, "/points");
  EXPECT_EQ(topics[0].type, "sensor_msgs/msg/PointCloud2");
  EXPECT_EQ(topics[0].qos, (Qos{.is_reliable = false, .is_transient_local = true, .depth = 3}));
  EXPECT_EQ(topics[0].age_max, std::chrono::milliseconds(150));
  EXPECT_EQ(topics[0].on_error, OnError::kDegrade);
  EXPECT_FALSE(topics[1].is_in);
  EXPECT_EQ(topics[1].qos, (Qos{.is_reliable = true, .is_transient_local = false, .depth = 10}));
}

TEST(Settings, AllErrorsAreReportedAtOnce) {
  EXPECT_THAT(
      [] {
        read(R"([{"topic": "a", "direction": "up", "ros": "/2", "depth": 0, "qos": 1}, 7,
                 {"topic": "a", "direction": "in", "ros": "/a", "type": "x/Y"},
                 {"topic": "b", "direction": "in", "ros": "a", "type": "x/Y"}])");
      },
      ThrowsMessage<std::invalid_argument>(
          AllOf(HasSubstr("/params/topics/0/direction: expected in or out, found \"up\""),
                HasSubstr("/params/topics/0/type: expected a text, found nothing"),
                HasSubstr("/params/topics/0/ros: expected parts of letters"),
                HasSubstr("/params/topics/0/depth: expected a number from 1 to 100000, found 0"),
                HasSubstr("/params/topics/0/qos: there is no such key"),
                HasSubstr("/params/topics/1: expected an object, found 7"),
                HasSubstr("/params/topics/3/ros: expected a topic that no other entry has"))));
}

std::vector<ParamSettings> read_params_of(const std::string& json) {
  google::protobuf::ListValue list;
  EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(json, &list).ok());
  return parameters_of(list);
}

TEST(Settings, ParametersAreReadAloneUnlessMoreIsSaid) {
  const auto params =
      read_params_of(R"([{"param": "limiter.*"}, {"param": "a/b.c.d", "access": "change"}])");

  ASSERT_EQ(params.size(), 2U);
  EXPECT_EQ(params[0].param, "limiter.*");
  EXPECT_FALSE(params[0].may_change);
  EXPECT_TRUE(params[1].may_change);
}

TEST(Settings, ErrorsInParametersAreReportedAtOnce) {
  EXPECT_THAT(
      [] {
        (void)read_params_of(R"([{"param": "limiter", "access": "write"}, {"param": ".x"},
                                 {"param": "a.b"}, {"param": "a.b"}])");
      },
      ThrowsMessage<std::invalid_argument>(AllOf(
          HasSubstr("/params/parameters/0/access: expected read or change, found \"write\""),
          HasSubstr("/params/parameters/0/param: expected a component and its param"),
          HasSubstr("/params/parameters/1/param: expected a component and its param"),
          HasSubstr("/params/parameters/3/param: expected a param that no other entry has"))));
}

}  // namespace
}  // namespace fastcycle::dds_gateway
