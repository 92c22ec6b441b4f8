#include "rules.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "example_plan.h"

namespace plan_checker {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t kNow_ns = 1'000'000'000'000;
const Limits kLimits;

class RulesTest : public ::testing::Test {
 protected:
  RulesTest() { predictions_.mutable_header()->set_taken_ns(kNow_ns); }

  planning::PlanVerdict check() {
    const RoadArea road(tile_);
    planning::PlanVerdict verdict;
    Rules(limits_).check(plan_,
                         {.now_ns = kNow_ns,
                          .ego = ego_,
                          .predictions = &predictions_,
                          .road = &road,
                          .accepted = accepted_ ? &*accepted_ : nullptr},
                         verdict);
    return verdict;
  }
  std::vector<planning::Rule> rejected_by() { return rules_of(check(), true); }
  std::vector<planning::Rule> noted_by() { return rules_of(check(), false); }

  static std::vector<planning::Rule> rules_of(const planning::PlanVerdict& verdict, bool is_hard) {
    std::vector<planning::Rule> rules;
    for (const planning::RuleBreach& breach : verdict.breaches()) {
      if (breach.is_hard() == is_hard) {
        rules.push_back(breach.rule());
      }
    }
    return rules;
  }
  planning::TrajectoryPoint& nominal(int index) {
    return *plan_.mutable_nominal()->mutable_points(index);
  }
  // Straight on with this acceleration, as a nominal trajectory.
  void accelerate(double acceleration_mps2, double speed_mps = 10.0) {
    plan_ = straight_plan(kNow_ns, speed_mps);
    plan_.mutable_nominal()->clear_points();
    write_straight(*plan_.mutable_nominal(), kNow_ns, speed_mps, acceleration_mps2);
    ego_.speed_mps = speed_mps;
    // What is done at the begin is no breach: it comes with the second point.
    nominal(0).set_acceleration_mps2(0.0);
  }
  void turn(double speed_mps, double curvature_per_m) {
    plan_ = straight_plan(kNow_ns, speed_mps);
    plan_.mutable_nominal()->clear_points();
    write_circle(*plan_.mutable_nominal(), kNow_ns, speed_mps, curvature_per_m,
                 kLimits.centre_to_rear_axle_m);
    ego_.speed_mps = speed_mps;
    tile_.Clear();  // No road: nothing is off it.
  }

  Limits limits_;
  planning::Plan plan_ = straight_plan(kNow_ns);
  prediction::Predictions predictions_;
  hd_map::Tile tile_ = two_lanes();
  Motion ego_{.speed_mps = 10.0};
  std::optional<planning::Plan> accepted_;
};

TEST_F(RulesTest, PlanThatKeepsAllRulesIsAcceptedWithoutANote) {
  const planning::PlanVerdict verdict = check();

  EXPECT_TRUE(verdict.is_accepted());
  EXPECT_THAT(verdict.breaches(), IsEmpty());
  EXPECT_EQ(verdict.reason(), "");
  EXPECT_EQ(verdict.header().taken_ns(), plan_.header().taken_ns());
  EXPECT_EQ(verdict.plan_start_ns(), kNow_ns);
}

TEST_F(RulesTest, WithoutPoseObjectsOrRoadNoPlanIsAccepted) {
  planning::PlanVerdict verdict;
  Rules(limits_).check(plan_, {.now_ns = kNow_ns}, verdict);

  EXPECT_FALSE(verdict.is_accepted());
  EXPECT_THAT(rules_of(verdict, true), ElementsAre(planning::INPUTS));
  EXPECT_THAT(verdict.reason(), HasSubstr("where the vehicle is is not known"));
}

TEST_F(RulesTest, EachNumberThatIsNotFiniteIsFound) {
  const double bad = std::numeric_limits<double>::quiet_NaN();
  using Point = planning::TrajectoryPoint;
  for (const auto set :
       {&Point::set_time_s, &Point::set_x_m, &Point::set_y_m, &Point::set_heading_rad,
        &Point::set_curvature_per_m, &Point::set_speed_mps, &Point::set_acceleration_mps2}) {
    plan_ = straight_plan(kNow_ns);
    (nominal(20).*set)(bad);

    EXPECT_THAT(rejected_by(), ElementsAre(planning::FINITE_NUMBERS));
  }
}

TEST_F(RulesTest, MinimalRiskTrajectoryHasToBeFiniteToo) {
  plan_.mutable_minimal_risk()->mutable_points(3)->set_x_m(INFINITY);
  const planning::PlanVerdict verdict = check();

  EXPECT_FALSE(verdict.is_accepted());
  EXPECT_TRUE(verdict.breaches(0).is_minimal_risk());
  EXPECT_EQ(verdict.reason(), "minimal-risk trajectory: point 3 has a number that is not finite");
}

TEST_F(RulesTest, TimesHaveToBeEquallySpaced) {
  nominal(20).set_time_s(2.0005);
  EXPECT_THAT(rejected_by(), IsEmpty());
  nominal(20).set_time_s(2.02);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::TIMES));
}

