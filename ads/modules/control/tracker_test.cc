#include "tracker.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <utility>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The vehicle that the tracker reckons with: dead time, no lag.
class Car {
 public:
  explicit Car(const Motion& motion, double steering_gain = 1.0, double resistance_mps2 = 0.0)
      : motion_(motion), steering_gain_(steering_gain), resistance_mps2_(resistance_mps2) {}

  void take(double time_s, const Actuation& command) { commands_.push_back({time_s, command}); }
  void advance(double time_s) {
    constexpr double kStep_s = 0.01;
    const TrackerConfig config;
    for (const auto& [given_s, command] : commands_) {
      if (given_s <= time_s - config.steering_delay_s + 1e-9) {
        demand_ = command;
      }
    }
    const double turn = config.steering_rate_max_radps * kStep_s;
    motion_.steering_rad += std::clamp(demand_.steering_rad - motion_.steering_rad, -turn, turn);
    motion_.acceleration_mps2 = demand_.acceleration_mps2 - resistance_mps2_;
    const double lever = config.centre_to_rear_axle_m;
    const double yaw =
        motion_.speed_mps * std::tan(steering_gain_ * motion_.steering_rad) / config.wheelbase_m;
    motion_.x_m += kStep_s * (motion_.speed_mps * std::cos(motion_.heading_rad) -
                              lever * yaw * std::sin(motion_.heading_rad));
    motion_.y_m += kStep_s * (motion_.speed_mps * std::sin(motion_.heading_rad) +
                              lever * yaw * std::cos(motion_.heading_rad));
    motion_.heading_rad += kStep_s * yaw;
    motion_.speed_mps = std::max(0.0, motion_.speed_mps + kStep_s * motion_.acceleration_mps2);
  }
  [[nodiscard]] const Motion& motion() const { return motion_; }

 private:
  Motion motion_;
  double steering_gain_;
  double resistance_mps2_;
  Actuation demand_;
  std::deque<std::pair<double, Actuation>> commands_;
};

// At constant speed along x until 20 m, then around a circle of 25 m radius.
Path curve(double speed_mps, double deceleration_mps2 = 0.0) {
  Path path;
  double driven = 0.0;
  double speed = speed_mps;
  for (int index = 0; index < 120; ++index) {
    const double angle = std::max(0.0, driven - 20.0) / 25.0;
    const double heading = angle;
    // The rear axle is on the line.
    path.points.push_back(
        {.x_m = std::min(driven, 20.0) + 25.0 * std::sin(angle) + 1.29 * std::cos(heading),
         .y_m = 25.0 - 25.0 * std::cos(angle) + 1.29 * std::sin(heading),
         .heading_rad = heading,
         .curvature_per_m = angle > 0.0 ? 1.0 / 25.0 : 0.0,
         .speed_mps = speed,
         .acceleration_mps2 = speed > 0.0 ? -deceleration_mps2 : 0.0});
    const double next = std::max(0.0, speed - deceleration_mps2 * path.step_s);
    driven += 0.5 * (speed + next) * path.step_s;
    speed = next;
  }
  return path;
}

struct Largest {
  double lateral_m = 0.0;
  double along_m = 0.0;
};

Largest follow(const Path& path, Car& car, double from_s, double until_s, double judged_from_s,
               const TrackerConfig& config = {}) {
  Tracker tracker{config};
  Largest largest;
  for (int tick = 0; 0.01 * tick < until_s; ++tick) {
    const double now = from_s + 0.01 * tick;
    if (tick % 2 == 0) {
      car.take(now, tracker.follow(path, car.motion(), now, now));
    }
    car.advance(now);
    if (now > judged_from_s) {
      const Reference wanted = path.at(now + 0.01);
      const double dx = car.motion().x_m - wanted.x_m;
      const double dy = car.motion().y_m - wanted.y_m;
      const double along = dx * std::cos(wanted.heading_rad) + dy * std::sin(wanted.heading_rad);
      const double lateral = -dx * std::sin(wanted.heading_rad) + dy * std::cos(wanted.heading_rad);
      largest.along_m = std::max(largest.along_m, std::abs(along));
      largest.lateral_m = std::max(largest.lateral_m, std::abs(lateral));
    }
  }
  return largest;
}

TEST(Path, NearestPointLiesOnItsLine) {
  const Path path{.points = {{.x_m = 0.0}, {.x_m = 10.0}, {.x_m = 10.0}}};

  EXPECT_NEAR(path.nearest(3.0, 2.0).x_m, 3.0, 1e-9);
  EXPECT_NEAR(path.nearest(-3.0, 2.0).x_m, 0.0, 1e-9);
}

