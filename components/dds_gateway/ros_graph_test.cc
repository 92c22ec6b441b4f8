#include "dds_gateway/ros_graph.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "ros2/cdr.h"

namespace fastcycle::dds_gateway {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<std::byte> read_file(const std::string& name) {
  std::ifstream stream(std::string(FASTCYCLE_TEST_DATA) + "/" + name, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const auto* const begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

class RealNode : public ::testing::TestWithParam<const char*> {};

TEST_P(RealNode, IsReadAndWrittenAsItIs) {
  const auto bytes = read_file(
      fmt::format("discovery/rmw_dds_common__ParticipantEntitiesInfo__real_{}.cdr", GetParam()));
  ASSERT_GT(bytes.size(), 600U);
  Guid participant{};

  const std::vector<NodeEntities> nodes = read_graph(bytes, participant);

  ASSERT_EQ(nodes.size(), 1U);
  EXPECT_EQ(nodes[0].name_space, "/robot");
  EXPECT_EQ(nodes[0].name, "qos_node");
  EXPECT_EQ(nodes[0].readers.size(), 17U);
  EXPECT_EQ(nodes[0].writers.size(), 20U);
  ros2::Buffer written;
  write_graph(participant, nodes, written);
  EXPECT_TRUE(std::ranges::equal(written.bytes(), std::span(bytes)));
  RosGraph graph;
  graph.take(bytes);
  EXPECT_EQ(graph.node_of(nodes[0].writers[3]), "/robot/qos_node");
  graph.forget(participant);
  EXPECT_EQ(graph.node_of(nodes[0].writers[3]), "");
}

INSTANTIATE_TEST_SUITE_P(Middlewares, RealNode,
                         ::testing::Values("rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"));

TEST(RosGraph, LengthsThatLieAreErrors) {
  ros2::Buffer message;
  write_graph({}, {{.name_space = "/", .name = "a", .readers = {}, .writers = {}}}, message);
  const std::size_t count_at = 4 + 16;
  message.data()[count_at + 3] = std::byte{0x7f};
  RosGraph graph;

  EXPECT_THAT([&] { graph.take(message.bytes()); },
              ThrowsMessage<ros2::CdrError>(HasSubstr("node_entities_info_seq: expected")));
}

TEST(RosGraph, KeepsNoMoreThanIsBoundedWhateverComes) {
  RosGraph graph;
  const auto take = [&](std::uint8_t participant, std::size_t readers) {
    Guid guid{};
    guid[0] = participant;
    NodeEntities node;
    node.name = fmt::format("node{}", participant);
    node.readers.assign(readers, guid);
    ros2::Buffer message;
    write_graph(guid, {node}, message);
    graph.take(message.bytes());
    return graph.node_of(guid);
  };

  EXPECT_EQ(take(1, 60'000), "/node1");
  EXPECT_EQ(take(2, 10'000), "");  // There is no room for it.
  EXPECT_EQ(take(1, 10), "/node1");
  EXPECT_EQ(take(2, 10'000), "/node2");
}

}  // namespace
}  // namespace fastcycle::dds_gateway