TEST_F(RulesTest, TimesHaveToIncrease) {
  nominal(1).set_time_s(-0.1);

  EXPECT_THAT(rejected_by(), ElementsAre(planning::TIMES));
}

TEST_F(RulesTest, ShortPlanHasToEndInAStand) {
  const auto cut = [this](int points) {
    while (plan_.nominal().points_size() > points) {
      plan_.mutable_nominal()->mutable_points()->RemoveLast();
    }
  };
  cut(31);
  EXPECT_THAT(rejected_by(), IsEmpty());
  cut(30);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::HORIZON));
  accelerate(-4.5, 5.0);
  cut(20);
  EXPECT_THAT(rejected_by(), IsEmpty());
}

TEST_F(RulesTest, EmptyTrajectoryIsRejected) {
  plan_.mutable_nominal()->clear_points();

  EXPECT_THAT(rejected_by(), ElementsAre(planning::HORIZON));
}

TEST_F(RulesTest, OldPlanIsRejected) {
  plan_.mutable_header()->set_taken_ns(kNow_ns - 490'000'000);
  EXPECT_THAT(rejected_by(), IsEmpty());
  plan_.mutable_header()->set_taken_ns(kNow_ns - 510'000'000);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::AGE));
}

TEST_F(RulesTest, PredictionsThatAreOldRejectAPlan) {
  predictions_.mutable_header()->set_taken_ns(kNow_ns - 510'000'000);

  EXPECT_THAT(rejected_by(), ElementsAre(planning::AGE));
}

TEST_F(RulesTest, PlanOfTheFutureIsRejected) {
  ego_.x_m = -2.0;
  for (planning::Trajectory* trajectory : {plan_.mutable_nominal(), plan_.mutable_minimal_risk()}) {
    trajectory->set_start_ns(kNow_ns + 200'000'000);
  }
  limits_.start_distance_max_m = 3.0;

  EXPECT_THAT(rejected_by(), ElementsAre(planning::AGE, planning::AGE));
}

TEST_F(RulesTest, PlanHasToBeginWhereTheVehicleIs) {
  ego_.x_m = 1.45;
  EXPECT_THAT(rejected_by(), IsEmpty());
  ego_.x_m = 1.55;
  EXPECT_THAT(rejected_by(), ElementsAre(planning::START, planning::START));
}

TEST_F(RulesTest, PlanHasToBeginAsTheVehicleIsTurnedAndAsFast) {
  ego_ = {.heading_rad = 0.35, .speed_mps = 10.0};
  EXPECT_THAT(rejected_by(), ElementsAre(planning::START, planning::START));
  ego_ = {.speed_mps = 12.6};
  EXPECT_THAT(rejected_by(), ElementsAre(planning::START, planning::START));
  ego_ = {.heading_rad = 0.25, .speed_mps = 12.4};
  EXPECT_THAT(rejected_by(), IsEmpty());
}

