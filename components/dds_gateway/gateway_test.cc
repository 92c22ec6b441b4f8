#include "dds_gateway/gateway.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <variant>

#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>

#include "basic/basic.pb.h"
#include "dds_gateway/envelope.h"
#include "dds_gateway/test_network.h"
#include "foxglove/image.pb.h"
#include "foxglove/location.pb.h"
#include "foxglove/point_cloud.pb.h"
#include "foxglove/pose.pb.h"
#include "motion/motion.pb.h"
#include "ros2/names.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr const char* kString = "std_msgs/msg/String";
constexpr const char* kStringThere = "std_msgs::msg::dds_::String_";

/// The engine of the gateway, and that of the other process.
using Engines = std::pair<const char*, const char*>;

/// The gateway on a bench, and what a test asks of it.
class GatewayTest : public ::testing::TestWithParam<Engines> {
 protected:
  static std::string other_engine() { return GetParam().second; }

  /// `topics` is the list of the params.
  void add_gateway(const std::string& topics, const std::string& more = "") {
    bench_.add<Gateway>(
        "gateway",
        fmt::format(
            R"({{"params": {{"engine": "{}", "domain": {}, "interface": "lo", "topics": {}{}}}}})",
            GetParam().first, domain_of_test(), topics, more));
  }
  static std::string topic(const std::string& name, const std::string& direction,
                           const std::string& ros, const std::string& type,
                           const std::string& more = "") {
    return fmt::format(R"({{"topic": "{}", "direction": "{}", "ros": "{}", "type": "{}"{}}})", name,
                       direction, ros, type, more);
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
  /// What the gateway says of its health.
  std::string trouble() { return std::get<std::string>(bench_.result("gateway", "trouble")); }
  std::int64_t count(const std::string& name) {
    return std::get<std::int64_t>(bench_.result("gateway", name));
  }

  /// Sends `message` `times` times to a process that sends it back, at most `window` under way.
  template <typename T>
  void send_and_get_back(const T& message, const std::string& type, int times, int window) {
    const std::string there = ros2::dds_type(type);
    const Peer peer(other_engine(),
                    {"echo", "rt/to_peer", "rt/from_peer", there, "reliable", "volatile"});
    add_gateway(fmt::format("[{}, {}]", topic("out", "out", "/to_peer", type, R"(, "depth": 1000)"),
                            topic("in", "in", "/from_peer", type, R"(, "depth": 1000)")));
    auto out = bench_.input<T>("out");
    auto in = bench_.output<T>("in");
    bench_.start();
    // Until both have found each other, messages may go nowhere: the first is sent until it is
    // back, then what is under way.
    T last = message;
    int sent = 0;
    int back = 0;
    std::vector<T> came;
    int turn = 0;
    wait_until([&] {
      if (turn++ % 20 == 0) {
        out.publish(message);
        ++sent;
      }
      came = in.take();
      back += static_cast<int>(came.size());
      return !came.empty();
    });
    for (int quiet = 0; quiet < 300; ++quiet) {
      bench_.advance(1ms);
      std::this_thread::sleep_for(1ms);
      const std::size_t more = in.take().size();
      back += static_cast<int>(more);
      quiet = more > 0 ? 0 : quiet;
    }

    const int before_sent = sent;
    const int before_back = back;
    wait_until([&] {
      while (sent - before_sent < times && sent - before_sent - (back - before_back) < window) {
        out.publish(message);
        ++sent;
      }
      for (T& one : in.take()) {
        ++back;
        last = std::move(one);
      }
      return back - before_back >= times;
    });
    bench_.stop();

    EXPECT_GE(back - before_back, times) << sent << " sent, " << before_sent << " before, " << back
                                         << " back, " << before_back << " before";
    EXPECT_EQ(count("/from_peer lost"), 0);
    EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(last, message));
    EXPECT_EQ(count("/to_peer sent"), sent);
    EXPECT_GE(count("/from_peer published"), back);  // One of the first may still be under way.
  }

