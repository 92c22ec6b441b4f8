#include "control.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

class ControlTest : public ::testing::Test {
 protected:
  ControlTest() { bench_.add<Control>("control", R"({"serve_period_ms": 20})"); }

  void SetUp() override { bench_.start(); }

  std::int64_t now_ns() { return bench_.now().time_since_epoch().count(); }

  void send_state(supervision::DrivingState driving) {
    driving_ = driving;
    supervision::State state;
    state.set_state(driving);
    states_.publish(state);
  }
  void send_ego(double x_m, double y_m, double speed_mps) {
    localization::Ego ego;
    ego.mutable_header()->set_taken_ns(now_ns());
    ego.set_x_m(x_m);
    ego.set_y_m(y_m);
    ego.set_speed_mps(speed_mps);
    ego.set_quality(localization::GOOD);
    egos_.publish(ego);
    vehicle::State vehicle;
    vehicle.mutable_header()->set_taken_ns(now_ns());
    vehicle.set_speed_mps(speed_mps);
    vehicles_.publish(vehicle);
  }
  // Along x at a constant acceleration, from where the vehicle is.
  void write(planning::Trajectory& trajectory, double acceleration_mps2) {
    trajectory.set_start_ns(now_ns());
    for (int index = 0; index <= 60; ++index) {
      const double time = 0.1 * index;
      const double driven =
          std::min(time, acceleration_mps2 < 0.0 ? 10.0 / -acceleration_mps2 : 1e9);
      planning::TrajectoryPoint& point = *trajectory.add_points();
      point.set_time_s(time);
      point.set_x_m(10.0 * driven + 0.5 * acceleration_mps2 * driven * driven);
      point.set_speed_mps(10.0 + acceleration_mps2 * driven);
      point.set_acceleration_mps2(driven < time ? 0.0 : acceleration_mps2);
    }
  }
  void send_plan(double acceleration_mps2 = 0.0) {
    planning::Plan plan;
    write(*plan.mutable_nominal(), acceleration_mps2);
    write(*plan.mutable_minimal_risk(), -4.0);
    plans_.publish(plan);
  }
  control::Command last_command() {
    bench_.advance(20ms);
    const auto commands = commands_.take();
    return commands.empty() ? control::Command() : commands.back();
  }

  supervision::DrivingState driving_ = supervision::OFF;
  Bench bench_;
  Bench::Input<planning::Plan> plans_ = bench_.input<planning::Plan>("planning/checked_plan");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<vehicle::State> vehicles_ = bench_.input<vehicle::State>("vehicle/state");
  Bench::Input<supervision::State> states_ = bench_.input<supervision::State>("supervision/state");
  Bench::Output<control::Command> commands_ = bench_.output<control::Command>("control/command");
};

TEST_F(ControlTest, SaysNothingWithoutAPlan) {
  send_ego(0.0, 0.0, 10.0);
  send_state(supervision::ENGAGED);
  bench_.advance(100ms);

  EXPECT_TRUE(commands_.take().empty());
}

TEST_F(ControlTest, CommandsFiftyTimesASecond) {
  send_ego(0.0, 0.0, 10.0);
  send_plan();
  bench_.advance(200ms);

  EXPECT_EQ(commands_.take().size(), 10U);
}

TEST_F(ControlTest, IsReadyBeforeItDrives) {
  send_ego(0.0, 0.0, 10.0);
  send_plan(1.0);
  const control::Command command = last_command();

  EXPECT_FALSE(command.is_autonomous());
  EXPECT_NEAR(command.acceleration_mps2(), 1.0, 0.3);
}

TEST_F(ControlTest, FollowsThePlan) {
  send_ego(0.0, 0.0, 10.0);
  send_plan(1.0);
  send_state(supervision::ENGAGED);
  const control::Command command = last_command();

  EXPECT_TRUE(command.is_autonomous());
  EXPECT_NEAR(command.acceleration_mps2(), 1.0, 0.3);
  EXPECT_NEAR(command.steering_rad(), 0.0, 1e-9);
}

TEST_F(ControlTest, SteersBackToThePlan) {
  send_ego(0.0, 0.5, 10.0);
  send_plan();
  send_state(supervision::ENGAGED);
  const control::Command command = last_command();

  EXPECT_LT(command.steering_rad(), 0.0);
  EXPECT_NEAR(command.lateral_error_m(), 0.5, 1e-6);
}

TEST_F(ControlTest, TakesTheMinimalRiskTrajectoryWhenItIsRequested) {
  send_ego(0.0, 0.0, 10.0);
  send_plan();
  send_state(supervision::MINIMAL_RISK_STOP);

  EXPECT_LT(last_command().acceleration_mps2(), -3.0);
}

