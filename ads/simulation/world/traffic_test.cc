#include "traffic.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "small_scenario.h"

namespace ads {
namespace {

using testing::SmallScenario;

const Box kFarAway{.center_m = {0.0, 500.0}, .length_m = 4.508, .width_m = 1.610};

Box ego_at(double x_m) {
  return {.center_m = {x_m, 0.0}, .length_m = 4.508, .width_m = 1.610};
}

// Moves on from where the traffic is, with an ego vehicle that stands.
void move_to(Traffic& traffic, double from_s, double to_s, const Box& ego) {
  for (int tick = 1; from_s + tick * 0.01 < to_s + 1e-9; ++tick) {
    traffic.move_to(from_s + tick * 0.01, ego, 0.0);
  }
}

const Body* find(const Traffic& traffic, std::int64_t id) {
  const auto found = std::ranges::find(traffic.bodies(), id, &Body::id);
  return found == traffic.bodies().end() ? nullptr : &*found;
}

TEST(Traffic, RecordedCarIsWhereItWasRecorded) {
  const Scenario scenario = SmallScenario().car(5, 20.0, 3.5, 10.0, 30).goal(0, 0, 1).scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReplay);

  traffic.move_to(1.25, kFarAway, 0.0);

  const Body* const car = find(traffic, 5);
  ASSERT_NE(car, nullptr);
  EXPECT_NEAR(car->box.center_m.x(), 32.5, 1e-9);
  EXPECT_EQ(car->box.center_m.y(), 3.5);
  EXPECT_EQ(car->speed_mps, 10.0);
  EXPECT_EQ(car->box.length_m, 4.0);
  EXPECT_EQ(car->height_m, 1.5);
  EXPECT_EQ(traffic.end_s(), 3.0);
}

TEST(Traffic, ObjectThatJumpsIsNotOnTheWay) {
  const auto scenario = [](double x_m) {
    return SmallScenario()
        .obstacle("dynamicObstacle", 5,
                  {{.step = 0, .speed_mps = 1.2},
                   {.step = 1, .x_m = 0.12, .speed_mps = 1.2},
                   {.step = 20, .x_m = x_m, .speed_mps = 1.2}})
        .goal(0, 0, 1)
        .scenario();
  };
  const Scenario far = scenario(150.0);
  Traffic jumps(far, 0.0, TrafficMode::kReplay);
  const Scenario near = scenario(2.5);
  Traffic walks(near, 0.0, TrafficMode::kReplay);

  for (const double time_s : {0.05, 0.1, 0.5, 1.9, 2.0}) {
    jumps.move_to(time_s, kFarAway, 0.0);
    walks.move_to(time_s, kFarAway, 0.0);
    EXPECT_EQ(find(jumps, 5) != nullptr, time_s <= 0.1 || time_s >= 2.0) << time_s;
    EXPECT_NE(find(walks, 5), nullptr) << time_s;
  }
}

TEST(Traffic, HeadingTurnsTheShorterWay) {
  const Scenario scenario =
      SmallScenario()
          .obstacle("dynamicObstacle", 5,
                    {{.step = 0, .heading_rad = 3.1},
                     {.step = 1, .x_m = -1.0, .heading_rad = -3.1, .speed_mps = 10.0}})
          .goal(0, 0, 1)
          .scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReplay);

  traffic.move_to(0.05, kFarAway, 0.0);

  EXPECT_NEAR(std::abs(find(traffic, 5)->box.heading_rad), std::numbers::pi, 1e-9);
  EXPECT_NEAR(find(traffic, 5)->yaw_rate_radps, (2.0 * std::numbers::pi - 6.2) / 0.1, 1e-9);
}

TEST(Traffic, BeforeTheScenarioCarsComeFromBehind) {
  const Scenario scenario =
      SmallScenario().car(5, 20.0, 3.5, 10.0, 30).standing(6, 40.0, 0.0).goal(0, 0, 1).scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReplay);

  traffic.move_to(-2.0, kFarAway, 0.0);
  EXPECT_NEAR(find(traffic, 5)->box.center_m.x(), 0.0, 1e-9);
  EXPECT_EQ(find(traffic, 6)->box.center_m.x(), 40.0);

  traffic.move_to(0.0, kFarAway, 0.0);
  EXPECT_EQ(find(traffic, 5)->box.center_m.x(), 20.0);
}

TEST(Traffic, CarIsThereFromItsFirstStateToItsLast) {
  const Scenario scenario = SmallScenario()
                                .obstacle("dynamicObstacle", 5,
                                          {{.step = 10, .x_m = 5.0, .speed_mps = 1.0},
                                           {.step = 20, .x_m = 6.0, .speed_mps = 1.0}})
                                .obstacle("dynamicObstacle", 6, {{.step = 0, .speed_mps = 3.0}})
                                .obstacle("staticObstacle", 7, {{.step = 10}})
                                .goal(0, 0, 1)
                                .scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReplay);
  const auto ids_at = [&](double time_s) {
    traffic.move_to(time_s, kFarAway, 0.0);
    std::vector<std::int64_t> ids;
    for (const Body& body : traffic.bodies()) {
      ids.push_back(body.id);
    }
    return ids;
  };
  using Ids = std::vector<std::int64_t>;

  EXPECT_EQ(ids_at(-1.0), (Ids{6}));
  EXPECT_EQ(ids_at(0.0), (Ids{6}));
  EXPECT_EQ(ids_at(0.01), (Ids{}));
  EXPECT_EQ(ids_at(0.99), (Ids{}));
  EXPECT_EQ(ids_at(1.0), (Ids{7, 5}));
  EXPECT_EQ(ids_at(2.0), (Ids{7, 5}));
  EXPECT_EQ(ids_at(2.01), (Ids{7}));
}

