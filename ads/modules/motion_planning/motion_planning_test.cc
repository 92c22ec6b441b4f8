#include "motion_planning.h"

#include <chrono>
#include <limits>
#include <stdexcept>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

namespace motion_planning {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

class MotionPlanningTest : public ::testing::Test {
 protected:
  MotionPlanningTest() { bench_.add<MotionPlanning>("motion_planning"); }

  void SetUp() override {
    bench_.start();
    bench_.advance(100ms);
  }

  std::int64_t now_ns() { return bench_.now().time_since_epoch().count(); }

  void send_route() {
    hd_map::Route route;
    route.set_is_found(true);
    for (double x = -20.0; x <= 200.0; x += 5.0) {
      route.mutable_reference()->add_x_m(x);
      route.mutable_reference()->add_y_m(0.0);
      route.add_left_edge_m(5.25);
      route.add_right_edge_m(1.75);
      route.add_speed_limit_mps(0.0);
    }
    routes_.publish(route);
  }
  void send_ego(double speed_mps) {
    localization::Ego ego;
    ego.mutable_header()->set_taken_ns(now_ns());
    ego.set_speed_mps(speed_mps);
    ego.set_quality(localization::GOOD);
    egos_.publish(ego);
  }
  void send_goal(double x_m) {
    mission::Goal goal;
    goal.mutable_rectangle()->set_x_m(x_m);
    goal.mutable_rectangle()->set_length_m(2.0);
    goal.mutable_rectangle()->set_width_m(1.6);
    goal.mutable_speed_mps()->set_low(7.0);
    goal.mutable_speed_mps()->set_high(13.0);
    goal.set_window_begin_ns(now_ns() + 4'000'000'000);
    goal.set_window_end_ns(now_ns() + 5'000'000'000);
    goals_.publish(goal);
  }
  planning::Plan plan_for(const prediction::Predictions& predictions) {
    predictions_.publish(predictions);
    const auto plans = plans_.take();
    return plans.empty() ? planning::Plan() : plans.back();
  }
  prediction::Predictions nothing_around() {
    prediction::Predictions predictions;
    predictions.mutable_header()->set_taken_ns(now_ns() - 80'000'000);
    return predictions;
  }

  Bench bench_;
  Bench::Input<prediction::Predictions> predictions_ =
      bench_.input<prediction::Predictions>("prediction/objects");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<vehicle::State> vehicles_ = bench_.input<vehicle::State>("vehicle/state");
  Bench::Input<hd_map::Route> routes_ = bench_.input<hd_map::Route>("map/route");
  Bench::Input<hd_map::Tile> tiles_ = bench_.input<hd_map::Tile>("map/tile");
  Bench::Input<mission::Goal> goals_ = bench_.input<mission::Goal>("mission/goal");
  Bench::Output<planning::Plan> plans_ = bench_.output<planning::Plan>("planning/plan");
};

TEST_F(MotionPlanningTest, SaysNothingWithoutARoute) {
  send_ego(10.0);

  EXPECT_EQ(plan_for(nothing_around()).nominal().points_size(), 0);
}

TEST_F(MotionPlanningTest, SaysNothingWithoutAPose) {
  send_route();

  EXPECT_EQ(plan_for(nothing_around()).nominal().points_size(), 0);
}

TEST_F(MotionPlanningTest, PlansToTheGoal) {
  send_route();
  send_ego(10.0);
  send_goal(46.0);
  const prediction::Predictions predictions = nothing_around();
  const planning::Plan plan = plan_for(predictions);

  EXPECT_EQ(plan.kind(), planning::NOMINAL);
  EXPECT_EQ(plan.header().taken_ns(), predictions.header().taken_ns());
  EXPECT_EQ(plan.nominal().start_ns(), now_ns());
  EXPECT_GT(plan.goal_ns(), now_ns() + 3'900'000'000);
  EXPECT_LT(plan.goal_ns(), now_ns() + 5'100'000'000);
  EXPECT_GT(plan.minimal_risk().points_size(), 10);
  EXPECT_GT(plan.candidates(), 1000U);
  EXPECT_EQ(plan.reason(), "");
}

TEST_F(MotionPlanningTest, PlansForThePresentAndNotForTheEstimatesTime) {
  send_route();
  send_ego(10.0);
  bench_.advance(50ms);
  const planning::Plan plan = plan_for(nothing_around());

  EXPECT_NEAR(plan.nominal().points(0).x_m(), 0.5, 1e-6);
}

TEST_F(MotionPlanningTest, PoseThatIsNoNumberIsNotPlannedFrom) {
  send_route();
  send_ego(std::numeric_limits<double>::quiet_NaN());

  EXPECT_EQ(plan_for(nothing_around()).nominal().points_size(), 0);
}

TEST_F(MotionPlanningTest, HazardChangesThePlan) {
  send_route();
  send_ego(10.0);
  prediction::Predictions predictions = nothing_around();
  connectivity::Hazard& hazard = *predictions.add_hazards();
  hazard.set_x_m(40.0);
  hazard.set_radius_m(10.0);
  hazard.set_speed_limit_mps(4.0);
  const planning::Plan plan = plan_for(predictions);

  for (const planning::TrajectoryPoint& point : plan.nominal().points()) {
    EXPECT_TRUE(std::abs(point.x_m() - 40.0) > 9.0 || point.speed_mps() < 4.6);
  }
}

TEST_F(MotionPlanningTest, TellsWhatItDid) {
  send_route();
  send_ego(10.0);
  plan_for(nothing_around());
  bench_.stop();

  EXPECT_EQ(std::get<std::int64_t>(bench_.result("motion_planning", "plans")), 1);
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("motion_planning", "plans_evasive")), 0);
}

/// Motion planning that throws when it is asked to.
class FaultyMotionPlanning final : public fastcycle::Component {
 public:
  explicit FaultyMotionPlanning(fastcycle::Context& context)
      : Component(context), motion_planning_(context) {
    context.create_subscriber<common::Header>(
        "test/fault", [](const common::Header&) { throw std::runtime_error("the test wants it"); });
  }
  void stop() override { motion_planning_.stop(); }

 private:
  MotionPlanning motion_planning_;
};

/// Beside the other one, on the same inputs.
class FaultyMotionPlanningTest : public MotionPlanningTest {
 protected:
  FaultyMotionPlanningTest() {
    bench_.add<FaultyMotionPlanning>("faulty", R"({"on_fault": "restart",
        "restart": {"limit": 100}, "remap": {"planning/plan": "faulty/plan"}})");
  }

  // Drives what was planned for a tenth of a second.
  void plan_and_drive(bool is_driving) {
    predictions_.publish(nothing_around());
    bench_.advance(100ms);
    const auto plans = plans_.take();
    const auto faulty_plans = faulty_plans_.take();
    ASSERT_EQ(plans.size(), 1U);
    ASSERT_EQ(faulty_plans.size(), 1U);
    EXPECT_EQ(faulty_plans[0].SerializeAsString(), plans[0].SerializeAsString())
        << faulty_plans[0].reason() << "\n"
        << plans[0].reason();
    const planning::TrajectoryPoint& next = plans[0].nominal().points(1);
    vehicle::State vehicle;
    vehicle.set_is_autonomous(is_driving);
    vehicle.set_acceleration_mps2(next.acceleration_mps2());
    vehicles_.publish(vehicle);
    localization::Ego ego;
    ego.mutable_header()->set_taken_ns(now_ns());
    ego.set_x_m(next.x_m() + 0.1);  // Localization does not quite agree.
    ego.set_y_m(next.y_m() - 0.1);
    ego.set_heading_rad(next.heading_rad());
    ego.set_speed_mps(next.speed_mps());
    egos_.publish(ego);
  }

  Bench::Input<common::Header> faults_ = bench_.input<common::Header>("test/fault");
  Bench::Output<planning::Plan> faulty_plans_ = bench_.output<planning::Plan>("faulty/plan");
};

TEST_F(FaultyMotionPlanningTest, AnObjectThatIsMadeAnewGoesOnAsTheOldOneWouldHave) {
  faults_.publish({});
  send_route();
  send_ego(10.0);
  send_goal(46.0);
  faults_.publish({});
  plan_and_drive(false);
  faults_.publish({});
  plan_and_drive(true);
  for (int cycle = 0; cycle < 3; ++cycle) {
    faults_.publish({});
    plan_and_drive(true);
    plan_and_drive(true);
  }
  bench_.stop();

  EXPECT_EQ(bench_.faults("faulty").size(), 6);
  for (const char* const name : {"plans", "plans_evasive", "plans_to_goal"}) {
    EXPECT_EQ(bench_.result("faulty", name), bench_.result("motion_planning", name)) << name;
  }
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("faulty", "plans")), 8);
}

}  // namespace
}  // namespace motion_planning
