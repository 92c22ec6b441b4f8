#include "vehicle.h"

#include <array>
#include <filesystem>
#include <limits>
#include <string>

#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

const std::filesystem::path kDbc = std::filesystem::path(ADS_DIR) / "modules/vehicle/ego.dbc";

class VehicleTest : public ::testing::Test {
 protected:
  VehicleTest() {
    bench_.add<Vehicle>("vehicle", fmt::format(R"({{"params": {{"dbc": "{}"}}}})", kDbc.string()));
    bench_.start();
  }

  void publish_supervision(supervision::DrivingState state) {
    supervision::State message;
    message.set_state(state);
    supervision_.publish(message);
  }

  void publish_command(double steering_rad, double acceleration_mps2, bool is_autonomous = true) {
    control::Command command;
    command.mutable_header()->set_taken_ns(++command_ns_);
    command.set_steering_rad(steering_rad);
    command.set_acceleration_mps2(acceleration_mps2);
    command.set_is_autonomous(is_autonomous);
    commands_.publish(command);
  }

  [[nodiscard]] can::Frame state_frame(double speed_mps) {
    std::array<std::uint8_t, 8> payload{};
    const DbcMessage& message = dbc_.message("VEHICLE_STATE");
    message.signal("SPEED").encode(speed_mps, payload);
    message.signal("STEERING").encode(-0.25, payload);
    message.signal("ACCELERATION").encode(-1.5, payload);
    message.signal("AUTONOMOUS").encode(1.0, payload);
    state_guard_.seal(payload);
    can::Frame frame;
    frame.mutable_header()->set_taken_ns(123);
    frame.set_address(message.address);
    frame.set_data(payload.data(), payload.size());
    return frame;
  }

  // What the signal says in the last frame that was sent.
  [[nodiscard]] double sent(std::string_view signal) {
    if (const auto frames = frames_.take(); !frames.empty()) {
      last_ = frames.back();
    }
    const std::span payload(reinterpret_cast<const std::uint8_t*>(last_.data().data()),
                            last_.data().size());
    return dbc_.message("ADS_COMMAND").signal(signal).decode(payload);
  }

  void publish_stop() {
    control::Command command;
    command.mutable_header()->set_taken_ns(++command_ns_);
    command.set_is_autonomous(true);
    command.set_is_stopping_alone(true);
    commands_.publish(command);
  }

  void press_brake(double share) {
    const DbcMessage& message = dbc_.message("DRIVER_INPUT");
    std::array<std::uint8_t, 8> payload{};
    message.signal("BRAKE_PEDAL").encode(100.0 * share, payload);
    driver_guard_.seal(payload);
    can::Frame frame;
    frame.set_address(message.address);
    frame.set_data(payload.data(), payload.size());
    bus_.publish(frame);
  }

  [[nodiscard]] std::int64_t result(const std::string& name) const {
    return std::get<std::int64_t>(bench_.result("vehicle", name));
  }

  Dbc dbc_ = Dbc::read(kDbc);
  FrameGuard state_guard_{dbc_.message("VEHICLE_STATE")};
  FrameGuard driver_guard_{dbc_.message("DRIVER_INPUT")};
  std::int64_t command_ns_ = 0;  // Stamp of the last command.
  can::Frame last_;
  Bench bench_;
  Bench::Input<can::Frame> bus_ = bench_.input<can::Frame>("can/state");
  Bench::Input<control::Command> commands_ = bench_.input<control::Command>("control/command");
  Bench::Input<supervision::State> supervision_ =
      bench_.input<supervision::State>("supervision/state");
  Bench::Output<vehicle::State> states_ = bench_.output<vehicle::State>("vehicle/state");
  Bench::Output<vehicle::DriverInput> drivers_ =
      bench_.output<vehicle::DriverInput>("vehicle/driver");
  Bench::Output<can::Frame> frames_ = bench_.output<can::Frame>("can/command");
};