TEST_F(ControlTest, StaysWithItsStopWhenNewerOnesBeginElsewhere) {
  send_ego(0.0, 0.0, 10.0);
  send_plan();
  send_state(supervision::MINIMAL_RISK_STOP);
  last_command();
  // As if the plans did not know that the vehicle stops.
  bench_.advance(400ms);
  send_ego(3.8, 0.0, 8.3);
  send_plan();

  EXPECT_LT(last_command().acceleration_mps2(), -3.0);
}

TEST_F(ControlTest, StopsAlthoughEachNewStopBeginsWithDrivingOn) {
  send_ego(0.0, 0.0, 10.0);
  send_plan();
  send_state(supervision::MINIMAL_RISK_STOP);
  last_command();
  bench_.advance(100ms);
  planning::Plan plan;
  write(*plan.mutable_nominal(), 0.0);
  write(*plan.mutable_minimal_risk(), -2.0);
  for (auto* trajectory : {plan.mutable_nominal(), plan.mutable_minimal_risk()}) {
    for (planning::TrajectoryPoint& point : *trajectory->mutable_points()) {
      point.set_x_m(point.x_m() + 1.0);
    }
  }
  send_ego(1.0, 0.0, 10.0);
  plans_.publish(plan);

  EXPECT_LT(last_command().acceleration_mps2(), -3.0) << "the later stop is not gone over to";
}

// A vehicle whose wheels and pedals obey at once begins a minimal-risk stop beside its line.
class Stop : public ControlTest {
 public:
  void TestBody() override {}

  explicit Stop(bool has_localization) {
    SetUp();
    send_state(supervision::ENGAGED);
    send_ego(kLever_m, y_m, speed_mps);
    send_plan();
    for (int tick = 0; tick < 250; ++tick) {
      if (tick == kStopTick) {
        send_state(supervision::MINIMAL_RISK_STOP);
      }
      drive(last_command());
      if (tick < kStopTick || has_localization) {
        localization::Ego ego;
        ego.mutable_header()->set_taken_ns(now_ns());
        ego.set_x_m(x_m + kLever_m * std::cos(heading_rad));
        ego.set_y_m(y_m + kLever_m * std::sin(heading_rad));
        ego.set_heading_rad(heading_rad);
        ego.set_speed_mps(speed_mps);
        ego.set_quality(localization::GOOD);
        egos_.publish(ego);
      }
    }
  }

  // Of the rear axle.
  double x_m = 0.0;
  double y_m = 0.8;
  double heading_rad = 0.0;
  double speed_mps = 10.0;

 private:
  static constexpr double kWheelbase_m = 2.58;
  static constexpr double kLever_m = 1.29;
  static constexpr int kStopTick = 25;

  void drive(const control::Command& command) {
    speed_mps = std::max(0.0, speed_mps + 0.02 * command.acceleration_mps2());
    heading_rad += 0.02 * speed_mps * std::tan(command.steering_rad()) / kWheelbase_m;
    x_m += 0.02 * speed_mps * std::cos(heading_rad);
    y_m += 0.02 * speed_mps * std::sin(heading_rad);
    vehicle::State vehicle;
    vehicle.mutable_header()->set_taken_ns(now_ns());
    vehicle.set_speed_mps(speed_mps);
    vehicle.set_steering_rad(command.steering_rad());
    vehicle.set_acceleration_mps2(command.acceleration_mps2());
    vehicles_.publish(vehicle);
  }
};

TEST(ControlWithoutLocalization, StopsWhereItWouldWithIt) {
  const Stop with(true);
  const Stop without(false);

  EXPECT_EQ(without.speed_mps, 0.0);
  EXPECT_NEAR(without.x_m, with.x_m, 0.1);
  EXPECT_NEAR(without.y_m, with.y_m, 0.02);
  EXPECT_NEAR(without.heading_rad, with.heading_rad, 0.01);
}

TEST_F(ControlTest, StopsAloneWhenSupervisionIsSilent) {
  send_ego(0.0, 0.0, 10.0);
  send_plan();
  send_state(supervision::ENGAGED);
  EXPECT_FALSE(last_command().is_stopping_alone());
  bench_.advance(200ms);
  send_ego(2.2, 0.0, 10.0);
  send_plan();
  const control::Command silent = last_command();
  EXPECT_TRUE(silent.is_stopping_alone());
  EXPECT_TRUE(silent.is_autonomous());
  bench_.advance(100ms);
  EXPECT_LT(last_command().acceleration_mps2(), -2.0);

  send_state(supervision::ENGAGED);
  EXPECT_FALSE(last_command().is_stopping_alone());
}

TEST_F(ControlTest, AVehicleThatIsDrivenDoesNotStopWhenSupervisionIsSilent) {
  send_ego(0.0, 0.0, 10.0);
  send_plan();
  send_state(supervision::AVAILABLE);
  bench_.advance(400ms);
  const control::Command command = last_command();

  EXPECT_FALSE(command.is_autonomous());
  EXPECT_FALSE(command.is_stopping_alone());
}