TEST_F(RulesTest, PlaceHasToFitTheSpeed) {
  nominal(10).set_y_m(0.34);
  EXPECT_THAT(rejected_by(), IsEmpty());
  nominal(10).set_y_m(0.36);
  const planning::PlanVerdict verdict = check();

  EXPECT_THAT(rules_of(verdict, true), ElementsAre(planning::MOTION));
  EXPECT_NEAR(verdict.breaches(0).time_s(), 1.0, 1e-9);
  EXPECT_NEAR(verdict.breaches(0).value(), 0.36, 1e-9);
  EXPECT_NEAR(verdict.breaches(0).limit(), 0.35, 1e-9);
}

TEST_F(RulesTest, HeadingHasToFitTheCurvature) {
  nominal(10).set_heading_rad(0.04);
  EXPECT_THAT(rejected_by(), IsEmpty());
  nominal(10).set_heading_rad(0.06);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::MOTION));
}

TEST_F(RulesTest, AccelerationHasToFitTheSpeed) {
  for (int index = 5; index < 15; ++index) {
    nominal(index).set_acceleration_mps2(2.4);
  }
  EXPECT_THAT(rejected_by(), IsEmpty());
  for (int index = 5; index < 15; ++index) {
    nominal(index).set_acceleration_mps2(2.6);
  }
  EXPECT_THAT(rejected_by(), ElementsAre(planning::MOTION));
}

TEST_F(RulesTest, JumpOfTheMinimalRiskTrajectoryIsRejected) {
  plan_.mutable_minimal_risk()->mutable_points(10)->set_y_m(4.0);

  EXPECT_THAT(rejected_by(), ElementsAre(planning::MOTION));
}

TEST_F(RulesTest, CurvatureThatTheWheelsCannotSteerIsRejected) {
  turn(2.0, 0.76);
  EXPECT_THAT(rejected_by(), IsEmpty());
  turn(2.0, 0.78);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::CURVATURE));
}

TEST_F(RulesTest, SteeringThatJumpsIsRejected) {
  limits_.motion_heading_max_rad = 1.0;
  const auto steer = [this](double radps) {
    turn(2.0, 1e-9);
    nominal(10).set_curvature_per_m(std::tan(0.1 * radps) / kLimits.wheelbase_m);
  };
  steer(0.99);
  EXPECT_THAT(rejected_by(), IsEmpty());
  EXPECT_THAT(noted_by(), ElementsAre(planning::STEERING_RATE));
  steer(1.01);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::STEERING_RATE));
}

TEST_F(RulesTest, BrakingBeyondComfortIsNotedAndBeyondTheTyresRejected) {
  limits_.jerk_max_mps3 = limits_.comfort_jerk_mps3 = 1000.0;
  limits_.motion_acceleration_max_mps2 = 100.0;
  accelerate(-4.9, 20.0);
  EXPECT_THAT(noted_by(), IsEmpty());
  accelerate(-9.9, 20.0);
  EXPECT_THAT(rejected_by(), IsEmpty());
  EXPECT_THAT(noted_by(), ElementsAre(planning::ACCELERATION));
  accelerate(-10.1, 20.0);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::ACCELERATION));
}

TEST_F(RulesTest, AccelerationThatTheVehicleDoesNotHaveIsRejected) {
  limits_.jerk_max_mps3 = 1000.0;
  limits_.motion_acceleration_max_mps2 = 100.0;
  accelerate(5.9);
  EXPECT_THAT(rejected_by(), IsEmpty());
  accelerate(6.1);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::ACCELERATION));
}

TEST_F(RulesTest, WhatTheVehicleDoesAlreadyIsNoBreach) {
  accelerate(-10.5, 20.0);
  nominal(0).set_acceleration_mps2(-10.5);

  EXPECT_THAT(rejected_by(), IsEmpty());
}

TEST_F(RulesTest, JerkThatBrakesCannotFollowIsRejected) {
  limits_.motion_acceleration_max_mps2 = 100.0;
  nominal(10).set_acceleration_mps2(-4.4);
  EXPECT_THAT(rejected_by(), IsEmpty());
  EXPECT_THAT(noted_by(), ElementsAre(planning::JERK));
  nominal(10).set_acceleration_mps2(-4.6);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::JERK));
}

