#include "dds_gateway/request_header.h"

#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "ros2/cdr.h"
#include "ros2/json_form.h"
#include "ros2_types/known_types.h"

namespace fastcycle::dds_gateway {
namespace {

std::vector<std::byte> from_hex(const std::string& text) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    bytes.push_back(static_cast<std::byte>(std::stoul(text.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

// Three calls of a real service with ROS 2's middleware over Cyclone DDS.
TEST(RequestHeader, IsTakenOffRealRequestsAndRepliesAndPutBack) {
  std::ifstream file(std::string(FASTCYCLE_TEST_DATA) +
                     "/services/set_bool_rmw_cyclonedds_cpp.json");
  const auto samples = nlohmann::json::parse(file)["samples"];
  ASSERT_EQ(samples.size(), 6U);
  ros2::KnownTypes types;

  for (const auto& sample : samples) {
    const auto bytes = from_hex(sample["payload_hex"].get<std::string>());
    const bool is_request = sample["kind"] == "request";
    Identity request;

    const ros2::Buffer message = without_request_header(bytes, request);

    EXPECT_GE(request.number, 1);
    EXPECT_LE(request.number, 3);
    const auto content =
        ros2::to_json(types.definitions().find(is_request ? "std_srvs/srv/SetBool_Request"
                                                          : "std_srvs/srv/SetBool_Response"),
                      message.bytes());
    EXPECT_TRUE(content.contains(is_request ? "data" : "success"));
    const ros2::Buffer back = with_request_header(message.bytes(), request);
    EXPECT_TRUE(std::ranges::equal(back.bytes(), std::span(bytes)));
  }
}

TEST(RequestHeader, ThatIsCutOffIsAnError) {
  const auto bytes = from_hex("00010000010203040506070801000000");
  Identity request;

  EXPECT_THROW((void)without_request_header(bytes, request), ros2::CdrError);
}

}  // namespace
}  // namespace fastcycle::dds_gateway
