#include "world.h"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "small_scenario.h"

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;
using ::testing::Contains;
using testing::SmallScenario;
using ::testing::StartsWith;

const std::filesystem::path kAds = ADS_DIR;

// A world with a scenario, and someone who sends it commands.
class WorldTest : public ::testing::Test {
 protected:
  ~WorldTest() override { std::filesystem::remove_all(folder_); }

  void start(const SmallScenario& scenario, std::string_view params = "") {
    std::ofstream(folder_ / "scenario.xml") << scenario.xml();
    start(folder_ / "scenario.xml", params);
  }

  void start(const std::filesystem::path& scenario, std::string_view params = "") {
    bench_.add<World>("world",
                      fmt::format(R"({{"params": {{"scenario": "{}", "dbc": "{}",
                                               "trajectory": "{}"{}}}}})",
                                  scenario.string(), (kAds / "modules/vehicle/ego.dbc").string(),
                                  way_.string(), params));
    bench_.start();
  }

  [[nodiscard]] can::Frame command(double steering_rad, double acceleration_mps2,
                                   bool is_autonomous = true) {
    std::array<std::uint8_t, 8> payload{};
    const DbcMessage& message = dbc_.message("ADS_COMMAND");
    message.signal("STEERING").encode(steering_rad, payload);
    message.signal("ACCELERATION").encode(acceleration_mps2, payload);
    message.signal("AUTONOMOUS").encode(is_autonomous ? 1.0 : 0.0, payload);
    guard_.seal(payload);
    can::Frame frame;
    frame.set_address(message.address);
    frame.set_data(payload.data(), payload.size());
    return frame;
  }

  // Sends a command each 20 ms.
  void drive(fastcycle::Duration span, double steering_rad, double acceleration_mps2) {
    for (fastcycle::Duration done{}; done < span; done += 20ms) {
      commands_.publish(command(steering_rad, acceleration_mps2));
      bench_.advance(20ms);
    }
  }

  [[nodiscard]] world::Scene last_scene() {
    const auto scenes = scenes_.take();
    return scenes.empty() ? world::Scene() : scenes.back();
  }

  [[nodiscard]] std::vector<std::string> rows() const {
    std::ifstream file(folder_ / "way.csv");
    std::vector<std::string> lines;
    for (std::string line; std::getline(file, line);) {
      lines.push_back(line);
    }
    return lines;
  }

  template <typename T>
  [[nodiscard]] T result(const std::string& name) const {
    return std::get<T>(bench_.result("world", name));
  }

  std::filesystem::path folder_ = [] {
    const auto folder =
        std::filesystem::temp_directory_path() / fmt::format("world_test_{}", ::getpid());
    std::filesystem::create_directories(folder);
    return folder;
  }();
  std::filesystem::path way_ = folder_ / "way.csv";
  Dbc dbc_ = Dbc::read(kAds / "modules/vehicle/ego.dbc");
  FrameGuard guard_{dbc_.message("ADS_COMMAND")};
  Bench bench_;
  Bench::Input<can::Frame> commands_ = bench_.input<can::Frame>("can/command");
  Bench::Output<world::Scene> scenes_ = bench_.output<world::Scene>("world/scene");
  Bench::Output<can::Frame> states_ = bench_.output<can::Frame>("can/state");
};

TEST_F(WorldTest, AVehicleThatDeviatesMeasuresAnotherSpeedThanItHas) {
  start(SmallScenario().ego(10.0).goal(50.0, 40, 50), R"(, "deviation": 1.0, "seed": 2)");
  bench_.advance(100ms);

  const auto frames = states_.take();
  ASSERT_FALSE(frames.empty());
  const std::string& data = frames.back().data();
  const double measured =
      dbc_.message("VEHICLE_STATE")
          .signal("SPEED")
          .decode({reinterpret_cast<const std::uint8_t*>(data.data()), data.size()});

  bench_.stop();
  const double gain = result<double>("deviation.speed_gain");
  EXPECT_NE(gain, 1.0);
  EXPECT_NEAR(measured, 10.0 * gain, 0.01);
}

TEST_F(WorldTest, WhatStandsBesideTheRoadIsInTheScene) {
  start(SmallScenario().goal(50.0, 40, 50), R"(, "clutter": 1.0)");
  bench_.advance(20ms);

  const world::Scene scene = last_scene();

  ASSERT_GT(scene.bodies_size(), 5);
  EXPECT_LT(scene.bodies(0).id(), 0);
}

TEST_F(WorldTest, SceneComesAHundredTimesASecondWithTheTimeThatItHoldsFor) {
  start(SmallScenario().car(5, 20.0, 3.5, 8.0, 50).standing(6, 60.0, 0.0).goal(50.0, 40, 50));
  const std::int64_t start_ns = bench_.now().time_since_epoch().count();
  bench_.advance(100ms);

  const auto scenes = scenes_.take();

  ASSERT_EQ(scenes.size(), 10U);
  EXPECT_EQ(scenes[4].header().taken_ns(), start_ns + 50'000'000);
  EXPECT_EQ(scenes[4].header().frame(), "map");
  EXPECT_EQ(scenes[4].ego().length_m(), 4.508);
  ASSERT_EQ(scenes[4].bodies_size(), 2);
  EXPECT_EQ(scenes[4].bodies(0).id(), 6);
  EXPECT_EQ(scenes[4].bodies(1).id(), 5);
  EXPECT_EQ(scenes[4].bodies(1).speed_mps(), 8.0);
  EXPECT_EQ(states_.take().size(), 10U);
}