TEST_F(RulesTest, LateralAccelerationBeyondTheTyresIsRejected) {
  const auto turn_later = [this](double lateral_mps2) {
    turn(10.0, lateral_mps2 / 100.0);
    limits_.steering_rate_max_radps = 100.0;
    limits_.motion_heading_max_rad = 1.0;
    nominal(0).set_curvature_per_m(0.0);
  };
  turn_later(2.9);
  EXPECT_THAT(noted_by(), IsEmpty());
  turn_later(7.9);
  EXPECT_THAT(rejected_by(), IsEmpty());
  EXPECT_THAT(noted_by(), ElementsAre(planning::LATERAL_ACCELERATION));
  turn_later(8.1);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::LATERAL_ACCELERATION));
}

TEST_F(RulesTest, DrivingBackwardsIsRejected) {
  plan_ = straight_plan(kNow_ns, -0.2);
  ego_.speed_mps = 0.0;

  EXPECT_EQ(rejected_by().front(), planning::SPEED);
}

TEST_F(RulesTest, SpeedThatTheVehicleDoesNotHaveIsRejected) {
  limits_.speed_max_mps = 10.1;
  EXPECT_THAT(rejected_by(), IsEmpty());
  limits_.speed_max_mps = 9.9;
  EXPECT_THAT(rejected_by(), ElementsAre(planning::SPEED, planning::SPEED));
}

TEST_F(RulesTest, SpeedAboveTheLimitOfTheLaneIsNotedAndFarAboveItRejected) {
  tile_ = two_lanes(10.0);
  EXPECT_THAT(noted_by(), IsEmpty());
  accelerate(1.0);
  EXPECT_THAT(rejected_by(), IsEmpty());
  EXPECT_THAT(noted_by(), ElementsAre(planning::SPEED_LIMIT));
  limits_.comfort_jerk_mps3 = limits_.jerk_max_mps3 = 1000.0;
  accelerate(3.0);
  const planning::PlanVerdict verdict = check();
  EXPECT_THAT(rules_of(verdict, true), ElementsAre(planning::SPEED_LIMIT));
  EXPECT_THAT(verdict.reason(), HasSubstr("10.0 m/s is the limit of lane 1"));
}

TEST_F(RulesTest, WhoIsTooFastAlreadyMaySlowDown) {
  tile_ = two_lanes(5.0);

  EXPECT_THAT(rejected_by(), IsEmpty());
}

TEST_F(RulesTest, BodyThatLeavesTheRoadSoonIsRejected) {
  // Half of the body is 0.805 m wide, and begins on the road.
  const auto drift = [this](double across_m) {
    plan_ = straight_plan(kNow_ns);
    for (int index = 0; index <= 60; ++index) {
      nominal(index).set_y_m(-across_m * std::min(1.0, index / 20.0));
    }
  };
  drift(1.75 - 0.805 + 0.79);
  EXPECT_THAT(rejected_by(), IsEmpty());
  EXPECT_THAT(noted_by(), ElementsAre(planning::ROAD));
  drift(1.75 - 0.805 + 0.81);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::ROAD));
}

TEST_F(RulesTest, CornerOffTheRoadCountsThoughTheCentreIsOnIt) {
  tile_.Clear();
  tile_.set_radius_m(1000.0);
  // The road ends, and turns away to the left: nothing is ahead from x = 12 on.
  add_lane(tile_, 1, -1.75, 1.75, 0.0, -200.0, 12.0);
  tile_.mutable_lanes(0)->add_successors(2);

  const planning::PlanVerdict verdict = check();

  ASSERT_EQ(rules_of(verdict, true).front(), planning::ROAD);
  // At 10 m/s the front, 2.25 m ahead of the centre, is 0.8 m beyond after 1.05 s.
  EXPECT_NEAR(verdict.breaches(0).time_s(), 1.1, 0.05);
}