TEST_F(ControlTest, HoldsTheBrakeWhenStopped) {
  send_ego(0.0, 0.0, 0.0);
  send_plan();
  send_state(supervision::STOPPED);

  EXPECT_LT(last_command().acceleration_mps2(), -1.0);
}

TEST_F(ControlTest, BrakesWhenNoPlanComesAnyMore) {
  send_ego(0.0, 0.0, 10.0);
  send_plan();
  send_state(supervision::ENGAGED);
  for (int count = 0; count < 7; ++count) {
    bench_.advance(100ms);
    send_state(supervision::ENGAGED);
  }
  send_ego(7.0, 0.0, 10.0);

  EXPECT_NEAR(last_command().acceleration_mps2(), -3.0, 0.1);
}

TEST_F(ControlTest, NumbersThatAreNoneNeverComeOut) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  send_ego(0.0, 0.0, 10.0);
  send_plan();
  send_state(supervision::ENGAGED);
  bench_.advance(40ms);
  send_ego(kNaN, 0.0, 10.0);
  bench_.advance(40ms);
  send_ego(0.4, 0.0, 10.0);
  planning::Plan plan;
  write(*plan.mutable_nominal(), kNaN);
  write(*plan.mutable_minimal_risk(), kNaN);
  plans_.publish(plan);
  bench_.advance(40ms);

  const auto commands = commands_.take();
  ASSERT_EQ(commands.size(), 6U);
  for (const control::Command& command : commands) {
    EXPECT_TRUE(std::isfinite(command.steering_rad()));
    EXPECT_TRUE(std::isfinite(command.acceleration_mps2()));
  }
}

/// Control that throws when it is asked to.
class FaultyControl final : public fastcycle::Component {
 public:
  explicit FaultyControl(fastcycle::Context& context) : Component(context), control_(context) {
    context.create_subscriber<common::Header>(
        "test/fault", [](const common::Header&) { throw std::runtime_error("the test wants it"); });
  }
  void serve() override { control_.serve(); }
  void stop() override { control_.stop(); }

 private:
  Control control_;
};

/// Beside the other one, on the same inputs.
class FaultyControlTest : public ControlTest {
 protected:
  FaultyControlTest() {
    bench_.add<FaultyControl>("faulty", R"({"serve_period_ms": 20, "on_fault": "restart",
        "restart": {"limit": 100}, "remap": {"control/command": "faulty/command"}})");
  }

  void fault_and_run(std::chrono::milliseconds span) {
    faults_.publish({});
    for (; span > 0ms; span -= 100ms) {
      send_state(driving_);
      bench_.advance(100ms);
    }
  }

  void expect_same_commands() {
    const auto commands = commands_.take();
    const auto faulty_commands = faulty_commands_.take();
    ASSERT_EQ(faulty_commands.size(), commands.size());
    for (std::size_t i = 0; i < commands.size(); ++i) {
      EXPECT_EQ(faulty_commands[i].SerializeAsString(), commands[i].SerializeAsString())
          << "command " << i << ": " << faulty_commands[i].ShortDebugString() << "\n"
          << commands[i].ShortDebugString();
    }
  }

  Bench::Input<common::Header> faults_ = bench_.input<common::Header>("test/fault");
  Bench::Output<control::Command> faulty_commands_ =
      bench_.output<control::Command>("faulty/command");
};

TEST_F(FaultyControlTest, AnObjectThatIsMadeAnewGoesOnAsTheOldOneWouldHave) {
  fault_and_run(100ms);
  send_ego(0.0, 0.2, 9.0);
  send_plan(1.0);
  fault_and_run(100ms);
  send_state(supervision::ENGAGED);
  bench_.advance(100ms);
  fault_and_run(100ms);
  send_ego(1.9, 0.1, 9.2);
  fault_and_run(300ms);
  send_ego(4.0, 0.1, 9.2);
  fault_and_run(100ms);  // The plan is stale.
  fault_and_run(100ms);
  send_ego(6.0, 0.0, 9.0);
  send_plan();
  bench_.advance(60ms);
  send_state(supervision::MINIMAL_RISK_STOP);
  bench_.advance(100ms);
  fault_and_run(300ms);
  send_plan();  // It begins elsewhere: the stop is gone on with.
  fault_and_run(100ms);
  send_ego(9.0, 0.1, 4.0);
  fault_and_run(100ms);
  send_state(supervision::STOPPED);
  fault_and_run(100ms);
  expect_same_commands();
  bench_.stop();

  EXPECT_EQ(bench_.faults("faulty").size(), 10);
  for (const char* const name : {"lateral_error_max_m", "along_error_max_m", "commands_stale"}) {
    EXPECT_EQ(bench_.result("faulty", name), bench_.result("control", name)) << name;
  }
  EXPECT_GT(std::get<std::int64_t>(bench_.result("control", "commands_stale")), 5);
}

}  // namespace
}  // namespace ads
