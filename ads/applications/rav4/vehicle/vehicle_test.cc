#include "vehicle.h"

#include <fstream>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "applications/rav4/drive/small_drive.h"

namespace rav4 {
namespace {

using fastcycle::testing::Bench;

constexpr std::string_view kDbc = R"(BO_ 37 STEER_ANGLE_SENSOR: 8 XXX
 SG_ STEER_ANGLE : 3|12@0- (1.5,0) [-500|500] "deg" XXX
 SG_ STEER_FRACTION : 39|4@0- (0.1,0) [-0.7|0.7] "deg" XXX

BO_ 170 WHEELS: 8 XXX
 SG_ WHEEL_SPEED_FR : 6|15@0+ (0.01,-67.67) [0|0] "km/h" XXX
 SG_ WHEEL_SPEED_FL : 22|15@0+ (0.01,-67.67) [0|0] "km/h" XXX
 SG_ WHEEL_SPEED_RR : 38|15@0+ (0.01,-67.67) [0|0] "km/h" XXX
 SG_ WHEEL_SPEED_RL : 54|15@0+ (0.01,-67.67) [0|0] "km/h" XXX
)";

can::Frame frame(std::uint32_t address, std::uint32_t bus, const std::string& data) {
  can::Frame message;
  message.mutable_header()->set_taken_ns(123);
  message.set_address(address);
  message.set_bus(bus);
  message.set_data(data);
  return message;
}

class VehicleTest : public ::testing::Test {
 protected:
  VehicleTest() {
    std::ofstream(drive_.folder() / "car.dbc") << kDbc;
    bench_.add<Vehicle>("vehicle", R"({"params": {"dbc": ")" +
                                       (drive_.folder() / "car.dbc").string() +
                                       R"(", "wheel_message": "WHEELS"}})");
  }

  testing::SmallDrive drive_{"vehicle"};
  Bench bench_;
  Bench::Input<can::Frame> frames_ = bench_.input<can::Frame>("can/frames");
  Bench::Output<vehicle::WheelSpeeds> speeds_ =
      bench_.output<vehicle::WheelSpeeds>("vehicle/wheel_speeds");
  Bench::Output<vehicle::Steering> steering_ = bench_.output<vehicle::Steering>("vehicle/steering");
};

TEST_F(VehicleTest, WheelSpeedsAreDecodedByTheFile) {
  bench_.start();

  // 0, 36, 72 and -67.67 km/h.
  frames_.publish(frame(170, 0, std::string("\x1a\x6f\x28\x7f\x36\x8f\x00\x00", 8)));

  const auto speeds = speeds_.take();
  ASSERT_EQ(speeds.size(), 1U);
  EXPECT_NEAR(speeds[0].front_right_mps(), 0.0, 1e-12);
  EXPECT_NEAR(speeds[0].front_left_mps(), 10.0, 1e-12);
  EXPECT_NEAR(speeds[0].rear_right_mps(), 20.0, 1e-12);
  EXPECT_NEAR(speeds[0].rear_left_mps(), -67.67 / 3.6, 1e-12);
  EXPECT_EQ(speeds[0].header().taken_ns(), 123);
}

TEST_F(VehicleTest, SteeringIsTheSumOfBothSignals) {
  bench_.start();

  frames_.publish(frame(37, 0, std::string("\x0f\xfe\x00\x00\xd0\x00\x00\x00", 8)));

  const auto steering = steering_.take();
  ASSERT_EQ(steering.size(), 1U);
  EXPECT_NEAR(steering[0].wheel_angle_deg(), -3.3, 1e-12);
}

TEST_F(VehicleTest, OtherBusesAndAddressesAreNotDecoded) {
  bench_.start();

  frames_.publish(frame(170, 128, std::string(8, '\0')));
  frames_.publish(frame(171, 0, std::string(8, '\0')));

  EXPECT_TRUE(speeds_.take().empty());
}

TEST_F(VehicleTest, ShortFramesAreCountedAndNotDecoded) {
  bench_.start();

  frames_.publish(frame(170, 0, std::string(7, '\0')));
  frames_.publish(frame(170, 0, ""));
  EXPECT_TRUE(speeds_.take().empty());
  bench_.stop();

  EXPECT_EQ(std::get<std::int64_t>(bench_.result("vehicle", "vehicle_short_frames")), 2);
}

TEST(Vehicle, MessageThatTheFileDoesNotHaveIsNamed) {
  const testing::SmallDrive drive("vehicle_other");
  std::ofstream(drive.folder() / "car.dbc") << kDbc;
  Bench bench;
  bench.add<Vehicle>("vehicle",
                     R"({"params": {"dbc": ")" + (drive.folder() / "car.dbc").string() + R"("}})");
  bench.start();

  const auto faults = bench.faults("vehicle");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("expected a message WHEEL_SPEEDS"), std::string::npos) << faults[0];
}

}  // namespace
}  // namespace rav4