TEST_F(VehicleTest, FramesBecomeTheVehiclesState) {
  bus_.publish(state_frame(12.345));

  const auto states = states_.take();

  ASSERT_EQ(states.size(), 1U);
  EXPECT_EQ(states[0].header().taken_ns(), 123);
  EXPECT_NEAR(states[0].speed_mps(), 12.345, 0.0011);
  EXPECT_NEAR(states[0].steering_rad(), -0.25, 5e-5);
  EXPECT_NEAR(states[0].acceleration_mps2(), -1.5, 0.005);
  EXPECT_TRUE(states[0].is_autonomous());
}

TEST_F(VehicleTest, WrongAndRepeatedFramesAreRefusedAndCounted) {
  const can::Frame good = state_frame(10.0);
  can::Frame changed = state_frame(10.0);
  (*changed.mutable_data())[1] = '\x7f';
  can::Frame cut = state_frame(10.0);
  cut.set_data("123");
  can::Frame other = state_frame(10.0);
  other.set_address(42);

  bus_.publish(good);
  bus_.publish(good);
  bus_.publish(changed);
  bus_.publish(cut);
  bus_.publish(other);
  bus_.publish(state_frame(10.0));

  EXPECT_EQ(states_.take().size(), 2U);
  bench_.stop();
  EXPECT_EQ(result("frames_received"), 5);
  EXPECT_EQ(result("frames_refused"), 3);
  EXPECT_EQ(result("frames_lost"), 3);
}

TEST_F(VehicleTest, FramesBecomeWhatTheDriverDoes) {
  const DbcMessage& message = dbc_.message("DRIVER_INPUT");
  FrameGuard guard(message);
  std::array<std::uint8_t, 8> payload{};
  message.signal("STEERING_TORQUE").encode(-4.25, payload);
  message.signal("BRAKE_PEDAL").encode(40.0, payload);
  message.signal("TAKEOVER_BUTTON").encode(1.0, payload);
  guard.seal(payload);
  can::Frame frame;
  frame.mutable_header()->set_taken_ns(55);
  frame.set_address(message.address);
  frame.set_data(payload.data(), payload.size());

  bus_.publish(frame);
  bus_.publish(frame);

  const auto drivers = drivers_.take();
  ASSERT_EQ(drivers.size(), 1U);
  EXPECT_EQ(drivers[0].header().taken_ns(), 55);
  EXPECT_NEAR(drivers[0].steering_torque_nm(), -4.25, 0.005);
  EXPECT_NEAR(drivers[0].brake_pedal(), 0.4, 1e-9);
  EXPECT_TRUE(drivers[0].takeover_button());
  bench_.stop();
  EXPECT_EQ(result("driver_frames_refused"), 1);
}

TEST_F(VehicleTest, CommandsBecomeFrames) {
  publish_supervision(supervision::ENGAGED);
  publish_command(0.1234, -2.5);

  EXPECT_NEAR(sent("STEERING"), 0.1234, 5e-5);
  EXPECT_NEAR(sent("ACCELERATION"), -2.5, 5e-4);
  EXPECT_EQ(sent("AUTONOMOUS"), 1.0);
  EXPECT_EQ(last_.address(), 257U);
  EXPECT_EQ(last_.header().taken_ns(), command_ns_);
}

TEST_F(VehicleTest, FramesCarryACounterAndAChecksum) {
  publish_supervision(supervision::ENGAGED);
  for (int count = 0; count < 40; ++count) {
    publish_command(0.01 * count, 0.0);
  }

  FrameGuard guard(dbc_.message("ADS_COMMAND"));
  for (const can::Frame& frame : frames_.take()) {
    EXPECT_EQ(guard.check({reinterpret_cast<const std::uint8_t*>(frame.data().data()), 8}),
              FrameGuard::Verdict::kGood);
  }
  EXPECT_EQ(guard.lost(), 0U);
}

