#include "plan_checker.h"

#include <chrono>
#include <limits>
#include <string>
#include <vector>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "example_plan.h"

namespace plan_checker {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;
using ::testing::HasSubstr;

class PlanCheckerTest : public ::testing::Test {
 protected:
  PlanCheckerTest() { bench_.add<PlanChecker>("plan_checker"); }

  void SetUp() override {
    bench_.start();
    bench_.advance(100ms);
    tiles_.publish(two_lanes());
  }

  std::int64_t now_ns() { return bench_.now().time_since_epoch().count(); }

  // What the vehicle and others do, and a plan: as the planner publishes it.
  planning::PlanVerdict send(planning::Plan plan) {
    localization::Ego ego;
    ego.mutable_header()->set_taken_ns(now_ns());
    ego.set_speed_mps(10.0);
    ego.set_quality(localization::GOOD);
    egos_.publish(ego);
    prediction::Predictions predictions;
    predictions.mutable_header()->set_taken_ns(now_ns());
    predictions_.publish(predictions);
    plans_.publish(plan);
    const auto verdicts = verdicts_.take();
    return verdicts.size() == 1 ? verdicts.front() : planning::PlanVerdict();
  }
  planning::Plan good() { return straight_plan(now_ns()); }
  planning::Plan wild() {
    planning::Plan plan = good();
    plan.mutable_nominal()->mutable_points(5)->set_y_m(3.0);
    return plan;
  }

  Bench bench_;
  Bench::Input<planning::Plan> plans_ = bench_.input<planning::Plan>("planning/plan");
  Bench::Input<prediction::Predictions> predictions_ =
      bench_.input<prediction::Predictions>("prediction/objects");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<hd_map::Tile> tiles_ = bench_.input<hd_map::Tile>("map/tile");
  Bench::Output<planning::Plan> checked_ = bench_.output<planning::Plan>("planning/checked_plan");
  Bench::Output<planning::PlanVerdict> verdicts_ =
      bench_.output<planning::PlanVerdict>("planning/verdict");
};

TEST_F(PlanCheckerTest, PlanThatKeepsTheRulesIsForwardedAsItIs) {
  const planning::Plan plan = good();
  const planning::PlanVerdict verdict = send(plan);
  const auto checked = checked_.take();

  EXPECT_TRUE(verdict.is_accepted());
  ASSERT_EQ(checked.size(), 1U);
  EXPECT_EQ(checked.front().SerializeAsString(), plan.SerializeAsString());
}

TEST_F(PlanCheckerTest, PlanThatBreaksARuleIsNotForwardedAndTheVerdictSaysWhy) {
  const planning::PlanVerdict verdict = send(wild());

  EXPECT_FALSE(verdict.is_accepted());
  EXPECT_THAT(verdict.reason(), HasSubstr("place and speed are 3.00 m apart at 0.5 s"));
  EXPECT_TRUE(checked_.take().empty());
}

TEST_F(PlanCheckerTest, CountsRejectedPlansInARow) {
  std::vector<std::uint32_t> counts;
  for (const bool is_good : {true, false, false, true, false}) {
    counts.push_back(send(is_good ? good() : wild()).rejected_in_a_row());
  }

  EXPECT_THAT(counts, testing::ElementsAre(0, 1, 2, 0, 1));
}

TEST_F(PlanCheckerTest, PoseThatIsNoNumberIsNone) {
  localization::Ego ego;
  ego.mutable_header()->set_taken_ns(now_ns());
  ego.set_x_m(std::numeric_limits<double>::quiet_NaN());
  ego.set_quality(localization::GOOD);
  egos_.publish(ego);
  plans_.publish(good());

  EXPECT_THAT(verdicts_.take().back().reason(), HasSubstr("where the vehicle is is not known"));
}

}  // namespace
}  // namespace plan_checker
