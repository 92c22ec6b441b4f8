// What docs/guides/beside_ros2.md shows.
#include <filesystem>
#include <fstream>

#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "dds_gateway/gateway.h"
#include "demo/speed.pb.h"
#include "foxglove/point_cloud.pb.h"
#include "foxglove/pose.pb.h"

namespace {

using fastcycle::dds_gateway::Gateway;
using nlohmann::json;

constexpr const char* kOverlay = R"(
{
  "executors": [{"name": "gateway", "threads": 1}],
  "components": [
    {"name": "gateway", "library": "dds_gateway", "executor": "gateway",
     "params": {
       "domain": 0,
       "topics": [
         {"topic": "lidar/cloud", "direction": "in", "ros": "/points", "type": "sensor_msgs/msg/PointCloud2",
          "reliability": "best_effort"},
         {"topic": "localization/odometry", "direction": "out", "ros": "/odom", "type": "nav_msgs/msg/Odometry"}
       ]}}
  ]
}
)";

constexpr const char* kOwnTypes = R"(
{"params": {
   "definitions": ["interfaces"],
   "topics": [{"topic": "speed", "direction": "in", "ros": "/speed", "type": "demo_msgs/msg/Speed",
               "message": "demo.Speed"}]}}
)";

/// Loopback is there on every machine.
json with_loopback(json params) {
  params["interface"] = "lo";
  params["domain"] = 10 + getpid() % 200;
  return {{"params", params}};
}

TEST(TheGuideToRos2, ItsOverlayIsAGateway) {
  const json overlay = json::parse(kOverlay);
  fastcycle::testing::Bench bench;
  bench.add<Gateway>("gateway", with_loopback(overlay["components"][0]["params"]).dump());
  auto odometry = bench.input<foxglove::Odometry>("localization/odometry");
  auto clouds = bench.output<foxglove::PointCloud>("lidar/cloud");
  bench.start();

  odometry.publish({});
  bench.stop();

  EXPECT_EQ(std::get<std::int64_t>(bench.result("gateway", "/odom sent")), 1);
  EXPECT_EQ(std::get<std::int64_t>(bench.result("gateway", "/points received")), 0);
}

TEST(TheGuideToRos2, TypesOfOnesOwnComeFromAFolder) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / fmt::format("interfaces_{}", getpid());
  std::filesystem::create_directories(folder / "demo_msgs/msg");
  std::ofstream(folder / "demo_msgs/msg/Speed.msg") << "float64 mps\n";
  json params = json::parse(kOwnTypes)["params"];
  params["definitions"] = {folder.string()};
  fastcycle::testing::Bench bench;
  bench.add<Gateway>("gateway", with_loopback(params).dump());
  auto speeds = bench.output<demo::Speed>("speed");

  EXPECT_NO_THROW(bench.start());

  bench.stop();
  std::filesystem::remove_all(folder);
}

}  // namespace