TEST_F(RulesTest, WhoIsOffTheRoadMayComeBack) {
  plan_ = straight_plan(kNow_ns, 10.0, -2.5);
  ego_.y_m = -2.5;

  EXPECT_THAT(rejected_by(), IsEmpty());
}

TEST_F(RulesTest, PlanThatLeavesTheRoadIsAcceptedIfTheStopAtHandLeavesItFarther) {
  for (int index = 0; index <= 60; ++index) {
    nominal(index).set_y_m(-1.9 * std::min(1.0, index / 20.0));
  }
  accepted_ = straight_plan(kNow_ns);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::ROAD));
  accepted_ = straight_plan(kNow_ns, 10.0, -2.5);
  const planning::PlanVerdict verdict = check();

  EXPECT_TRUE(verdict.is_accepted());
  EXPECT_THAT(verdict.exception(), HasSubstr("leaves the road farther"));
}

TEST_F(RulesTest, PlanThatTouchesAStandingCarSoonIsRejected) {
  // Both are 4.5 m long: at 10 m/s they touch after (x - 4.5) / 10 s.
  add_car(predictions_, 19.0, 0.0, 0.0);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::COLLISION));
  predictions_.clear_objects();
  add_car(predictions_, 20.0, 0.0, 0.0);
  EXPECT_THAT(rejected_by(), IsEmpty());
  EXPECT_THAT(noted_by().front(), planning::COLLISION);
}

TEST_F(RulesTest, GapBesideACarIsThatOfTheBodies) {
  // Halves of 0.805 m and 0.9 m.
  add_car(predictions_, 15.0, 1.705 + 0.06, 0.0);
  EXPECT_THAT(rejected_by(), IsEmpty());
  predictions_.clear_objects();
  add_car(predictions_, 15.0, 1.705 + 0.04, 0.0);
  EXPECT_THAT(rejected_by(), ElementsAre(planning::COLLISION));
}

TEST_F(RulesTest, WhatAnObjectUnlikelyDoesRejectsNothing) {
  add_car(predictions_, 15.0, 0.0, 0.0, 0.4);

  EXPECT_THAT(rejected_by(), IsEmpty());
}

TEST_F(RulesTest, WhoComesFromBehindHasToKeepHisDistance) {
  add_car(predictions_, -8.0, 0.0, 16.0);

  EXPECT_THAT(rejected_by(), IsEmpty());
}

TEST_F(RulesTest, EvasionThatTouchesIsAcceptedUnlessAnotherWayAtHandIsBetter) {
  add_car(predictions_, 16.0, 0.0, 0.0);
  plan_.set_kind(planning::EVASIVE);
  const planning::PlanVerdict without = check();
  accepted_ = straight_plan(kNow_ns);
  const planning::PlanVerdict as_bad = check();
  accepted_->mutable_minimal_risk()->clear_points();
  write_straight(*accepted_->mutable_minimal_risk(), kNow_ns, 10.0, -8.0);
  const planning::PlanVerdict better = check();

  EXPECT_TRUE(without.is_accepted());
  EXPECT_THAT(without.exception(), HasSubstr("touches something as early"));
  EXPECT_TRUE(as_bad.is_accepted());
  EXPECT_THAT(rules_of(better, true), ElementsAre(planning::COLLISION));
}

TEST_F(RulesTest, StopOfMinimalRiskThatIsHardButPossibleIsAccepted) {
  plan_.set_kind(planning::NONE);
  for (planning::Trajectory* trajectory : {plan_.mutable_nominal(), plan_.mutable_minimal_risk()}) {
    trajectory->clear_points();
    write_straight(*trajectory, kNow_ns, 10.0, -8.0);
  }
  const planning::PlanVerdict verdict = check();

  EXPECT_TRUE(verdict.is_accepted());
  EXPECT_THAT(rules_of(verdict, false), testing::Contains(planning::ACCELERATION));
}

}  // namespace
}  // namespace plan_checker
