#include "supervision.h"

#include <chrono>
#include <limits>
#include <stdexcept>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;
using ::testing::HasSubstr;

class SupervisionTest : public ::testing::Test {
 protected:
  SupervisionTest() {
    bench_.add<Supervision>("supervision", R"({"serve_period_ms": 50, "params": {
        "essential": ["perception"]}})");
  }

  void SetUp() override {
    bench_.start();
    mission::Goal goal;
    goal.set_engage_ns(nanoseconds(bench_.now()));
    goals_.publish(goal);
  }

  static std::int64_t nanoseconds(fastcycle::Time time) { return time.time_since_epoch().count(); }

  template <typename T>
  T taken_now(T message) {
    message.mutable_header()->set_taken_ns(nanoseconds(bench_.now()));
    return message;
  }

  // Everything comes at 100 Hz.
  void run(std::chrono::milliseconds span) {
    for (auto elapsed = 0ms; elapsed < span; elapsed += 10ms) {
      egos_.publish(taken_now(ego_));
      vehicles_.publish(taken_now(vehicle::State()));
      commands_.publish(taken_now(control::Command()));
      if (has_sweeps_) {
        objects_in_.publish(taken_now(objects_));
      }
      plans_.publish(taken_now(plan_));
      bench_.advance(10ms);
    }
  }

  void reject(std::uint32_t in_a_row) {
    planning::PlanVerdict verdict;
    verdict.set_is_accepted(in_a_row == 0);
    verdict.set_rejected_in_a_row(in_a_row);
    verdict.set_reason(in_a_row == 0 ? "" : "it begins elsewhere");
    verdicts_.publish(verdict);
  }

  supervision::State last_state() {
    const auto states = states_.take();
    return states.empty() ? supervision::State() : states.back();
  }

  static localization::Ego good_ego() {
    localization::Ego ego;
    ego.set_quality(localization::GOOD);
    ego.set_speed_mps(10.0);
    return ego;
  }
  static perception::Objects valid_objects() {
    perception::Objects objects;
    objects.set_is_sweep_valid(true);
    return objects;
  }

  Bench bench_;
  Bench::Input<fastcycle::status::Status> statuses_ =
      bench_.input<fastcycle::status::Status>("fastcycle/status");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<perception::Objects> objects_in_ =
      bench_.input<perception::Objects>("perception/objects");
  Bench::Input<planning::Plan> plans_ = bench_.input<planning::Plan>("planning/checked_plan");
  Bench::Input<planning::PlanVerdict> verdicts_ =
      bench_.input<planning::PlanVerdict>("planning/verdict");
  Bench::Input<control::Command> commands_ = bench_.input<control::Command>("control/command");
  Bench::Input<vehicle::State> vehicles_ = bench_.input<vehicle::State>("vehicle/state");
  Bench::Input<vehicle::DriverInput> drivers_ =
      bench_.input<vehicle::DriverInput>("vehicle/driver");
  Bench::Input<mission::Goal> goals_ = bench_.input<mission::Goal>("mission/goal");
  Bench::Output<supervision::State> states_ =
      bench_.output<supervision::State>("supervision/state");

  localization::Ego ego_ = good_ego();
  perception::Objects objects_ = valid_objects();
  planning::Plan plan_;
  bool has_sweeps_ = true;
};

TEST_F(SupervisionTest, EngagesWhenAllIsThere) {
  run(200ms);

  EXPECT_EQ(last_state().state(), supervision::ENGAGED);
}

TEST_F(SupervisionTest, IsOffInTheMomentInWhichTheDriverBrakes) {
  run(200ms);
  ASSERT_EQ(last_state().state(), supervision::ENGAGED);
  vehicle::DriverInput input;
  input.set_brake_pedal(0.3);

  drivers_.publish(taken_now(input));

  // No tick, and no time, has passed.
  const supervision::State state = last_state();
  EXPECT_EQ(state.state(), supervision::OFF);
  EXPECT_EQ(state.takeover(), supervision::TAKEOVER_BRAKE);
  EXPECT_THAT(state.reason(), HasSubstr("the driver took over: the brake pedal"));
}

