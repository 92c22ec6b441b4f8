#include "velodyne.h"

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "capture.h"
#include "common/files.h"
#include "encoder.h"

namespace ads {
namespace {

using fastcycle::testing::Bench;
using namespace std::chrono_literals;

struct TimedPacket {
  std::vector<std::uint8_t> bytes;
  std::int64_t sent_ns;
};

// Two and a half turns at 10 Hz of a sensor that sees a wall 10 m around it.
std::vector<TimedPacket> turning_packets() {
  std::vector<TimedPacket> packets;
  velodyne::PacketEncoder encoder(
      velodyne::vlp16(), [&](std::span<const std::uint8_t> bytes, std::int64_t sent_ns) {
        packets.push_back({.bytes = {bytes.begin(), bytes.end()}, .sent_ns = sent_ns});
      });
  const std::vector<velodyne::Return> returns(16, {.distance = 5000, .intensity = 9});
  for (int firing = 0; firing < 4512; ++firing) {
    encoder.add(90.0 + 0.2 * firing, firing * 55'296LL / 1000, returns);
  }
  return packets;
}

// Sends to a port on this machine that was free.
class Sensor {
 public:
  Sensor() : socket_(checked_descriptor(::socket(AF_INET, SOCK_DGRAM, 0), "socket")) {
    const Descriptor probe = checked_descriptor(::socket(AF_INET, SOCK_DGRAM, 0), "socket");
    to_.sin_family = AF_INET;
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof to_;
    EXPECT_EQ(::bind(probe.get(), reinterpret_cast<sockaddr*>(&to_), size), 0);
    EXPECT_EQ(::getsockname(probe.get(), reinterpret_cast<sockaddr*>(&to_), &size), 0);
  }

  [[nodiscard]] int port() const { return ntohs(to_.sin_port); }
  void send(std::span<const std::uint8_t> bytes) {
    (void)::sendto(socket_.get(), bytes.data(), bytes.size(), 0,
                   reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
  }

 private:
  sockaddr_in to_{};
  Descriptor socket_;
};

bool advance_until(Bench& bench, const std::function<bool()>& holds) {
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (!holds()) {
    if (std::chrono::steady_clock::now() > limit) {
      return false;
    }
    bench.advance(10ms);
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

TEST(Velodyne, RevolutionsComeByUdp) {
  Sensor sensor;
  Bench bench;
  bench.add<Velodyne>(
      "lidar", fmt::format(R"({{"params": {{"model": "vlp16", "address": "127.0.0.1", "port": {},
                           "mount_height_m": 1.8, "mount_forward_m": 0.5}}}})",
                           sensor.port()));
  auto sweeps = bench.output<lidar::Sweep>("lidar/points");
  bench.start();
  const auto packets = turning_packets();
  std::vector<lidar::Sweep> received;
  std::size_t next = 0;

  const bool has_come = advance_until(bench, [&] {
    for (int count = 0; count < 8; ++count) {
      sensor.send(packets[next++ % packets.size()].bytes);
    }
    sensor.send(std::vector<std::uint8_t>(512));
    for (lidar::Sweep& sweep : sweeps.take()) {
      received.push_back(std::move(sweep));
    }
    return !received.empty();
  });
  bench.stop();

  ASSERT_TRUE(has_come);
  EXPECT_EQ(received[0].rings(), 16U);
  EXPECT_EQ(received[0].mount_height_m(), 1.8);
  EXPECT_EQ(received[0].mount_forward_m(), 0.5);
  EXPECT_GT(received[0].columns(), 900U);
  EXPECT_GE(std::get<std::int64_t>(bench.result("lidar", "packets_refused: wrong size")), 1);
  EXPECT_GE(std::get<std::int64_t>(bench.result("lidar", "sweeps")), 1);
}

TEST(Velodyne, RevolutionsOfACaptureFileComeWhenTheyDid) {
  const auto file = std::filesystem::temp_directory_path() / "velodyne_test.pcap";
  velodyne::testing::Capture capture;
  for (const TimedPacket& packet : turning_packets()) {
    capture.add(1'700'000'000'000'000'000 + packet.sent_ns, 2368, packet.bytes);
    capture.add(1'700'000'000'000'000'000 + packet.sent_ns, 8308, packet.bytes);
  }
  write_file(file, capture.bytes);
  Bench bench;
  bench.add<Velodyne>(
      "lidar",
      fmt::format(R"({{"params": {{"model": "vlp16", "pcap": "{}", "mount_height_m": 1.8}}}})",
                  file.string()));
  auto sweeps = bench.output<lidar::Sweep>("lidar/points");
  bench.start();
  const auto start_ns = bench.now().time_since_epoch().count();

  bench.advance(120ms);
  EXPECT_TRUE(sweeps.take().empty());
  bench.advance(10ms);
  const auto first = sweeps.take();
  bench.advance(150ms);

  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].columns(), 1800U);
  // The first packet came when it was over; the sweep began a quarter of a turn after its begin.
  EXPECT_NEAR(static_cast<double>(first[0].header().taken_ns() - start_ns),
              (450.0 - 24.0) * 55'296.0, 5e3);
  EXPECT_EQ(sweeps.take().size(), 1U);
  std::filesystem::remove(file);
}

TEST(Velodyne, AnHdl64WithoutItsCalibrationIsRefused) {
  Bench bench;
  bench.add<Velodyne>("lidar", R"({"params": {"model": "hdl64", "mount_height_m": 1.8}})");
  bench.start();

  const auto faults = bench.faults("lidar");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("expected the db.xml of this HDL-64E"), std::string::npos) << faults[0];
}

TEST(Velodyne, AnAddressThatIsNoneIsRefused) {
  Bench bench;
  bench.add<Velodyne>(
      "lidar", R"({"params": {"model": "vlp16", "mount_height_m": 1.8, "address": "lidar"}})");
  bench.start();

  const auto faults = bench.faults("lidar");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("expected an IPv4 address, found \"lidar\""), std::string::npos);
}

}  // namespace
}  // namespace ads