TEST_F(VehicleTest, OnlySupervisionMakesCommandsAutonomous) {
  publish_command(0.0, 1.0);
  EXPECT_EQ(sent("AUTONOMOUS"), 0.0);
  for (const auto& [state, expected] :
       {std::pair(supervision::OFF, 0.0), std::pair(supervision::AVAILABLE, 0.0),
        std::pair(supervision::ENGAGED, 1.0), std::pair(supervision::ENGAGED_DEGRADED, 1.0),
        std::pair(supervision::MINIMAL_RISK_STOP, 1.0), std::pair(supervision::STOPPED, 1.0)}) {
    publish_supervision(state);
    publish_command(0.0, 1.0);
    EXPECT_EQ(sent("AUTONOMOUS"), expected) << supervision::DrivingState_Name(state);
  }
  publish_command(0.0, 1.0, false);
  EXPECT_EQ(sent("AUTONOMOUS"), 0.0);
}

TEST_F(VehicleTest, NothingIsSentWhileSupervisionIsSilent) {
  publish_supervision(supervision::ENGAGED);
  bench_.advance(500ms);
  publish_command(0.0, 1.0);
  EXPECT_EQ(frames_.take().size(), 1U);
  bench_.advance(1ms);
  publish_command(0.0, 1.0);
  EXPECT_TRUE(frames_.take().empty());
  publish_supervision(supervision::ENGAGED);
  publish_command(0.0, 1.0);
  EXPECT_EQ(frames_.take().size(), 1U);
  bench_.stop();

  EXPECT_EQ(result("commands_withheld"), 1);
  EXPECT_EQ(result("commands_sent_autonomous"), 2);
}

TEST_F(VehicleTest, AStopGoesOnWhileSupervisionIsSilentUntilTheDriverActs) {
  publish_supervision(supervision::ENGAGED);
  press_brake(0.0);
  bench_.advance(600ms);
  publish_stop();
  EXPECT_EQ(sent("AUTONOMOUS"), 1.0);
  press_brake(0.04);
  publish_stop();
  EXPECT_EQ(sent("AUTONOMOUS"), 1.0);
  press_brake(0.5);
  bench_.advance(100ms);
  publish_stop();
  EXPECT_EQ(sent("AUTONOMOUS"), 0.0);

  publish_supervision(supervision::MINIMAL_RISK_STOP);
  publish_stop();
  EXPECT_EQ(sent("AUTONOMOUS"), 1.0) << "supervision knows better";
}

TEST_F(VehicleTest, CommandThatIsNoNumberIsNotSent) {
  publish_supervision(supervision::ENGAGED);
  publish_command(std::numeric_limits<double>::quiet_NaN(), 0.0);
  publish_command(0.0, std::numeric_limits<double>::infinity());

  EXPECT_TRUE(frames_.take().empty());
  bench_.stop();
  EXPECT_EQ(result("commands_invalid"), 2);
}

TEST_F(VehicleTest, CommandIsSentOnceOnly) {
  publish_supervision(supervision::ENGAGED);
  publish_command(0.1, 0.0);
  const std::int64_t newest_ns = command_ns_;
  for (const std::int64_t taken_ns : {newest_ns, newest_ns - 5}) {
    command_ns_ = taken_ns - 1;
    publish_command(0.1, 0.0);
  }
  EXPECT_EQ(frames_.take().size(), 1U);
  command_ns_ = newest_ns;
  publish_command(0.1, 0.0);
  EXPECT_EQ(frames_.take().size(), 1U);

  bench_.stop();
  EXPECT_EQ(result("commands_repeated"), 2);
}

TEST_F(VehicleTest, CommandBeyondTheBitsIsTheMostThatTheyHold) {
  publish_supervision(supervision::ENGAGED);
  publish_command(100.0, -1000.0);

  EXPECT_NEAR(sent("STEERING"), 3.2767, 1e-9);
  EXPECT_NEAR(sent("ACCELERATION"), -32.768, 1e-9);
}

}  // namespace
}  // namespace ads