TEST_F(WorldTest, DriveBeginsWithExactlyTheInitialState) {
  start(kAds / "data/commonroad/USA_US101-23_1_T-1.xml");
  bench_.advance(1s);
  const auto before = last_scene();
  bench_.advance(1s);
  const auto begin = last_scene();

  // A second before, as far behind on its lane as a second takes.
  EXPECT_NEAR(std::hypot(before.ego().x_m(), before.ego().y_m()), 16.8859, 0.05);
  EXPECT_EQ(begin.ego().x_m(), 0.0);
  EXPECT_EQ(begin.ego().y_m(), 0.0);
  EXPECT_EQ(begin.ego().heading_rad(), -0.71162);
  EXPECT_EQ(begin.ego().speed_mps(), 16.8859);
  EXPECT_EQ(begin.bodies_size(), 57);
  ASSERT_EQ(rows().size(), 2U);
  EXPECT_EQ(rows()[0], "time_s,x_m,y_m,heading_rad,speed_mps");
  EXPECT_EQ(rows()[1], "0.0,0,0,-0.71162,16.8859");
}

TEST_F(WorldTest, CommandsBeforeTheDriveAreNotObeyed) {
  start(SmallScenario().goal(50.0, 40, 50));
  drive(2s, 0.1, -3.0);
  bench_.advance(1s);

  const auto scene = last_scene();

  EXPECT_NEAR(scene.ego().x_m(), 10.0, 1e-9);
  EXPECT_EQ(scene.ego().y_m(), 0.0);
  EXPECT_EQ(scene.ego().speed_mps(), 10.0);
}

TEST_F(WorldTest, CommandsMoveTheVehicleAfterItsDelay) {
  start(SmallScenario().goal(50.0, 40, 50));
  bench_.advance(2s);
  drive(1s, 0.05, -2.0);

  const auto scene = last_scene();

  EXPECT_NEAR(scene.ego().speed_mps(), 10.0 - 2.0 * 0.9, 1e-9);
  EXPECT_NEAR(scene.ego_steering_rad(), 0.05, 1e-9);
  EXPECT_GT(scene.ego().heading_rad(), 0.05);
  EXPECT_GT(scene.ego().y_m(), 0.1);
  EXPECT_NEAR(scene.ego_acceleration_mps2(), -2.0, 1e-9);
}

TEST_F(WorldTest, StateOnTheBusIsThatOfTheVehicle) {
  start(SmallScenario().goal(50.0, 40, 50));
  bench_.advance(2s);
  drive(1s, 0.05, -2.0);
  const auto scene = last_scene();
  const auto frames = states_.take();
  FrameGuard guard(dbc_.message("VEHICLE_STATE"));

  for (const can::Frame& frame : frames) {
    const std::span payload(reinterpret_cast<const std::uint8_t*>(frame.data().data()),
                            frame.data().size());
    ASSERT_EQ(frame.address(), 513U);
    ASSERT_EQ(guard.check(payload), FrameGuard::Verdict::kGood);
  }
  EXPECT_EQ(guard.lost(), 0U);
  const std::span payload(reinterpret_cast<const std::uint8_t*>(frames.back().data().data()), 8);
  const DbcMessage& state = dbc_.message("VEHICLE_STATE");
  EXPECT_NEAR(state.signal("SPEED").decode(payload), scene.ego().speed_mps(), 0.001);
  EXPECT_NEAR(state.signal("STEERING").decode(payload), scene.ego_steering_rad(), 5e-5);
  EXPECT_NEAR(state.signal("ACCELERATION").decode(payload), -2.0, 0.005);
  EXPECT_EQ(state.signal("AUTONOMOUS").decode(payload), 1.0);
}

TEST_F(WorldTest, FramesThatAreWrongOrRepeatedAreNotObeyed) {
  start(SmallScenario().goal(50.0, 40, 50));
  bench_.advance(2s);
  can::Frame wrong = command(0.0, -4.0);
  (*wrong.mutable_data())[0] = '\x55';
  commands_.publish(wrong);
  const can::Frame brake = command(0.0, -4.0, false);
  commands_.publish(brake);
  commands_.publish(brake);
  can::Frame other = command(0.0, -4.0);
  other.set_address(99);
  commands_.publish(other);
  bench_.advance(500ms);
  EXPECT_EQ(last_scene().ego().speed_mps(), 10.0);
  bench_.stop();

  EXPECT_EQ(result<std::int64_t>("commands"), 3);
  EXPECT_EQ(result<std::int64_t>("commands_refused"), 2);
}

