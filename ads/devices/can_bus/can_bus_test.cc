#include "can_bus.h"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <net/if.h>
#include <unistd.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using namespace std::chrono_literals;
using ::testing::HasSubstr;

can_frame frame_of(std::uint32_t id, const std::string& data) {
  can_frame frame{};
  frame.can_id = id;
  frame.can_dlc = static_cast<__u8>(data.size());
  std::memcpy(frame.data, data.data(), data.size());
  return frame;
}

class CanBusTest : public ::testing::Test {
 protected:
  CanBusTest() {
    bench_.add<CanBusComponent>(
        "can_bus",
        fmt::format(R"({{"params": {{"fake": "{}", "bus": 3, "retry_first_s": 0.001}}}})",
                    bus_.string()));
  }
  ~CanBusTest() override { vehicle_.close(); }

  bool advance_until(const std::function<bool()>& holds) {
    const auto limit = std::chrono::steady_clock::now() + 60s;
    while (!holds()) {
      if (std::chrono::steady_clock::now() > limit) {
        return false;
      }
      bench_.advance(10ms);
      (void)vehicle_.read();
      for (can::Frame& frame : states_.take()) {
        received_.push_back(std::move(frame));
      }
      std::this_thread::sleep_for(1ms);
    }
    return true;
  }

  // The other end is there as soon as the component's thread has opened its own.
  bool send(const can_frame& frame) {
    return advance_until([&] { return vehicle_.send(frame).empty(); });
  }

  can::Frame command(std::uint32_t address, const std::string& data) {
    can::Frame frame;
    frame.mutable_header()->set_taken_ns(bench_.now().time_since_epoch().count());
    frame.set_address(address);
    frame.set_data(data);
    return frame;
  }

  [[nodiscard]] std::int64_t result(const std::string& name) const {
    return std::get<std::int64_t>(bench_.result("can_bus", name));
  }

  std::filesystem::path bus_ =
      std::filesystem::path("/tmp") /
      fmt::format("can_bus_test_{}_{}", ::getpid(),
                  ::testing::UnitTest::GetInstance()->current_test_info()->name());
  std::vector<can_frame> sent_;
  FakeCanBus vehicle_{FakeCanBus::vehicle_end(bus_), FakeCanBus::ads_end(bus_),
                      [this](const can_frame& frame) {
                        sent_.push_back(frame);
                        return true;
                      }};
  Bench bench_;
  Bench::Input<can::Frame> commands_ = bench_.input<can::Frame>("can/command");
  Bench::Output<can::Frame> states_ = bench_.output<can::Frame>("can/state");
  std::vector<can::Frame> received_;
};

TEST_F(CanBusTest, FramesOfTheBusArePublished) {
  vehicle_.open();
  bench_.start();

  ASSERT_TRUE(send(frame_of(513, "12345678")));
  ASSERT_TRUE(send(frame_of(0x123 | CAN_EFF_FLAG, "")));
  ASSERT_TRUE(send(frame_of(7 | CAN_RTR_FLAG, "")));
  ASSERT_TRUE(send(frame_of(7, "abc")));
  ASSERT_TRUE(advance_until([this] { return received_.size() >= 3; }));

  EXPECT_EQ(received_[0].address(), 513U);
  EXPECT_EQ(received_[0].data(), "12345678");
  EXPECT_EQ(received_[0].bus(), 3U);
  EXPECT_FALSE(received_[0].is_extended());
  EXPECT_EQ(received_[1].address(), 0x123U);
  EXPECT_TRUE(received_[1].is_extended());
  EXPECT_EQ(received_[1].data(), "");
  EXPECT_EQ(received_[2].data(), "abc");
}

TEST_F(CanBusTest, CommandsAreSentToTheBus) {
  vehicle_.open();
  bench_.start();
  ASSERT_TRUE(send(frame_of(513, "")));

  commands_.publish(command(257, "87654321"));
  commands_.publish(command(0x12345, "x"));
  ASSERT_TRUE(advance_until([this] { return sent_.size() >= 2; }));

  EXPECT_EQ(sent_[0].can_id, 257U);
  EXPECT_EQ(std::memcmp(sent_[0].data, "87654321", 8), 0);
  EXPECT_EQ(sent_[0].can_dlc, 8);
  EXPECT_EQ(sent_[1].can_id, 0x12345U | CAN_EFF_FLAG);
}

