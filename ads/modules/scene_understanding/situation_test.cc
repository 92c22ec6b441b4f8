#include "situation.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "small_map.h"

namespace ads {
namespace {

class SituationTest : public ::testing::Test {
 protected:
  // The ego at x = 50 on lane 1, at 10 m/s.
  scene::SceneObject judged(double x_m, double y_m, double heading_rad, double speed_mps = 10.0) {
    perception::Object object;
    object.set_x_m(x_m);
    object.set_y_m(y_m);
    object.set_heading_rad(heading_rad);
    object.set_speed_mps(speed_mps);
    object.set_length_m(5.0);
    object.set_width_m(2.0);
    scene::SceneObject result;
    situation_.judge(object, lanes_.match({x_m, y_m}, heading_rad, speed_mps, 0), result);
    return result;
  }

  LaneMap lanes_{testing::small_map()};
  RouteFrame frame_ = RouteFrame::of(testing::small_route()).value();
  EgoState ego_{.position_m = {50.0, 0.0}, .heading_rad = 0.0, .speed_mps = 10.0};
  Situation situation_{lanes_, frame_, ego_, 1, {.ego_length_m = 5.0}};
};

TEST_F(SituationTest, WhatIsOnTheEgosLaneLeadsOrIsBehind) {
  const auto leading = judged(80.0, 0.3, 0.0);
  EXPECT_EQ(leading.relation(), scene::LEADING);
  EXPECT_NEAR(leading.gap_m(), 25.0, 1e-9);
  EXPECT_TRUE(leading.is_relevant());
  EXPECT_EQ(judged(120.0, 0.0, 0.0).relation(), scene::LEADING);
  const auto behind = judged(30.0, 0.0, 0.0);
  EXPECT_EQ(behind.relation(), scene::BEHIND);
  EXPECT_NEAR(behind.gap_m(), 15.0, 1e-9);
}

TEST_F(SituationTest, WhatIsOnTheLaneBesideIsAheadBesideOrBehind) {
  EXPECT_EQ(judged(80.0, 3.5, 0.0).relation(), scene::AHEAD_LEFT);
  EXPECT_EQ(judged(130.0, 3.5, 0.0).relation(), scene::AHEAD_LEFT);
  EXPECT_EQ(judged(52.0, 3.5, 0.0).relation(), scene::BESIDE_LEFT);
  EXPECT_NEAR(judged(52.0, 3.5, 0.0).gap_m(), -3.0, 1e-9);
  EXPECT_EQ(judged(20.0, 3.5, 0.0).relation(), scene::BEHIND_LEFT);
}

TEST_F(SituationTest, LanesToTheRightAreKnownToo) {
  Situation from_left(lanes_, frame_, {.position_m = {50.0, 3.5}, .speed_mps = 10.0}, 2, {});
  perception::Object object;
  object.set_x_m(90.0);
  object.set_length_m(4.0);
  scene::SceneObject result;
  from_left.judge(object, LanePlace{.lane = 1}, result);
  EXPECT_EQ(result.relation(), scene::AHEAD_RIGHT);
}

TEST_F(SituationTest, TrafficThatCrossesHasItsRightOfWay) {
  const auto crossing = judged(150.0, -25.0, std::numbers::pi / 2.0);
  EXPECT_EQ(crossing.relation(), scene::CROSSING);
  EXPECT_EQ(crossing.right_of_way(), scene::OBJECT_FIRST);
  EXPECT_TRUE(std::isnan(crossing.gap_m()));
  EXPECT_FALSE(crossing.is_relevant());  // More than 80 m away.

  auto map = testing::small_map();
  for (hd_map::Lane& lane : *map.mutable_lanes()) {
    lane.clear_yields_to();
    if (lane.id() == 5) {
      lane.add_yields_to(11);
    }
  }
  const LaneMap lanes(map);
  const Situation situation(lanes, frame_, {.position_m = {120.0, 0.0}, .speed_mps = 10.0}, 11, {});
  scene::SceneObject result;
  situation.judge(crossing.object(), LanePlace{.lane = 5}, result);
  EXPECT_EQ(result.right_of_way(), scene::EGO_FIRST);
}

TEST_F(SituationTest, OncomingTrafficIsReportedFromItsDirection) {
  const auto oncoming = judged(90.0, 7.0, std::numbers::pi);
  EXPECT_EQ(oncoming.relation(), scene::ONCOMING);
  EXPECT_TRUE(oncoming.is_relevant());
  EXPECT_EQ(judged(20.0, 7.0, std::numbers::pi).relation(), scene::ELSEWHERE);
}

TEST_F(SituationTest, WhatStandsAcrossTheLaneLeads) {
  const auto across = judged(80.0, 0.0, std::numbers::pi / 2.0, 0.0);
  EXPECT_EQ(across.relation(), scene::LEADING);
  EXPECT_NEAR(across.gap_m(), 26.5, 1e-6);
}

TEST_F(SituationTest, WhatIsFarOffTheRoadDoesNotMatter) {
  const auto far = judged(80.0, -40.0, 0.0);
  EXPECT_EQ(far.relation(), scene::ELSEWHERE);
  EXPECT_FALSE(far.is_relevant());
  EXPECT_TRUE(std::isnan(far.gap_m()));
}

TEST_F(SituationTest, HazardsAheadAreReported) {
  connectivity::Hazard hazard;
  hazard.set_radius_m(5.0);
  hazard.set_x_m(120.0);
  EXPECT_TRUE(situation_.is_ahead(hazard));
  hazard.set_y_m(-30.0);
  EXPECT_FALSE(situation_.is_ahead(hazard));
  hazard.set_y_m(0.0);
  hazard.set_x_m(20.0);
  EXPECT_FALSE(situation_.is_ahead(hazard));
}

TEST(Situation, WithoutAMapTheWayIsStraightAhead) {
  const LaneMap lanes;
  const EgoState ego{.position_m = {10.0, 5.0}, .heading_rad = std::numbers::pi / 2.0};
  const RouteFrame frame(ego);
  const Situation situation(lanes, frame, ego, 0, {});
  perception::Object object;
  object.set_x_m(10.5);
  object.set_y_m(25.0);
  scene::SceneObject result;
  situation.judge(object, std::nullopt, result);

  EXPECT_EQ(result.relation(), scene::LEADING);
  EXPECT_TRUE(result.is_relevant());
}

}  // namespace
}  // namespace ads
