#include "predictor.h"

#include <cmath>

#include <gtest/gtest.h>

#include "small_map.h"

namespace ads {
namespace {

class PredictorTest : public ::testing::Test {
 protected:
  PredictorTest() { predictor_.use(LanePaths(testing::small_map())); }

  perception::Object& add(std::int64_t lane, double x_m, double y_m, double speed_mps) {
    scene::SceneObject& object = *scene_.add_objects();
    object.set_lane(lane);
    object.set_along_m(x_m);
    object.set_offset_m(lane == 2 ? y_m - 3.5 : y_m);
    perception::Object& seen = *object.mutable_object();
    seen.set_x_m(x_m);
    seen.set_y_m(y_m);
    seen.set_speed_mps(speed_mps);
    seen.set_length_m(4.5);
    seen.set_width_m(1.8);
    return seen;
  }

  const prediction::PredictedObject& predict(int object = 0) {
    predictions_.Clear();
    predictor_.predict(scene_, predictions_);
    return predictions_.objects(object);
  }

  static const prediction::Hypothesis* find(const prediction::PredictedObject& predicted,
                                            prediction::Kind kind) {
    for (const auto& hypothesis : predicted.hypotheses()) {
      if (hypothesis.kind() == kind) {
        return &hypothesis;
      }
    }
    return nullptr;
  }

  static double sum(const prediction::PredictedObject& predicted) {
    double probability = 0.0;
    for (const auto& hypothesis : predicted.hypotheses()) {
      probability += hypothesis.probability();
    }
    return probability;
  }

