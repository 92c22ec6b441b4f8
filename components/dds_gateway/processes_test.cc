// Services of ROS 2 between two processes, and who attacks: a peer that floods, noise of discovery.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include "basic/basic.pb.h"
#include "dds_gateway/gateway.h"
#include "dds_gateway/test_network.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

constexpr const char* kString = "std_msgs/msg/String";
constexpr const char* kStringThere = "std_msgs::msg::dds_::String_";
constexpr std::size_t kMemoryMax = 400U << 20U;  // That an attack may take, of gigabytes it sends.

/// Bytes of this process that are in memory.
std::size_t resident_bytes() {
  std::ifstream input("/proc/self/statm");
  std::size_t all = 0;
  std::size_t resident = 0;
  input >> all >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

/// A gateway on a bench, by each engine.
class AmongProcesses : public ::testing::TestWithParam<const char*> {
 protected:
  void add_gateway(const std::string& lists) {
    bench_.add<Gateway>(
        "gateway", fmt::format(R"({{"params": {{"engine": "{}", "domain": {}, "interface": "lo",
                                        {}}}}})",
                               GetParam(), domain_of_test(), lists));
  }
  /// Lets time go on until `is_done`; fails after `patience`.
  void wait_until(const std::function<bool()>& is_done, std::chrono::seconds patience = 60s) {
    const auto end = std::chrono::steady_clock::now() + patience;
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
  /// A well-behaved pair of topics, which has to work whatever else happens.
  static std::string calm_topics() {
    return R"({"topic": "ping", "direction": "out", "ros": "/ping", "type": "std_msgs/msg/String",
               "depth": 1000},
              {"topic": "pong", "direction": "in", "ros": "/pong", "type": "std_msgs/msg/String",
               "depth": 1000})";
  }
  /// Sends a text until it has come back `times` times.
  void ping(testing::Bench::Input<basic::Text>& there, testing::Bench::Output<basic::Text>& back,
            int times) {
    basic::Text text;
    text.set_data("calm");
    int came = 0;
    wait_until([&] {
      there.publish(text);
      for (const basic::Text& one : back.take()) {
        EXPECT_EQ(one.data(), "calm");
        ++came;
      }
      return came >= times;
    });
  }

  testing::Bench bench_;
};

std::vector<std::string> calm_peer() {
  return {"echo", "rt/ping", "rt/pong", kStringThere, "reliable", "volatile"};
}

TEST_P(AmongProcesses, AServerInAnotherProcessAnswers) {
  const Peer peer(GetParam(), {"serve", "/set_bool"});
  add_gateway(R"("services": [{"service": "set_there", "direction": "out", "ros": "/set_bool",
                               "type": "std_srvs/srv/SetBool"}])");
  auto client = bench_.client<basic::Flag, basic::Outcome>("set_there");
  bench_.start();
  basic::Flag flag;
  int answered = 0;

  const auto end = std::chrono::steady_clock::now() + 60s;
  while (answered < 100) {
    ASSERT_LT(std::chrono::steady_clock::now(), end) << answered << " answered";
    flag.set_data(answered % 2 == 0);
    const auto answer = client.call(flag, {.deadline = 500ms});
    while (!answer.is_done()) {
      bench_.advance(1ms);
      std::this_thread::sleep_for(1ms);
    }
    if (answer.ok()) {
      EXPECT_EQ(answer->success(), flag.data());
      EXPECT_EQ(answer->message(), flag.data() ? "set there" : "not set there");
      ++answered;
    }
  }
}

TEST_P(AmongProcesses, AClientInAnotherProcessIsAnswered) {
  Peer peer(GetParam(), {"ask", "/set_bool", "100"});
  add_gateway(R"("services": [{"service": "set", "direction": "in", "ros": "/set_bool",
                               "type": "std_srvs/srv/SetBool"}])");
  bench_.service<basic::Flag, basic::Outcome>(
      "set",
      [](const basic::Flag& flag, basic::Outcome& outcome) { outcome.set_success(flag.data()); });
  bench_.start();

  wait_until([&] { return peer.has_printed("100 answers were right\n"); });
}