  testing::Bench bench_;
};

void set_time(google::protobuf::Timestamp& time) {
  time.set_seconds(1'700'000'000);
  time.set_nanos(123'456'789);
}

TEST_P(GatewayTest, AThousandTextsGoToDdsAndBack) {
  basic::Text text;
  text.set_data("hello, ROS");
  send_and_get_back(text, kString, 1000, 50);
}

TEST_P(GatewayTest, CloudsOfAMegabyteGoToDdsAndBack) {
  foxglove::PointCloud cloud;
  set_time(*cloud.mutable_timestamp());
  cloud.set_frame_id("lidar");
  cloud.mutable_pose()->mutable_position();
  cloud.mutable_pose()->mutable_orientation()->set_w(1.0);
  cloud.set_point_stride(16);
  for (const char* const name : {"x", "y", "z", "intensity"}) {
    foxglove::PackedElementField& field = *cloud.add_fields();
    field.set_name(name);
    field.set_offset(static_cast<std::uint32_t>(cloud.fields_size() - 1) * 4);
    field.set_type(foxglove::PackedElementField::FLOAT32);
  }
  cloud.mutable_data()->resize(1 << 20);
  for (std::size_t i = 0; i < cloud.data().size(); ++i) {
    (*cloud.mutable_data())[i] = static_cast<char>(i * 7);
  }
  send_and_get_back(cloud, "sensor_msgs/msg/PointCloud2", 50, 4);
}

TEST_P(GatewayTest, PicturesOfSixMegabytesGoToDdsAndBack) {
  foxglove::RawImage image;
  set_time(*image.mutable_timestamp());
  image.set_frame_id("camera");
  image.set_width(1920);
  image.set_height(1080);
  image.set_step(1920 * 3);
  image.set_encoding("rgb8");
  image.mutable_data()->resize(std::size_t{1920} * 1080 * 3, 'x');
  send_and_get_back(image, "sensor_msgs/msg/Image", 10, 2);
}

TEST_P(GatewayTest, OdometryGoesToDdsAndBack) {
  foxglove::Odometry odometry;
  set_time(*odometry.mutable_timestamp());
  odometry.set_frame_id("odom");
  odometry.set_child_frame_id("base_link");
  odometry.mutable_pose()->mutable_position()->set_x(1.25);
  odometry.mutable_pose()->mutable_orientation()->set_w(1.0);
  odometry.mutable_linear_velocity()->set_x(13.9);
  odometry.mutable_angular_velocity()->set_z(0.1);
  for (int i = 0; i < 36; ++i) {
    odometry.add_pose_covariance(i * 0.5);
    odometry.add_velocity_covariance(i * 0.25);
  }
  send_and_get_back(odometry, "nav_msgs/msg/Odometry", 1000, 50);
}

TEST_P(GatewayTest, ImuGoesToDdsAndBack) {
  motion::Imu imu;
  imu.mutable_header()->set_taken_ns(1'700'000'000'123'456'789);
  imu.mutable_header()->set_frame("imu");
  imu.mutable_angular_rate_radps()->set_z(0.25);
  imu.mutable_acceleration_mps2()->set_z(9.81);
  for (int i = 0; i < 9; ++i) {
    imu.add_angular_rate_covariance(0.01 * i);
    imu.add_acceleration_covariance(0.02 * i);
  }
  send_and_get_back(imu, "sensor_msgs/msg/Imu", 1000, 50);
}

TEST_P(GatewayTest, FixesGoToDdsAndBack) {
  foxglove::LocationFix fix;
  set_time(*fix.mutable_timestamp());
  fix.set_frame_id("gnss");
  fix.set_latitude(49.6);
  fix.set_longitude(6.1);
  fix.set_altitude(300.0);
  fix.set_position_covariance_type(foxglove::LocationFix::DIAGONAL_KNOWN);
  for (const auto& [key, value] : {std::pair{"status", "2"}, {"service", "1"}}) {
    fix.add_metadata()->set_key(key);
    fix.mutable_metadata(fix.metadata_size() - 1)->set_value(value);
  }
  for (int i = 0; i < 9; ++i) {
    fix.add_position_covariance(i);
  }
  send_and_get_back(fix, "sensor_msgs/msg/NavSatFix", 1000, 50);
}

TEST_P(GatewayTest, TransformsGoToDdsAndBack) {
  foxglove::FrameTransforms transforms;
  for (const char* const child : {"lidar", "camera"}) {
    foxglove::FrameTransform& transform = *transforms.add_transforms();
    set_time(*transform.mutable_timestamp());
    transform.set_parent_frame_id("base_link");
    transform.set_child_frame_id(child);
    transform.mutable_translation()->set_z(1.8);
    transform.mutable_rotation()->set_w(1.0);
  }
  send_and_get_back(transforms, "tf2_msgs/msg/TFMessage", 1000, 50);
}

TEST_P(GatewayTest, QualitiesThatDoNotMatchAreReportedWithBothValues) {
  const Peer peer(other_engine(),
                  {"echo", "rt/unused", "rt/speed", kStringThere, "best_effort", "volatile"});
  add_gateway(fmt::format("[{}]", topic("speed", "in", "/speed", kString)));
  auto in = bench_.output<basic::Text>("speed");
  std::string trouble;
  bench_.start();

  wait_until([&] {
    trouble = this->trouble();
    return !trouble.empty();
  });

  EXPECT_THAT(trouble,
              AllOf(HasSubstr("/speed: no message passes between the gateway and "),
                    HasSubstr("the reader asks for reliable, the writer offers best effort"),
                    HasSubstr("(here reliable, volatile, there best effort, volatile)")));
}

TEST_P(GatewayTest, TypesThatDifferAreReported) {
  const Peer peer(other_engine(), {"echo", "rt/unused", "rt/speed", "std_msgs::msg::dds_::Int8_",
                                   "reliable", "volatile"});
  add_gateway(fmt::format("[{}]", topic("speed", "in", "/speed", kString)));
  auto in = bench_.output<basic::Text>("speed");
  bench_.start();

  wait_until([&] { return !trouble().empty(); });

  EXPECT_THAT(trouble(), AllOf(HasSubstr("has it with type std_msgs/msg/Int8"),
                               HasSubstr("here it is std_msgs/msg/String")));
}

TEST_P(GatewayTest, BytesThatAreNoMessageAreCountedAndReported) {
  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / fmt::format("gateway_{}.cdr", getpid());
  std::ofstream(file, std::ios::binary) << std::string(
      "\0\1\0\0\xff\xff\xff\x7f"
      "abcd",
      12);
  add_gateway(fmt::format(
      "[{}]", topic("text", "in", "/text", kString, R"(, "on_error": "degrade", "depth": 1000)")));
  auto in = bench_.output<basic::Text>("text");
  bench_.start();
  const Peer peer(other_engine(),
                  {"send", "rt/text", kStringThere, "reliable", "volatile", "100", file.string()});

  wait_until([&] { return !trouble().empty(); });
  EXPECT_TRUE(in.take().empty());
  bench_.stop();

  EXPECT_THAT(trouble(), HasSubstr("/text: std_msgs/msg/String: byte 8: data: expected 2147483647 "
                                   "elements of 1 bytes, found 4 bytes"));
  EXPECT_GE(count("/text refused"), 1);
  EXPECT_EQ(count("/text published"), 0);
  std::filesystem::remove(file);
}

TEST_P(GatewayTest, WhatCameInDoesNotGoOutAgain) {
  const Peer peer(other_engine(),
                  {"echo", "rt/to_peer", "rt/chatter", kStringThere, "reliable", "volatile"});
  add_gateway(fmt::format("[{}, {}, {}]", topic("chatter", "in", "/chatter", kString),
                          topic("chatter", "out", "/chatter", kString),
                          topic("begin", "out", "/to_peer", kString)));
  auto begin = bench_.input<basic::Text>("begin");
  auto chatter = bench_.output<basic::Text>("chatter");
  bench_.start();
  basic::Text text;
  text.set_data("once");

  std::size_t came = 0;
  wait_until([&] {
    begin.publish(text);
    came += chatter.take().size();
    return came > 3;
  });
  bench_.stop();

  EXPECT_EQ(count("/chatter sent"), 0);
  EXPECT_GE(count("/chatter own"), 3);
}

TEST_P(GatewayTest, RatesAreLimitedAndOldMessagesExpire) {
  const Peer peer(other_engine(),
                  {"echo", "rt/unused", "rt/unused_too", kStringThere, "reliable", "volatile"});
  add_gateway(fmt::format("[{}, {}]",
                          topic("fast", "out", "/fast", kString, R"(, "rate_limit_hz": 10)"),
                          topic("old", "out", "/old", kString, R"(, "age_max_ms": 50)")));
  auto fast = bench_.input<basic::Text>("fast");
  auto old = bench_.input<basic::Text>("old");
  bench_.start();
  const basic::Text text;

  for (int i = 0; i < 100; ++i) {
    fast.publish(text);
    old.publish(text, {.taken_at = bench_.now() - (i < 30 ? 60ms : 40ms)});
    bench_.advance(10ms);
  }
  bench_.stop();

  EXPECT_EQ(count("/fast sent"), 10);
  EXPECT_EQ(count("/fast limited"), 90);
  EXPECT_EQ(count("/old sent"), 70);
  EXPECT_EQ(count("/old expired"), 30);
}

TEST_P(GatewayTest, IsANodeWithItsTopicsAndTheirHashes) {
  add_gateway(fmt::format("[{}, {}]", topic("out", "out", "/robot/out", kString),
                          topic("in", "in", "/robot/in", kString)),
              R"(, "node": "/car/gate", "clock_period_ms": 100)");
  auto out = bench_.input<basic::Text>("out");
  bench_.start();
  const auto engine =
      std::ranges::find_if(engines(), [](const Engine& one) { return one.name == other_engine(); });
  const auto participant = engine->create(
      {.domain = domain_of_test(), .interface = "lo", .user_data = "", .security = ""});
  RosGraph graph;
  const auto reader = participant->create_reader(
      graph_endpoint(true),
      [&](std::span<const std::byte> message, const SampleInfo& /*info*/) { graph.take(message); });
  std::map<std::string, Discovery> seen;

  wait_until([&] {
    participant->serve(1ms);
    for (Discovery& discovery : participant->discoveries()) {
      if (discovery.kind == Discovery::Kind::kEndpoint) {
        seen[discovery.endpoint.topic] = std::move(discovery);
      } else {
        seen[discovery.endpoint.user_data] = std::move(discovery);
      }
    }
    return seen.contains("rt/robot/out") && seen.contains("rt/robot/in") &&
           seen.contains("rt/clock") && !graph.node_of(seen["rt/robot/out"].guid).empty();
  });

  for (const char* const topic : {"rt/robot/out", "rt/robot/in", "rt/clock"}) {
    EXPECT_EQ(graph.node_of(seen[topic].guid), "/car/gate") << topic;
  }
  EXPECT_EQ(seen["rt/robot/out"].endpoint.type, kStringThere);
  EXPECT_EQ(seen["rt/robot/out"].endpoint.user_data,
            "typehash=RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18;");
  EXPECT_TRUE(seen["rt/robot/in"].endpoint.is_reader);
  EXPECT_EQ(seen["ros_discovery_info"].endpoint.user_data,
            "typehash=RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e;");
  EXPECT_TRUE(seen.contains("enclave=/;"));
}

TEST(TheConfigurationOfCyclone, MaySelectTheInterfaceToo) {
  const auto cyclone = std::ranges::find_if(
      engines(), [](const Engine& one) { return one.name == std::string("cyclone"); });
  if (cyclone == engines().end()) {
    GTEST_SKIP() << "built without Cyclone DDS";
  }
  const char* const set = std::getenv("CYCLONEDDS_URI");
  const std::string before = set == nullptr ? "" : set;
  setenv("CYCLONEDDS_URI",
         R"(<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="lo"/>)"
         R"(</Interfaces><AllowMulticast>false</AllowMulticast></General></Domain></CycloneDDS>)",
         1);
  ParticipantOptions options{
      .domain = domain_of_test(), .interface = "lo", .user_data = "", .security = ""};

  EXPECT_NE(cyclone->create(options), nullptr);
  options.interface = "eth7";
  EXPECT_THAT([&] { (void)cyclone->create(options); },
              ThrowsMessage<EngineError>(HasSubstr("CYCLONEDDS_URI selects network interfaces")));

  setenv("CYCLONEDDS_URI", before.c_str(), 1);
}

TEST_P(GatewayTest, WhoComesLateGetsWhatIsKept) {
  add_gateway(fmt::format("[{}]", topic("map", "out", "/map", kString,
                                        R"(, "durability": "transient_local", "depth": 1)")));
  auto map = bench_.input<basic::Text>("map");
  bench_.start();
  basic::Text text;
  text.set_data("first");
  map.publish(text);
  text.set_data("second");
  map.publish(text);
  const auto engine =
      std::ranges::find_if(engines(), [](const Engine& one) { return one.name == other_engine(); });
  const auto participant = engine->create(
      {.domain = domain_of_test(), .interface = "lo", .user_data = "", .security = ""});
  std::vector<std::string> came;
  Endpoint endpoint{.topic = "rt/map",
                    .type = kStringThere,
                    .user_data = "",
                    .qos = {.is_reliable = true, .is_transient_local = true, .depth = 10},
                    .is_reader = true};

  const auto reader = participant->create_reader(
      endpoint, [&](std::span<const std::byte> message, const SampleInfo& /*info*/) {
        came.push_back(ros2::CdrReader(message).text("data"));
      });
  wait_until([&] {
    participant->serve(1ms);
    return !came.empty();
  });

  EXPECT_THAT(came, ::testing::ElementsAre("second"));
}

class ServiceTest : public ::testing::TestWithParam<const char*> {};

// Two gateways of one application: what one asks, the other answers, by DDS.
TEST_P(ServiceTest, RequestsGoOneWayAndRepliesTheOther) {
  testing::Bench bench;
  const auto add = [&](const char* name, const char* service, const char* direction) {
    bench.add<Gateway>(
        name,
        fmt::format(R"({{"params": {{"engine": "{}", "domain": {}, "interface": "lo", "node": "{}",
            "services": [{{"service": "{}", "direction": "{}", "ros": "/set_bool",
                           "type": "std_srvs/srv/SetBool"}}]}}}})",
                    GetParam(), domain_of_test(), name, service, direction));
  };
  add("server", "set", "in");
  add("client", "set_there", "out");
  bench.service<basic::Flag, basic::Outcome>(
      "set", [](const basic::Flag& flag, basic::Outcome& outcome) {
        outcome.set_success(flag.data());
        outcome.set_message(flag.data() ? "it is set" : "it is not set");
      });
  auto client = bench.client<basic::Flag, basic::Outcome>("set_there");
  bench.start();
  basic::Flag flag;
  flag.set_data(true);
  int answered = 0;

  const auto end = std::chrono::steady_clock::now() + 60s;
  while (answered < 100 && std::chrono::steady_clock::now() < end) {
    const auto answer = client.call(flag);
    while (!answer.is_done() && std::chrono::steady_clock::now() < end) {
      bench.advance(1ms);
      std::this_thread::sleep_for(1ms);
    }
    if (answer.ok()) {
      EXPECT_EQ(answer->success(), flag.data());
      EXPECT_EQ(answer->message(), flag.data() ? "it is set" : "it is not set");
      flag.set_data(!flag.data());
      ++answered;
    } else if (answer.is_done()) {
      EXPECT_THAT(answer.error(), HasSubstr("no node of ROS 2 serves /set_bool"));
      bench.advance(1ms);
      std::this_thread::sleep_for(1ms);
    }
  }
  bench.stop();

  EXPECT_EQ(answered, 100);
  EXPECT_EQ(std::get<std::int64_t>(bench.result("server", "/set_bool answered")), 100);
  EXPECT_EQ(std::get<std::int64_t>(bench.result("client", "/set_bool answered")), 100);
  EXPECT_EQ(std::get<std::int64_t>(bench.result("server", "/set_bool lost")), 0);
  EXPECT_EQ(std::get<std::int64_t>(bench.result("client", "/set_bool lost")), 0);
}