  Predictor predictor_{{}};
  scene::Scene scene_;
  prediction::Predictions predictions_;
};

TEST_F(PredictorTest, CarKeepsItsPlaceInItsLane) {
  add(1, 20.0, 0.4, 10.0);

  const auto& predicted = predict();

  EXPECT_NEAR(sum(predicted), 1.0, 1e-9);
  const auto& best = predicted.hypotheses(0);
  EXPECT_EQ(best.kind(), prediction::LANE_FOLLOWING);
  ASSERT_EQ(best.points_size(), 61);
  EXPECT_NEAR(best.points(0).x_m(), 20.0, 1e-9);
  EXPECT_NEAR(best.points(60).time_s(), 6.0, 1e-9);
  EXPECT_NEAR(best.points(60).x_m(), 80.0, 1e-6);
  EXPECT_NEAR(best.points(60).y_m(), 0.4, 1e-6);
  EXPECT_EQ(find(predicted, prediction::LANE_CHANGE_LEFT), nullptr);
  EXPECT_NE(find(predicted, prediction::CONSTANT_TURN), nullptr);
  for (int index = 1; index < best.points_size(); ++index) {
    EXPECT_GT(best.points(index).along_stddev_m(), best.points(index - 1).along_stddev_m());
  }
}

TEST_F(PredictorTest, CarThatDrivesOffGoesOnSpeedingUpToWhatIsUsual) {
  add(1, 20.0, 0.0, 3.0).set_acceleration_mps2(1.2);
  const double driven_off_mps = predict().hypotheses(0).points(30).speed_mps();
  EXPECT_GT(driven_off_mps, 4.5);
  EXPECT_LT(driven_off_mps, 3.0 + 1.2 * 3.0);

  scene_.Clear();
  add(1, 20.0, 0.0, 15.0).set_acceleration_mps2(1.2);
  EXPECT_NEAR(predict().hypotheses(0).points(30).speed_mps(), 15.0, 0.2);
}

TEST_F(PredictorTest, CarSlowsDownBehindASlowerOne) {
  add(1, 20.0, 0.0, 15.0);
  add(1, 60.0, 0.0, 5.0);

  const auto& points = predict().hypotheses(0).points();
  const auto& leader = predictions_.objects(1).hypotheses(0).points();

  EXPECT_LT(points[60].speed_mps(), 8.0);
  EXPECT_NEAR(leader[60].speed_mps(), 5.0, 1e-9);
  for (int index = 0; index < points.size(); ++index) {
    EXPECT_GT(leader[index].x_m() - points[index].x_m(), 4.5);
  }
}

TEST_F(PredictorTest, CarThatFollowsCloselyDoesNotBrakeForThat) {
  add(1, 20.0, 0.0, 15.0);
  add(1, 35.0, 0.0, 15.0);

  EXPECT_NEAR(predict().hypotheses(0).points(60).speed_mps(), 15.0, 0.1);
}

TEST_F(PredictorTest, CarThatBrakesHardMayGoOnBraking) {
  add(1, 20.0, 0.0, 15.0).set_acceleration_mps2(-5.0);

  const auto& predicted = predict();

  EXPECT_NEAR(predicted.hypotheses(0).points(30).speed_mps(), 15.0, 0.5);
  const prediction::Hypothesis* const braked = find(predicted, prediction::CONSTANT_TURN);
  ASSERT_NE(braked, nullptr);
  EXPECT_NEAR(braked->points(10).speed_mps(), 11.0, 0.3);
  EXPECT_LT(braked->points(30).speed_mps(), 8.0);
  EXPECT_NEAR(braked->points(60).x_m(), 20.0 + 49.0, 2.0);
}

TEST_F(PredictorTest, CarThatBrakesToAStandDoesNotReverse) {
  add(1, 20.0, 0.0, 4.0).set_acceleration_mps2(-6.0);

  const prediction::Hypothesis* const braked = find(predict(), prediction::CONSTANT_TURN);

  ASSERT_NE(braked, nullptr);
  const auto& points = braked->points();
  EXPECT_EQ(points[60].speed_mps(), 0.0);
  EXPECT_LT(points[60].x_m(), 24.0);
  for (int index = 1; index < points.size(); ++index) {
    EXPECT_GE(points[index].x_m(), points[index - 1].x_m() - 1e-9);
  }
}

TEST_F(PredictorTest, CarThatMovesToTheSideChangesTheLane) {
  add(1, 20.0, 0.5, 15.0).set_heading_rad(0.08);

  const auto& predicted = predict();

  EXPECT_NEAR(sum(predicted), 1.0, 1e-9);
  EXPECT_EQ(predicted.hypotheses(0).kind(), prediction::LANE_CHANGE_LEFT);
  EXPECT_NEAR(predicted.hypotheses(0).points(0).y_m(), 0.5, 1e-6);
  EXPECT_NEAR(predicted.hypotheses(0).points(60).y_m(), 3.5, 1e-6);
}

TEST_F(PredictorTest, AfterAChangeEachWayOnIsAHypothesis) {
  add(2, 180.0, 3.0, 15.0).set_heading_rad(-0.08);

  int ways = 0;
  const auto& predicted = predict();
  for (const auto& hypothesis : predicted.hypotheses()) {
    ways += hypothesis.kind() == prediction::LANE_CHANGE_RIGHT ? 1 : 0;
  }

  EXPECT_EQ(ways, 2);
  EXPECT_NEAR(sum(predicted), 1.0, 1e-9);
}

TEST_F(PredictorTest, NoChangeIsMadeToWhereNoLaneIs) {
  add(1, 20.0, -0.5, 15.0).set_heading_rad(-0.08);

  EXPECT_EQ(find(predict(), prediction::LANE_CHANGE_RIGHT), nullptr);
}

TEST_F(PredictorTest, WhereLanesPartEachWayIsAHypothesis) {
  add(1, 180.0, 0.0, 8.0);

  const auto& predicted = predict();

  int ways = 0;
  for (const auto& hypothesis : predicted.hypotheses()) {
    ways += hypothesis.kind() == prediction::LANE_FOLLOWING ? 1 : 0;
  }
  EXPECT_EQ(ways, 2);
  EXPECT_NEAR(sum(predicted), 1.0, 1e-9);
}

TEST_F(PredictorTest, AfterAForkBothWaysRemainUntilTheCarLeavesOne) {
  const auto ways = [this](double x_m, double y_m, double heading_rad) {
    scene_.Clear();
    auto& object = add(11, x_m, y_m, 10.0);
    object.set_heading_rad(heading_rad);
    scene_.mutable_objects(0)->set_along_m(x_m - 200.0);
    int count = 0;
    for (const auto& hypothesis : predict().hypotheses()) {
      count += hypothesis.kind() == prediction::LANE_FOLLOWING ? 1 : 0;
    }
    EXPECT_NEAR(sum(predictions_.objects(0)), 1.0, 1e-9);
    return count;
  };
  EXPECT_EQ(ways(201.0, -0.2, -0.1), 2);
  EXPECT_GT(predictions_.objects(0).hypotheses(0).points(60).x_m(), 240.0) << "its own lane first";
  EXPECT_EQ(ways(206.0, 0.0, -0.1), 1) << "beside the other one";
  EXPECT_EQ(ways(201.0, -0.2, 0.5), 1) << "turned away from the other one";
}

TEST_F(PredictorTest, WhatIsOnNoLaneKeepsItsTurn) {
  auto& object = add(0, 0.0, -50.0, 10.0);
  object.set_yaw_rate_radps(0.5);

  const auto& predicted = predict();

  ASSERT_EQ(predicted.hypotheses_size(), 1);
  EXPECT_EQ(predicted.hypotheses(0).kind(), prediction::CONSTANT_TURN);
  const auto& end = predicted.hypotheses(0).points(60);
  EXPECT_NEAR(end.x_m(), 20.0 * std::sin(3.0), 0.05);
  EXPECT_NEAR(end.y_m(), -50.0 + 20.0 * (1.0 - std::cos(3.0)), 0.05);
}

TEST_F(PredictorTest, WhatStandsMayStand) {
  add(0, 0.0, -50.0, 0.0);
  add(1, 20.0, 0.0, 0.0);

  EXPECT_EQ(predict().hypotheses(0).kind(), prediction::STANDING);
  EXPECT_EQ(predict().hypotheses(0).probability(), 1.0);
  const auto& on_lane = predict(1);
  EXPECT_EQ(on_lane.hypotheses(0).kind(), prediction::STANDING);
  EXPECT_EQ(on_lane.hypotheses(0).points(60).x_m(), 20.0);
  EXPECT_NE(find(on_lane, prediction::LANE_FOLLOWING), nullptr);
  EXPECT_NEAR(sum(on_lane), 1.0, 1e-9);
}

TEST_F(PredictorTest, WithoutAMapThereAreHypothesesToo) {
  predictor_.use({});
  add(1, 20.0, 0.0, 10.0);

  EXPECT_EQ(predict().hypotheses(0).kind(), prediction::CONSTANT_TURN);
}

}  // namespace
}  // namespace ads