TEST(Path, GoesOnAsItEnded) {
  const Path path{.points = {{.x_m = 0.0, .speed_mps = 5.0}, {.x_m = 0.5, .speed_mps = 5.0}}};

  EXPECT_NEAR(path.at(1.1).x_m, 5.5, 1e-9);
  EXPECT_EQ(path.at(-1.0).x_m, 0.0);
}

TEST(Tracker, FollowsACurve) {
  Car car({.x_m = 1.29, .speed_mps = 7.0});
  const Largest largest = follow(curve(7.0), car, 0.0, 8.0, 0.0);

  EXPECT_LT(largest.lateral_m, 0.15);
  EXPECT_LT(largest.along_m, 0.1);
}

TEST(Tracker, ErrorsFade) {
  Car car({.x_m = 0.5, .y_m = 0.6, .heading_rad = -0.05, .speed_mps = 11.0});
  const Largest largest = follow(curve(12.0), car, 0.0, 9.0, 6.0);

  EXPECT_LT(largest.lateral_m, 0.2);
  EXPECT_LT(largest.along_m, 0.15);
}

// A car that is not as the controller takes it for: its error lasts unless something makes it good.
TEST(Tracker, ErrorsOfTheModelFadeToo) {
  const auto error_with = [](double integral) {
    TrackerConfig config;
    config.lateral_integral = integral;
    config.along_integral = integral;
    Car car({.x_m = 1.29, .speed_mps = 7.0}, 0.9, 0.3);
    return follow(curve(7.0), car, 0.0, 11.5, 10.0, config);
  };
  const Largest without = error_with(0.0);
  const Largest with = error_with(0.1);

  EXPECT_LT(with.lateral_m, 0.6 * without.lateral_m);
  EXPECT_LT(with.along_m, 0.4 * without.along_m);
}

TEST(Tracker, StopsAndStays) {
  Car car({.x_m = 1.29, .speed_mps = 8.0});
  const Path path = curve(8.0, 2.5);
  follow(path, car, 0.0, 6.0, 0.0);

  EXPECT_EQ(car.motion().speed_mps, 0.0);
  EXPECT_NEAR(car.motion().x_m, path.points.back().x_m, 0.2);
}

TEST(Tracker, BrakesOnItsLineWhateverTheTime) {
  Car car({.x_m = 1.29, .speed_mps = 8.0});
  const Path path = curve(8.0);
  Tracker tracker{TrackerConfig{}};
  for (int tick = 0; tick < 500; ++tick) {
    const double now = 3.0 + 0.01 * tick;  // Long after the path's start.
    if (tick % 2 == 0) {
      car.take(now, tracker.brake(path, car.motion(), now, now, 1.0));
    }
    car.advance(now);
  }

  const Reference nearest = path.nearest(car.motion().x_m, car.motion().y_m);
  EXPECT_LT(std::hypot(nearest.x_m - car.motion().x_m, nearest.y_m - car.motion().y_m), 0.15);
  EXPECT_LT(car.motion().speed_mps, 3.5);
}

TEST(Tracker, CommandsChangeNoFasterThanTheyMay) {
  const TrackerConfig config;
  Tracker tracker(config);
  const Path path = curve(10.0);
  Actuation last = tracker.follow(path, {.y_m = 3.0, .speed_mps = 2.0}, 0.0, 0.0);
  for (int tick = 1; tick < 50; ++tick) {
    const double side = tick % 10 < 5 ? -3.0 : 3.0;
    const double now = 0.02 * tick;
    const Actuation command =
        tracker.follow(path, {.y_m = side, .speed_mps = 5.0 + side}, now, now);

    EXPECT_LE(std::abs(command.steering_rad - last.steering_rad),
              config.steering_rate_max_radps * 0.02 + 1e-9);
    EXPECT_LE(std::abs(command.acceleration_mps2 - last.acceleration_mps2),
              config.jerk_max_mps3 * 0.02 + 1e-9);
    EXPECT_GE(command.acceleration_mps2, config.acceleration_min_mps2);
    EXPECT_LE(command.acceleration_mps2, config.acceleration_max_mps2);
    last = command;
  }
}

TEST(Tracker, NumbersThatAreNoneNeverComeOut) {
  Tracker tracker{TrackerConfig{}};
  const Path path = curve(10.0);
  const Actuation good = tracker.follow(path, {.speed_mps = 8.0}, 0.0, 0.0);
  const Actuation bad = tracker.follow(path, {.x_m = kNaN, .speed_mps = 8.0}, 0.02, 0.02);

  EXPECT_EQ(bad.steering_rad, good.steering_rad);
  EXPECT_EQ(bad.acceleration_mps2, good.acceleration_mps2);
}

TEST(Tracker, HoldsTheBrake) {
  Tracker tracker{TrackerConfig{}};

  EXPECT_LT(tracker.hold(0.0).acceleration_mps2, -1.0);
}

}  // namespace
}  // namespace ads