// Two gateways, as in two processes: what one sends as it is, the other publishes.
TEST_P(ServiceTest, MessagesCrossAsTheyAreWithTheirTimes) {
  testing::Bench bench;
  const auto add = [&](const char* name, const char* topic, const char* direction) {
    bench.add<Gateway>(
        name, fmt::format(R"({{"remap": {{"cloud": "{}"}}, "params": {{"engine": "{}", "domain": {},
            "interface": "lo", "node": "{}", "topics": [{{"topic": "cloud", "direction": "{}",
            "message": "foxglove.PointCloud", "depth": 1000}}]}}}})",
                          topic, GetParam(), domain_of_test(), name, direction));
  };
  add("sender", "cloud_there", "out");
  add("receiver", "cloud_here", "in");
  auto there = bench.input<foxglove::PointCloud>("cloud_there");
  auto here = bench.output<foxglove::PointCloud>("cloud_here");
  bench.start();
  foxglove::PointCloud cloud;
  cloud.set_data(std::string(100'000, 'x'));
  cloud.set_frame_id("lidar");

  std::vector<testing::Bench::Received<foxglove::PointCloud>> came;
  const auto end = std::chrono::steady_clock::now() + 60s;
  while (came.size() < 100 && std::chrono::steady_clock::now() < end) {
    there.publish(cloud, {.taken_at = bench.now() - 25ms});
    bench.advance(10ms);
    std::this_thread::sleep_for(1ms);
    for (auto& one : here.take_with_info()) {
      came.push_back(std::move(one));
    }
  }
  const Time last = bench.now();
  bench.stop();

  ASSERT_GE(came.size(), 100U);
  EXPECT_EQ(came.back().message.data(), cloud.data());
  EXPECT_EQ(came.back().message.frame_id(), "lidar");
  // Sent at a multiple of 10 ms, and measured 25 ms before.
  EXPECT_EQ((last - came.back().info.origin.taken - 25ms) % 10ms, 0ms);
  EXPECT_EQ(std::get<std::int64_t>(bench.result("receiver", "fastcycle/cloud missing")), 0);
}

// What it is made of was taken on the way to the first gateway, and judged behind the second one.
TEST_P(ServiceTest, LatencyChainsGoOnBetweenTwoApplications) {
  testing::Bench bench;
  const auto add = [&](const char* name, const char* topic, const char* direction) {
    bench.add<Gateway>(
        name, fmt::format(R"({{"remap": {{"text": "{}"}}, "params": {{"engine": "{}", "domain": {},
            "interface": "lo", "node": "{}", "topics": [{{"topic": "text", "direction": "{}",
            "message": "basic.Text", "depth": 1000}}]}}}})",
                          topic, GetParam(), domain_of_test(), name, direction));
  };
  add("sender", "text_there", "out");
  add("receiver", "text_here", "in");
  bench.configure(R"({"modes": {"nominal": {}, "degraded": {}}, "initial_mode": "nominal",
                      "chains": [{"name": "across", "from": "text_there", "to": "text_here",
                                  "deadline_ms": 3600000, "on_breach": "degrade",
                                  "mode": "degraded"}]})");
  auto there = bench.input<basic::Text>("text_there");
  auto here = bench.output<basic::Text>("text_here");
  bench.start();
  const auto send = [&](Duration age, const auto& is_done) {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!is_done() && std::chrono::steady_clock::now() < end) {
      there.publish({}, {.taken_at = bench.now() - age});
      bench.advance(10ms);
      std::this_thread::sleep_for(1ms);
    }
  };

  std::size_t came = 0;
  send(0s, [&] { return (came += here.take().size()) >= 10; });
  EXPECT_GE(came, 10U);
  EXPECT_EQ(bench.mode(), "nominal");
  send(2h, [&] { return bench.mode() == "degraded"; });

  EXPECT_EQ(bench.mode(), "degraded");
}