TEST(Traffic, ReplayedCarRunsThroughWhatStandsInItsWay) {
  const Scenario scenario = SmallScenario().car(5, -40.0, 0.0, 10.0, 80).goal(0, 0, 1).scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReplay);

  move_to(traffic, 0.0, 8.0, ego_at(0.0));

  EXPECT_NEAR(find(traffic, 5)->box.center_m.x(), 40.0, 1e-6);
  EXPECT_EQ(traffic.reacting(), 0U);
}

TEST(Traffic, ReactiveCarStopsBehindAnEgoVehicleThatStands) {
  const Scenario scenario = SmallScenario().car(5, -40.0, 0.0, 10.0, 120).goal(0, 0, 1).scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReactive);

  for (int tick = 1; tick <= 1200; ++tick) {
    traffic.move_to(tick * 0.01, ego_at(0.0), 0.0);
    ASSERT_FALSE(overlap(find(traffic, 5)->box, ego_at(0.0)));
  }

  EXPECT_EQ(traffic.reacting(), 1U);
  EXPECT_LT(find(traffic, 5)->speed_mps, 0.2);
  EXPECT_LT(distance_m(find(traffic, 5)->box, ego_at(0.0)), 3.0);
}

TEST(Traffic, ReactiveCarFollowsAlsoOnAWayThatEndsTrembling) {
  std::vector<SmallScenario::State> states;
  for (int step = 0; step <= 100; ++step) {
    const bool is_back = step > 60 && step % 2 == 0;
    states.push_back({.step = step,
                      .x_m = std::min(30.0, 0.5 * step) - (is_back ? 0.3 : 0.0),
                      .y_m = is_back ? 0.01 : 0.0,
                      .speed_mps = step < 60 ? 5.0 : 0.0});
  }
  const Scenario scenario =
      SmallScenario().obstacle("dynamicObstacle", 5, states).goal(0, 0, 1).scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReactive);
  Box ego = ego_at(20.0);
  ego.center_m.y() = 0.3;

  move_to(traffic, 0.0, 8.0, ego);

  EXPECT_LT(find(traffic, 5)->box.center_m.x(), 16.0);
  EXPECT_LT(find(traffic, 5)->speed_mps, 0.2);
}

TEST(Traffic, CarsBehindOneThatReactsFollowIt) {
  const Scenario scenario = SmallScenario()
                                .car(5, -40.0, 0.0, 10.0, 120)
                                .car(6, -55.0, 0.0, 10.0, 120)
                                .car(7, -70.0, 0.0, 10.0, 120)
                                .car(8, -50.0, 3.5, 10.0, 120)
                                .goal(0, 0, 1)
                                .scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReactive);

  for (int tick = 1; tick <= 1200; ++tick) {
    traffic.move_to(tick * 0.01, ego_at(0.0), 0.0);
    for (const auto& [behind, ahead] : {std::pair(6, 5), std::pair(7, 6)}) {
      ASSERT_FALSE(overlap(find(traffic, behind)->box, find(traffic, ahead)->box)) << tick;
    }
  }

  EXPECT_EQ(traffic.reacting(), 3U);
  // The one on the other lane passes.
  EXPECT_NEAR(find(traffic, 8)->box.center_m.x(), 70.0, 1e-6);
}

TEST(Traffic, ReactiveCarsThatAreNotConcernedAreReplayed) {
  const Scenario scenario = SmallScenario()
                                .car(5, -20.0, 0.0, 10.0, 80)  // behind, as fast as the ego
                                .car(6, 20.0, 0.0, 10.0, 80)   // ahead
                                .car(7, -10.0, 3.5, 15.0, 80)  // beside
                                .goal(0, 0, 1)
                                .scenario();
  Traffic replayed(scenario, 0.0, TrafficMode::kReplay);
  Traffic reactive(scenario, 0.0, TrafficMode::kReactive);

  for (int tick = 1; tick <= 800; ++tick) {
    const Box ego = ego_at(10.0 * (tick - 1) * 0.01);
    replayed.move_to(tick * 0.01, ego, 10.0);
    reactive.move_to(tick * 0.01, ego, 10.0);
    for (std::size_t index = 0; index < 3; ++index) {
      ASSERT_EQ(replayed.bodies()[index].box.center_m, reactive.bodies()[index].box.center_m);
    }
  }
  EXPECT_EQ(reactive.reacting(), 0U);
}

TEST(Traffic, ReactiveCarDrivesOnWhenItsWayIsFree) {
  const Scenario scenario = SmallScenario().car(5, -40.0, 0.0, 10.0, 300).goal(0, 0, 1).scenario();
  Traffic traffic(scenario, 0.0, TrafficMode::kReactive);
  move_to(traffic, 0.0, 10.0, ego_at(0.0));
  ASSERT_LT(find(traffic, 5)->speed_mps, 1.0);

  move_to(traffic, 10.0, 25.0, kFarAway);

  EXPECT_GT(find(traffic, 5)->speed_mps, 9.0);
  EXPECT_LE(find(traffic, 5)->speed_mps, 10.0);
}

}  // namespace
}  // namespace ads