TEST_F(WorldTest, VehicleBrakesByItselfWhenCommandsCease) {
  start(SmallScenario().goal(500.0, 90, 100));
  bench_.advance(2s);
  drive(1s, 0.0, 0.0);
  bench_.advance(1s);

  EXPECT_NEAR(last_scene().ego().speed_mps(), 10.0 - 4.0 * 0.42, 0.1);
  bench_.advance(4s);
  EXPECT_EQ(last_scene().ego().speed_mps(), 0.0);
}

TEST_F(WorldTest, DriveToTheGoalIsReported) {
  start(SmallScenario().car(5, 60.0, 3.5, 10.0, 100).standing(6, 80.0, 0.0).goal(50.0, 40, 60));
  bench_.advance(2s);
  drive(7s, 0.0, 0.0);
  bench_.stop();

  EXPECT_EQ(result<std::string>("verdict"), "reached the goal at 4.8 s");
  EXPECT_TRUE(result<bool>("goal_reached"));
  EXPECT_NEAR(result<double>("goal_time_s"), 4.8, 1e-9);
  EXPECT_EQ(result<std::int64_t>("collisions"), 0);
  // To the car that stands, at the goal: what comes after does not count.
  EXPECT_EQ(result<std::int64_t>("smallest_gap_to"), 6);
  EXPECT_NEAR(result<double>("smallest_gap_m"), 80.0 - 2.0 - 48.0 - 2.254, 1e-6);
  EXPECT_EQ(result<double>("off_road_s"), 0.0);
  EXPECT_EQ(rows().size(), 1U + 49U);
  EXPECT_EQ(rows().back().substr(0, 4), "4.8,");
}

TEST_F(WorldTest, DriveThatHitsSomethingHasFailed) {
  start(SmallScenario().standing(6, 30.0, 0.5).goal(50.0, 40, 60));
  bench_.advance(9s);
  bench_.stop();

  EXPECT_EQ(result<std::int64_t>("collisions"), 1);
  EXPECT_TRUE(result<bool>("goal_reached"));
  EXPECT_EQ(result<std::string>("verdict"), "failed: touched 6 at 2.58 s, at (25.8, 0.0)");
}

TEST_F(WorldTest, WayIsWrittenToTheEndOfTheGoalsWindow) {
  start(SmallScenario().goal(500.0, 10, 20));
  bench_.advance(8s);
  bench_.stop();

  EXPECT_EQ(rows().size(), 1U + 21U);
  EXPECT_FALSE(result<bool>("goal_reached"));
}

TEST_F(WorldTest, ReactiveCarDoesNotRunIntoAnEgoVehicleThatStops) {
  start(SmallScenario().car(5, -25.0, 0.0, 10.0, 200).goal(500.0, 90, 100),
        R"(, "traffic": "reactive")");
  bench_.advance(2s);
  drive(8s, 0.0, -3.0);
  bench_.stop();

  EXPECT_EQ(result<std::int64_t>("collisions"), 0);
  EXPECT_EQ(result<std::int64_t>("reacting_cars_max"), 1);
  EXPECT_EQ(result<double>("end_speed_mps"), 0.0);
}

TEST_F(WorldTest, ScenarioThatCannotBeReadIsAFault) {
  start(folder_ / "missing.xml");

  const auto faults = bench_.faults("world");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("missing.xml: expected a file"), std::string::npos) << faults[0];
}

TEST_F(WorldTest, WayThatCannotBeWrittenIsAFault) {
  way_ = folder_ / "missing/way.csv";
  start(SmallScenario().goal(50.0, 40, 60));

  const auto faults = bench_.faults("world");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("missing/way.csv: cannot be written"), std::string::npos) << faults[0];
}

TEST_F(WorldTest, PlacesOfAllOthersAreWrittenAtTheTimesOfTheWay) {
  const std::filesystem::path bodies = folder_ / "bodies.csv";
  start(SmallScenario().ego(0.0).car(5, 20.0, 3.5, 8.0, 50).standing(6, 60.0, 0.0).goal(50.0, 4, 5),
        fmt::format(R"(, "bodies": "{}")", bodies.string()));
  drive(4s, 0.0, 0.0);
  std::ifstream file(bodies);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) {
    lines.push_back(line);
  }
  ASSERT_EQ(lines.size(), 1U + 2U * (rows().size() - 1U));
  EXPECT_EQ(lines[0], "time_s,id,x_m,y_m,heading_rad,length_m,width_m,speed_mps");
  EXPECT_THAT(lines, Contains(StartsWith("0.5,5,24,3.5,0,4,2,")));
  EXPECT_THAT(lines, Contains("0.5,6,60,0,0,4,2,0"));
}

TEST_F(WorldTest, WayIsWrittenNowhereUnlessAskedFor) {
  way_ = "";
  start(SmallScenario().goal(50.0, 40, 60));
  bench_.advance(3s);

  EXPECT_TRUE(bench_.faults("world").empty());
  EXPECT_TRUE(rows().empty());
}

TEST_F(WorldTest, WorldGoesInWholeSteps) {
  start(SmallScenario().goal(50.0, 40, 60), R"(, "settle_s": 0.005)");

  const auto faults = bench_.faults("world");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_NE(faults[0].find("expected a multiple of 0.01 s"), std::string::npos) << faults[0];
}

}  // namespace
}  // namespace ads