TEST_P(ServiceTest, WhatAnotherApplicationSentAndNeverCameIsCounted) {
  testing::Bench bench;
  bench.add<Gateway>("gateway",
                     fmt::format(R"({{"params": {{"engine": "{}", "domain": {}, "interface": "lo",
                      "topics": [{{"topic": "text", "direction": "in", "message": "basic.Text"}}]}}}})",
                                 GetParam(), domain_of_test()));
  auto texts = bench.output<basic::Text>("text");
  bench.start();
  const auto engine = std::ranges::find_if(
      engines(), [](const Engine& one) { return one.name == std::string(GetParam()); });
  const auto participant = engine->create(
      {.domain = domain_of_test(), .interface = "lo", .user_data = "", .security = ""});
  const auto writer = participant->create_writer({.topic = "fastcycle/text",
                                                  .type = ros2::dds_type(kEnvelopeType),
                                                  .user_data = "",
                                                  .qos = {}});
  std::size_t came = 0;
  const auto send = [&](std::uint64_t number) {
    ros2::Buffer bytes;
    write_envelope(basic::Text(), {.number = number, .published = bench.now()}, bytes);
    writer->write(bytes);
  };
  const auto wait_for = [&](std::size_t count, const auto& between) {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (came < count && std::chrono::steady_clock::now() < end) {
      between();
      bench.advance(1ms);
      std::this_thread::sleep_for(1ms);
      came += texts.take().size();
    }
  };

  wait_for(1, [&] { send(1); });  // Until both have found each other.
  const std::size_t before = came;
  send(2);
  send(5);
  wait_for(before + 2, [] {});
  bench.stop();

  EXPECT_EQ(std::get<std::int64_t>(bench.result("gateway", "fastcycle/text missing")), 2);
}

