#include "dds_gateway/gateway.h"

#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <variant>

#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "basic/basic.pb.h"
#include "dds_gateway/test_network.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;

/// The gateway on a bench, and what a test asks of it.
class GatewayTest : public ::testing::TestWithParam<const char*> {
 protected:
  /// `topics` is the list of the params.
  void add_gateway(const std::string& topics, const std::string& more = "") {
    bench_.add<Gateway>(
        "gateway",
        fmt::format(R"({{"params": {{"domain": {}, "interface": "lo", "topics": {}{}}}}})",
                    domain_of_test(), topics, more));
  }
  /// Lets time go on until `is_done`; fails after a minute.
  void wait_until(const std::function<bool()>& is_done) {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!is_done()) {
      if (std::chrono::steady_clock::now() > end) {
        FAIL() << "it did not come";
      }
      bench_.advance(10ms);
      std::this_thread::sleep_for(1ms);
    }
  }
  std::int64_t count(const std::string& name) {
    return std::get<std::int64_t>(bench_.result("gateway", name));
  }

  testing::Bench bench_;
};

constexpr const char* kStringThere = "std_msgs::msg::dds_::String_";

TEST_P(GatewayTest, ATextGoesToDdsAndBack) {
  const Peer peer(GetParam(),
                  {"echo", "rt/to_peer", "rt/from_peer", kStringThere, "reliable", "volatile"});
  add_gateway(R"([
    {"topic": "out", "direction": "out", "ros": "/to_peer", "type": "std_msgs/msg/String"},
    {"topic": "in", "direction": "in", "ros": "/from_peer", "type": "std_msgs/msg/String"}])");
  auto out = bench_.input<basic::Text>("out");
  auto in = bench_.output<basic::Text>("in");
  bench_.start();

  basic::Text text;
  text.set_data("hello, ROS");
  std::vector<basic::Text> came;
  wait_until([&] {
    out.publish(text);
    came = in.take();
    return !came.empty();
  });
  bench_.stop();

  EXPECT_EQ(came.front().data(), "hello, ROS");
  EXPECT_GE(count("/to_peer sent"), 1);
  EXPECT_GE(count("/from_peer published"), 1);
}

INSTANTIATE_TEST_SUITE_P(Engines, GatewayTest, ::testing::Values("cyclone"),
                         [](const auto& engine) { return std::string(engine.param); });

}  // namespace
}  // namespace fastcycle::dds_gateway
