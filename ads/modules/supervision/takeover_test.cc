#include "takeover.h"

#include <gtest/gtest.h>

namespace ads {
namespace {

TEST(Takeover, ByTheButtonOrTheBrakeIsAtOnce) {
  Takeover takeover({});

  EXPECT_FALSE(takeover.look_at({.time_s = 1.0, .brake_pedal = 0.05}));
  const auto brake = takeover.look_at({.time_s = 1.0, .brake_pedal = 0.2});
  const auto button = takeover.look_at({.time_s = 1.0, .has_pressed_button = true});

  ASSERT_TRUE(brake && button);
  EXPECT_EQ(brake->cause, supervision::TAKEOVER_BRAKE);
  EXPECT_EQ(brake->reason, "the driver took over: the brake pedal is pressed by 20 %, more than 5");
  EXPECT_EQ(button->cause, supervision::TAKEOVER_BUTTON);
}

TEST(Takeover, ByTheSteeringWheelLasts) {
  Takeover takeover({});

  EXPECT_FALSE(takeover.look_at({.time_s = 1.00, .steering_torque_nm = -3.5}));
  EXPECT_FALSE(takeover.look_at({.time_s = 1.01, .steering_torque_nm = -3.5}));
  EXPECT_FALSE(takeover.look_at({.time_s = 1.02, .steering_torque_nm = 2.9}));
  EXPECT_FALSE(takeover.look_at({.time_s = 1.03, .steering_torque_nm = 4.0}));
  EXPECT_FALSE(takeover.look_at({.time_s = 1.05, .steering_torque_nm = 4.0}));
  const auto found = takeover.look_at({.time_s = 1.06, .steering_torque_nm = 4.0});

  ASSERT_TRUE(found);
  EXPECT_EQ(found->cause, supervision::TAKEOVER_STEERING);
  EXPECT_EQ(found->reason,
            "the driver took over: 4.0 Nm on the steering wheel for 30 ms, more than 3.0");
}

}  // namespace
}  // namespace ads