TEST_F(SupervisionTest, StaysOffAfterATakeoverUntilItIsAskedAgain) {
  run(200ms);
  vehicle::DriverInput input;
  input.set_takeover_button(true);
  drivers_.publish(taken_now(input));

  run(500ms);
  const supervision::State off = last_state();
  mission::Goal goal;
  goal.set_engage_ns(nanoseconds(bench_.now()) + 1);
  goals_.publish(goal);
  run(100ms);

  EXPECT_EQ(off.state(), supervision::OFF);
  EXPECT_EQ(off.takeover(), supervision::TAKEOVER_BUTTON);
  EXPECT_EQ(last_state().state(), supervision::ENGAGED);
}

TEST_F(SupervisionTest, TheDriverEndsAMinimalRiskStopToo) {
  run(200ms);
  has_sweeps_ = false;
  run(600ms);
  ASSERT_EQ(last_state().state(), supervision::MINIMAL_RISK_STOP);
  vehicle::DriverInput input;
  input.set_steering_torque_nm(5.0);

  for (int count = 0; count < 4; ++count) {
    drivers_.publish(taken_now(input));
    run(10ms);
  }

  EXPECT_EQ(last_state().takeover(), supervision::TAKEOVER_STEERING);
}

TEST_F(SupervisionTest, StopsWhenPerceptionStalls) {
  run(200ms);
  has_sweeps_ = false;
  run(600ms);

  const supervision::State state = last_state();
  EXPECT_EQ(state.state(), supervision::MINIMAL_RISK_STOP);
  EXPECT_THAT(state.reason(), HasSubstr("the newest look at the objects is"));
}

TEST_F(SupervisionTest, CaresWhenAPlanIsRejectedAndForgetsItAfterAnAcceptedOne) {
  run(200ms);
  reject(2);
  run(100ms);
  const supervision::State after_two = last_state();
  reject(0);
  run(1200ms);

  EXPECT_EQ(after_two.state(), supervision::ENGAGED_DEGRADED);
  EXPECT_THAT(after_two.reason(), HasSubstr("a plan was rejected: it begins elsewhere"));
  EXPECT_EQ(last_state().state(), supervision::ENGAGED);
}

TEST_F(SupervisionTest, StopsWhenThreePlansInARowAreRejectedAndSaysWhy) {
  run(200ms);
  reject(3);
  run(100ms);

  const supervision::State state = last_state();
  EXPECT_EQ(state.state(), supervision::MINIMAL_RISK_STOP);
  EXPECT_EQ(state.reason(), "3 plans in a row were rejected: it begins elsewhere");
}

TEST_F(SupervisionTest, StopsWhenSweepsStayUnusableAndOnlyCaresAtFirst) {
  run(200ms);
  objects_.set_is_sweep_valid(false);
  objects_.set_reason("no returns");

  run(100ms);
  EXPECT_EQ(last_state().state(), supervision::ENGAGED_DEGRADED);
  run(400ms);

  const supervision::State state = last_state();
  EXPECT_EQ(state.state(), supervision::MINIMAL_RISK_STOP);
  EXPECT_THAT(state.reason(), HasSubstr("no returns"));
}

TEST_F(SupervisionTest, StopsWhenAnEssentialComponentHasFailed) {
  run(200ms);
  fastcycle::status::Status status;
  for (const char* const name : {"perception", "logging"}) {
    auto& component = *status.add_components();
    component.set_name(name);
    component.set_state(fastcycle::status::STATE_FAILED);
    component.set_last_fault("threw something");
  }
  statuses_.publish(status);

  run(100ms);

  const supervision::State state = last_state();
  EXPECT_EQ(state.state(), supervision::MINIMAL_RISK_STOP);
  EXPECT_EQ(state.reason(), "perception has failed: threw something");
}

