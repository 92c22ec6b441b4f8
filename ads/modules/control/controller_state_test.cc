#include "controller_state.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace ads {
namespace {

Path curve() {
  Path path{.start_s = 0.3, .step_s = 0.1};
  for (int index = 0; index < 40; ++index) {
    const double angle = 0.02 * index;
    path.points.push_back({.x_m = 40.0 * std::sin(angle),
                           .y_m = 40.0 - 40.0 * std::cos(angle),
                           .heading_rad = angle,
                           .curvature_per_m = 1.0 / 40.0,
                           .speed_mps = 8.0 - 0.01 * index,
                           .acceleration_mps2 = -0.1});
  }
  return path;
}

// Whatever happens at a tick of a drive; the vehicle is never quite where it is to be.
Actuation tick(Tracker& tracker, const Path& path, int number) {
  const double now = 0.02 * number;
  Motion motion{.x_m = 8.0 * (now - 0.3) + 0.1 * std::sin(number),
                .y_m = 0.3 * std::cos(0.7 * number),
                .heading_rad = 0.02 * number,
                .speed_mps = 7.0 + std::sin(0.1 * number),
                .acceleration_mps2 = -0.2,
                .steering_rad = 0.05};
  if (number % 17 == 16) {
    motion.x_m = std::numeric_limits<double>::quiet_NaN();
  }
  if (number == 60) {
    tracker.forget();
  }
  if (number > 90 && number < 100) {
    return tracker.hold(now);
  }
  return number % 50 > 40 ? tracker.brake(path, motion, now - 0.01, now, 3.0)
                          : tracker.follow(path, motion, now - 0.01, now);
}

control::TrackerMemory saved(const Tracker& tracker) {
  control::TrackerMemory message;
  write(tracker.memory(), message);
  return message;
}

TEST(ControllerState, ATrackerThatWasSavedAndLoadedGoesOnAsTheOtherOne) {
  const Path path = curve();
  TrackerConfig config;
  config.acceleration_lag_s = 0.3;
  for (const int saved_at : {0, 1, 7, 17, 43, 55, 60, 61, 95, 110}) {
    Tracker tracker(config);
    for (int number = 0; number < saved_at; ++number) {
      tick(tracker, path, number);
    }
    Tracker other(config);
    other.set_memory(read(saved(tracker)));

    for (int number = saved_at; number < 150; ++number) {
      EXPECT_EQ(tick(other, path, number), tick(tracker, path, number))
          << "saved before tick " << saved_at << ", tick " << number;
      // Errors may be no numbers, which are not equal to themselves.
      EXPECT_EQ(saved(other).SerializeAsString(), saved(tracker).SerializeAsString());
    }
  }
}

TEST(ControllerState, APathComesBackAsItWas) {
  const Path path = curve();
  control::Path message;
  write(path, message);

  EXPECT_EQ(read(message), path);
}

TEST(ControllerState, APathThatCannotBeFollowedIsRefused) {
  control::Path message;
  EXPECT_THROW(read(message), std::invalid_argument);

  message.add_points();
  message.set_step_s(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THROW(read(message), std::invalid_argument);
}

}  // namespace
}  // namespace ads