// What a flood does not get through is counted, and others get through.
TEST_P(AmongProcesses, APeerThatFloodsIsCountedAndHoldsUpNobody) {
  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / fmt::format("flood_{}.cdr", getpid());
  ros2::Buffer message;
  ros2::CdrWriter out(message);
  out.text(std::string(100'000, 'x'));
  out.end();
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(message.data()),
             static_cast<std::streamsize>(message.size()));
  const Peer calm(GetParam(), calm_peer());
  add_gateway(fmt::format(R"("topics": [{}, {{"topic": "flood", "direction": "in", "ros": "/flood",
      "type": "{}", "reliability": "best_effort", "depth": 10}}])",
                          calm_topics(), kString));
  auto there = bench_.input<basic::Text>("ping");
  auto back = bench_.output<basic::Text>("pong");
  auto flood = bench_.output<basic::Text>("flood");
  bench_.start();
  ping(there, back, 1);
  const std::size_t before = resident_bytes();

  // 2 GB as fast as it can.
  const Peer peer(GetParam(), {"send", "rt/flood", kStringThere, "best_effort", "volatile", "20000",
                               file.string()});
  std::size_t came = 0;
  std::size_t most = before;
  wait_until([&] {
    came += flood.take().size();
    most = std::max(most, resident_bytes());
    return came > 0;
  });
  const auto end = std::chrono::steady_clock::now() + 5s;
  while (std::chrono::steady_clock::now() < end) {
    ping(there, back, 5);
    came += flood.take().size();
    most = std::max(most, resident_bytes());
  }
  bench_.stop();

  EXPECT_LT(most - before, kMemoryMax);
  EXPECT_GT(count("/flood lost"), 0);
  EXPECT_LE(count("/flood received") + count("/flood lost"), 20'000);
  EXPECT_EQ(count("/flood received"), count("/flood published"));
  std::filesystem::remove(file);
}

/// Sends datagrams to the ports of discovery of a domain on loopback, as long as it lives.
class Noise {
 public:
  Noise() : thread_([this](const std::stop_token& stop) { run(stop); }) {}
  [[nodiscard]] std::uint64_t sent() const { return sent_.load(); }

 private:
  void run(const std::stop_token& stop) {
    const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    std::mt19937 random(7);  // NOLINT: the same noise each time.
    while (!stop.stop_requested()) {
      std::vector<std::uint8_t> packet(20 + random() % 1200);
      std::ranges::generate(packet, [&] { return static_cast<std::uint8_t>(random()); });
      if (random() % 4 != 0) {  // Most begin as a packet of DDS, with submessages that may be any.
        constexpr std::array<std::uint8_t, 10> kHead = {'R', 'T', 'P', 'S', 2, 1, 1, 0x0f, 1, 0x0f};
        std::ranges::copy(kHead, packet.begin());
        if (packet.size() > 28) {
          packet[20] = random() % 2 == 0 ? 0x15 : packet[20];  // Data.
          packet[22] = static_cast<std::uint8_t>(packet.size() - 24);
          packet[23] = static_cast<std::uint8_t>((packet.size() - 24) >> 8U);
        }
      }
      sockaddr_in place{};
      place.sin_family = AF_INET;
      place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      const unsigned offsets[] = {0, 1, 10, 11, 12, 13, 14, 15};
      place.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * domain_of_test() +
                                                        offsets[random() % std::size(offsets)]));
      sent_ += sendto(socket, packet.data(), packet.size(), 0,
                      reinterpret_cast<const sockaddr*>(&place), sizeof place) > 0
                   ? 1
                   : 0;
      if (sent_ % 64 == 0) {
        std::this_thread::sleep_for(1ms);
      }
    }
    close(socket);
  }

  std::atomic<std::uint64_t> sent_{0};
  std::jthread thread_;
};

TEST_P(AmongProcesses, NoiseOnThePortsOfDiscoveryHoldsUpNobody) {
  const Peer calm(GetParam(), calm_peer());
  add_gateway(fmt::format(R"("topics": [{}])", calm_topics()));
  auto there = bench_.input<basic::Text>("ping");
  auto back = bench_.output<basic::Text>("pong");
  bench_.start();
  ping(there, back, 1);
  const std::size_t before = resident_bytes();

  const Noise noise;
  wait_until([&] { return noise.sent() >= 100'000; });
  ping(there, back, 100);

  EXPECT_LT(resident_bytes() - std::min(before, resident_bytes()), kMemoryMax);
}

TEST_P(AmongProcesses, ParticipantsThatComeAndGoHoldUpNobody) {
  const Peer calm(GetParam(), calm_peer());
  add_gateway(fmt::format(R"("topics": [{}])", calm_topics()));
  auto there = bench_.input<basic::Text>("ping");
  auto back = bench_.output<basic::Text>("pong");
  bench_.start();
  ping(there, back, 1);

  // Each of them has a writer of the gateway's own topic, of another type.
  Peer crowd(GetParam(), {"come_and_go", "rt/pong", "std_msgs::msg::dds_::Int8_", "50"});
  ping(there, back, 200);
  (void)crowd.end();
  // They have said that they go, and are trouble no more.
  wait_until([&] { return std::get<std::string>(bench_.result("gateway", "trouble")).empty(); });
  ping(there, back, 10);
}

INSTANTIATE_TEST_SUITE_P(Engines, AmongProcesses, ::testing::ValuesIn([] {
                           std::vector<const char*> all;
                           for (const Engine& engine : engines()) {
                             all.push_back(engine.name);
                           }
                           return all;
                         }()),
                         [](const auto& engine) { return std::string(engine.param); });

}  // namespace
}  // namespace fastcycle::dds_gateway