TEST_F(CanBusTest, OldAndImpossibleCommandsAreNotSent) {
  vehicle_.open();
  bench_.start();
  ASSERT_TRUE(send(frame_of(513, "")));
  const can::Frame old = command(257, "old");
  bench_.advance(101ms);

  commands_.publish(old);
  commands_.publish(command(257, "123456789"));
  commands_.publish(command(0x2000'0000, ""));
  commands_.publish(command(257, "new"));
  ASSERT_TRUE(advance_until([this] { return !sent_.empty(); }));
  bench_.stop();

  EXPECT_EQ(std::memcmp(sent_[0].data, "new", 3), 0);
  EXPECT_EQ(result("commands_too_old"), 1);
  EXPECT_EQ(result("commands_invalid"), 2);
  EXPECT_EQ(result("commands_sent"), 1);
}

TEST_F(CanBusTest, CommandsThatNobodyTakesAreCountedAndReported) {
  bench_.start();

  commands_.publish(command(257, "1"));
  bench_.advance(200ms);
  bench_.stop();

  EXPECT_EQ(result("commands_unsent"), 1);
  EXPECT_EQ(result("commands_sent"), 0);
}

TEST_F(CanBusTest, BusOffIsReportedUntilFramesComeAgain) {
  vehicle_.open();
  bench_.start();
  ASSERT_TRUE(send(frame_of(513, "")));

  ASSERT_TRUE(send(frame_of(CAN_ERR_FLAG | CAN_ERR_BUSOFF, std::string(8, '\0'))));
  ASSERT_TRUE(send(frame_of(CAN_ERR_FLAG | CAN_ERR_ACK, std::string(8, '\0'))));
  ASSERT_TRUE(send(frame_of(513, "")));
  ASSERT_TRUE(advance_until([this] { return received_.size() >= 2; }));
  bench_.stop();

  EXPECT_EQ(result("bus_offs"), 1);
  EXPECT_EQ(result("error_frames"), 2);
  EXPECT_EQ(result("frames_received"), 2);
}

TEST(CanErrors, AreSaidInWords) {
  can_frame frame = frame_of(CAN_ERR_FLAG | CAN_ERR_CRTL | CAN_ERR_ACK, std::string(8, '\0'));
  frame.data[1] = CAN_ERR_CRTL_TX_PASSIVE;

  EXPECT_EQ(can_error_of(frame).text, "no acknowledgement, error passive by sending");
  EXPECT_FALSE(can_error_of(frame).is_bus_off);
  EXPECT_TRUE(can_error_of(frame_of(CAN_ERR_FLAG | CAN_ERR_BUSOFF, "")).is_bus_off);
  EXPECT_TRUE(can_error_of(frame_of(CAN_ERR_FLAG | CAN_ERR_RESTARTED, "")).is_restart);
}

TEST(SocketCan, AnInterfaceThatIsNotThereIsALossThatIsNamed) {
  SocketCanBus bus("no_such_can", [](const can_frame&) { return true; });

  try {
    bus.open();
    FAIL();
  } catch (const std::system_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("CAN no_such_can: "));
  }
  EXPECT_EQ(bus.send(can_frame{}), "CAN no_such_can is not open");
}

TEST(SocketCan, FramesGoFromOneSocketToAnother) {
  const std::string interface = "vcan0";
  if (::if_nametoindex(interface.c_str()) == 0) {
    GTEST_SKIP()
        << "there is no interface vcan0: ip link add vcan0 type vcan; ip link set vcan0 up";
  }
  std::vector<can_frame> received;
  SocketCanBus one(interface, [](const can_frame&) { return true; });
  SocketCanBus other(interface, [&received](const can_frame& frame) {
    received.push_back(frame);
    return true;
  });
  one.open();
  other.open();

  ASSERT_EQ(one.send(frame_of(257, "12345678")), "");
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (received.empty() && std::chrono::steady_clock::now() < limit) {
    (void)other.read();
  }

  ASSERT_EQ(received.size(), 1U);
  EXPECT_EQ(received[0].can_id, 257U);
}

}  // namespace
}  // namespace ads
