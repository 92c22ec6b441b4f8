// What nodes of ROS 2 Jazzy wrote, with both of its middlewares (tests/data/ros2/README.md): each
// type's hash, each message's bytes and content, in both directions.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "ros2/json_form.h"
#include "ros2/names.h"
#include "ros2/type_hash.h"
#include "ros2_types/known_types.h"

namespace fastcycle::ros2 {
namespace {

using Json = nlohmann::ordered_json;

const std::filesystem::path kFolder = FASTCYCLE_TEST_DATA;

std::vector<std::byte> read(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const auto* const begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

const Json& samples() {
  static const Json kSamples = [] {
    std::ifstream stream(kFolder / "samples.json");
    return Json::parse(stream)["samples"];
  }();
  return kSamples;
}

/// Whether two messages are the same but for what fills them up.
bool is_same(std::span<const std::byte> written, std::span<const std::byte> found,
             const Json& sample, std::size_t data_end) {
  if (written.size() < data_end || found.size() < data_end) {
    return false;
  }
  const auto padding = sample["padding_offsets"].get<std::set<std::size_t>>();
  for (std::size_t i = 0; i < data_end; ++i) {
    if (written[i] != found[i] && !padding.contains(i)) {
      return false;
    }
  }
  return true;
}

/// The same message in the other order of bytes, made by reading and writing its numbers.
template <typename F>
void for_each_file(F f) {
  for (const Json& sample : samples()) {
    for (const Json& file : sample["files"]) {
      SCOPED_TRACE(file["file"].get<std::string>());
      f(sample, file, read(kFolder / file["file"].get<std::string>()));
    }
  }
}

TEST(Samples, HaveTheHashesAndNamesThatRosGaveTheirTypes) {
  KnownTypes types;
  ASSERT_EQ(samples().size(), 49U);

  for (const Json& sample : samples()) {
    const Definition& type = types.definitions().find(sample["type"].get<std::string>());
    EXPECT_EQ(type_hash(type), sample["type_hash"].get<std::string>()) << type.name;
    EXPECT_EQ(dds_type(type.name), sample["dds_type"].get<std::string>());
    EXPECT_EQ(ros_type(sample["dds_type"].get<std::string>()), type.name);
  }
}

TEST(Samples, AreReadAsWhatTheyHold) {
  KnownTypes types;

  for_each_file([&](const Json& sample, const Json& /*file*/, const std::vector<std::byte>& bytes) {
    const Definition& type = types.definitions().find(sample["type"].get<std::string>());
    EXPECT_EQ(to_json(type, bytes), sample["content"]);
  });
}

TEST(Samples, AreWrittenByteByByte) {
  KnownTypes types;

  for_each_file([&](const Json& sample, const Json& file, const std::vector<std::byte>& bytes) {
    const Definition& type = types.definitions().find(sample["type"].get<std::string>());
    Buffer written;
    from_json(type, sample["content"], written);
    EXPECT_EQ(written.size(), file["data_end"].get<std::size_t>());
    EXPECT_TRUE(is_same(written.bytes(), bytes, sample, file["data_end"].get<std::size_t>()));
  });
}

TEST(Samples, ThatAreCutOffAnywhereAreErrors) {
  KnownTypes types;

  for_each_file([&](const Json& sample, const Json& file, const std::vector<std::byte>& bytes) {
    const Definition& type = types.definitions().find(sample["type"].get<std::string>());
    const auto end = file["data_end"].get<std::size_t>();
    for (std::size_t size = 0; size < std::min<std::size_t>(end, 400); ++size) {
      EXPECT_THROW((void)to_json(type, std::span(bytes).first(size)), CdrError) << size;
    }
  });
}

/// Types whose messages of ours have a place for all that the samples hold: the bytes come back.
const std::set<std::string> kWhole = {"std_msgs/msg/String",
                                      "std_msgs/msg/Bool",
                                      "std_msgs/msg/Float64",
                                      "std_msgs/msg/Header",
                                      "rosgraph_msgs/msg/Clock",
                                      "sensor_msgs/msg/NavSatFix",
                                      "nav_msgs/msg/Odometry",
                                      "nav_msgs/msg/OccupancyGrid",
                                      "geometry_msgs/msg/PoseStamped",
                                      "geometry_msgs/msg/TwistStamped",
                                      "geometry_msgs/msg/TransformStamped",
                                      "tf2_msgs/msg/TFMessage",
                                      "diagnostic_msgs/msg/DiagnosticArray",
                                      "std_srvs/srv/SetBool_Request",
                                      "std_srvs/srv/SetBool_Response"};

TEST(Samples, ComeBackFromOurMessages) {
  KnownTypes types;
  std::set<std::string> mapped;
  for_each_file([&](const Json& sample, const Json& file, const std::vector<std::byte>& bytes) {
    const auto type = sample["type"].get<std::string>();
    const Converter* const converter = types.try_find(type);
    if (converter == nullptr) {
      return;
    }
    mapped.insert(type);
    const std::unique_ptr<google::protobuf::Message> ours(converter->prototype().New());
    const std::unique_ptr<google::protobuf::Message> again(converter->prototype().New());
    Buffer written;

    converter->to_message(bytes, *ours);
    converter->to_ros(*ours, written);
    converter->to_message(written.bytes(), *again);

    google::protobuf::util::MessageDifferencer differencer;
    google::protobuf::util::DefaultFieldComparator comparator;
    comparator.set_treat_nan_as_equal(true);
    comparator.set_float_comparison(google::protobuf::util::DefaultFieldComparator::APPROXIMATE);
    differencer.set_field_comparator(&comparator);
    EXPECT_TRUE(differencer.Compare(*ours, *again)) << ours->ShortDebugString() << "\n"
                                                    << again->ShortDebugString();
    EXPECT_EQ(written.size() % 4, 0U);
    if (kWhole.contains(type)) {
      EXPECT_TRUE(is_same(written.bytes(), bytes, sample, file["data_end"].get<std::size_t>()));
    }
  });
  EXPECT_EQ(mapped.size(), 23U);
}

}  // namespace
}  // namespace fastcycle::ros2