TEST_F(SupervisionTest, GoesOnWhenSomethingElseHasFailed) {
  run(200ms);
  fastcycle::status::Status status;
  status.add_components()->set_name("logging");
  status.mutable_components(0)->set_state(fastcycle::status::STATE_FAILED);
  statuses_.publish(status);

  run(100ms);

  EXPECT_EQ(last_state().state(), supervision::ENGAGED);
}

TEST_F(SupervisionTest, APoseThatIsNoNumberDoesNotCount) {
  run(200ms);
  ego_.set_x_m(std::numeric_limits<double>::quiet_NaN());

  run(200ms);

  EXPECT_EQ(last_state().state(), supervision::MINIMAL_RISK_STOP);
}

/// Supervision that throws when it is asked to.
class FaultySupervision final : public fastcycle::Component {
 public:
  explicit FaultySupervision(fastcycle::Context& context)
      : Component(context), supervision_(context) {
    context.create_subscriber<common::Header>(
        "test/fault", [](const common::Header&) { throw std::runtime_error("the test wants it"); });
  }
  void serve() override { supervision_.serve(); }
  void stop() override { supervision_.stop(); }

 private:
  Supervision supervision_;
};

/// Beside the other one, on the same inputs.
class FaultySupervisionTest : public SupervisionTest {
 protected:
  FaultySupervisionTest() {
    // So that an object that is made anew does not get the newest again.
    bench_.configure(R"({"topics": {"fastcycle/status": {"latched": 0}}})");
    bench_.add<FaultySupervision>("faulty", R"({"serve_period_ms": 50, "on_fault": "restart",
        "restart": {"limit": 100}, "remap": {"supervision/state": "faulty/state"},
        "params": {"essential": ["perception"]}})");
  }

  void expect_same_states() {
    const auto states = states_.take();
    const auto faulty_states = faulty_states_.take();
    ASSERT_EQ(faulty_states.size(), states.size());
    for (std::size_t i = 0; i < states.size(); ++i) {
      EXPECT_EQ(faulty_states[i].SerializeAsString(), states[i].SerializeAsString())
          << faulty_states[i].ShortDebugString() << "\n"
          << states[i].ShortDebugString();
    }
  }

  Bench::Input<common::Header> faults_ = bench_.input<common::Header>("test/fault");
  Bench::Output<supervision::State> faulty_states_ =
      bench_.output<supervision::State>("faulty/state");
};

TEST_F(FaultySupervisionTest, AnObjectThatIsMadeAnewGoesOnAsTheOldOneWouldHave) {
  const auto fault_and_run = [this](std::chrono::milliseconds span) {
    faults_.publish({});
    run(span);
  };
  fastcycle::status::Status status;
  status.add_chains()->set_name("lidar_to_can");
  status.mutable_chains(0)->set_breaches(3);
  objects_.add_objects()->set_x_m(9.0);

  run(200ms);
  statuses_.publish(status);
  fault_and_run(100ms);
  statuses_.publish(status);
  objects_.mutable_objects(0)->set_x_m(20.0);
  fault_and_run(600ms);
  fault_and_run(700ms);
  objects_.set_is_sweep_valid(false);
  objects_.set_reason("no returns");
  run(100ms);
  has_sweeps_ = false;
  fault_and_run(100ms);
  has_sweeps_ = true;
  objects_.set_is_sweep_valid(true);
  plan_.set_kind(planning::NONE);
  plan_.set_reason("a wall");
  fault_and_run(800ms);
  fault_and_run(800ms);
  ego_.set_speed_mps(0.0);
  fault_and_run(300ms);
  fault_and_run(300ms);
  expect_same_states();
  bench_.stop();

  EXPECT_EQ(bench_.faults("faulty").size(), 8);
  for (const char* const name : {"state", "reason", "engaged_s", "degraded_s",
                                 "minimal_risk_stop_s", "stopped_s", "smallest_perceived_gap_m"}) {
    EXPECT_EQ(bench_.result("faulty", name), bench_.result("supervision", name)) << name;
  }
  EXPECT_EQ(bench_.result("faulty", "state"), fastcycle::ReportValue("stopped"));
}

}  // namespace
}  // namespace ads