INSTANTIATE_TEST_SUITE_P(Engines, ServiceTest, ::testing::ValuesIn([] {
                           std::vector<const char*> all;
                           for (const Engine& engine : engines()) {
                             all.push_back(engine.name);
                           }
                           return all;
                         }()),
                         [](const auto& engine) { return std::string(engine.param); });

TEST(Gateway, ErrorsOfItsParamsAreReportedBeforeItStarts) {
  testing::Bench bench;
  bench.add<Gateway>("gateway", R"({"params": {"topics": [
      {"topic": "a", "direction": "in", "ros": "/a", "type": "demo_msgs/msg/None"},
      {"topic": "b", "direction": "in", "ros": "/b", "type": "sensor_msgs/msg/Imu",
       "message": "basic.Text"}]}})");

  EXPECT_THAT([&] { bench.start(); },
              ::testing::Throws<std::exception>(::testing::Property(
                  &std::exception::what,
                  AllOf(HasSubstr("/params/topics/0: demo_msgs/msg/None: expected a mapping"),
                        HasSubstr("/params/topics/1: sensor_msgs/msg/Imu -> basic.Text")))));
}

std::vector<Engines> all_engines() {
  std::vector<Engines> all;
  for (const Engine& ours : engines()) {
    for (const Engine& other : engines()) {
      all.emplace_back(ours.name, other.name);
    }
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(Engines, GatewayTest, ::testing::ValuesIn(all_engines()),
                         [](const auto& both) {
                           return fmt::format("{}With{}", both.param.first, both.param.second);
                         });

}  // namespace
}  // namespace fastcycle::dds_gateway
