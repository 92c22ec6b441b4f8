#include "connectivity.h"

#include <cmath>
#include <filesystem>
#include <limits>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using ::testing::HasSubstr;
using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

connectivity::Hazard hazard(std::uint64_t id) {
  connectivity::Hazard message;
  message.set_id(id);
  message.set_kind(connectivity::Hazard::ROADWORKS);
  message.set_x_m(10.0);
  message.set_radius_m(5.0);
  return message;
}

class ConnectivityTest : public ::testing::Test {
 protected:
  void start(const std::string& hazards = "{}") {
    const auto file = std::filesystem::path(ADS_DIR) / "data/commonroad/USA_US101-23_1_T-1.xml";
    bench_.configure(
        R"({"topics": {"mission/goal": {"latched": 1}, "mission/initial_pose": {"latched": 1}}})");
    bench_.add<Connectivity>("connectivity", R"({"params": {"scenario": ")" + file.string() +
                                                 R"(", "hazards": )" + hazards + "}}");
    bench_.start();
    bench_.advance(1ms);
  }

  Bench bench_;
  Bench::Input<connectivity::Hazard> inbox_ =
      bench_.input<connectivity::Hazard>("connectivity/inbox");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<supervision::State> states_ = bench_.input<supervision::State>("supervision/state");
  Bench::Output<mission::InitialPose> poses_ =
      bench_.output<mission::InitialPose>("mission/initial_pose");
  Bench::Output<mission::Goal> goals_ = bench_.output<mission::Goal>("mission/goal");
  Bench::Output<connectivity::Hazard> hazards_ =
      bench_.output<connectivity::Hazard>("connectivity/hazard");
  Bench::Output<connectivity::VehicleReport> reports_ =
      bench_.output<connectivity::VehicleReport>("connectivity/vehicle_report");
};

TEST_F(ConnectivityTest, MissionComesAtTheStart) {
  start();

  const auto goals = goals_.take();
  ASSERT_EQ(goals.size(), 1U);
  ASSERT_EQ(poses_.take().size(), 1U);
  const std::int64_t now_ns = (bench_.now() - 1ms).time_since_epoch().count();
  EXPECT_EQ(goals[0].engage_ns(), now_ns + 2'000'000'000);
  EXPECT_EQ(goals[0].window_begin_ns(), now_ns + 15'000'000'000);
}

TEST_F(ConnectivityTest, VehicleIsReportedOnceASecond) {
  start();
  bench_.advance(2s);
  EXPECT_TRUE(reports_.take().empty());
  localization::Ego ego;
  ego.set_x_m(3.0);
  ego.set_speed_mps(7.0);
  egos_.publish(ego);
  supervision::State state;
  state.set_state(supervision::ENGAGED);
  states_.publish(state);

  bench_.advance(3s);

  const auto reports = reports_.take();
  ASSERT_EQ(reports.size(), 3U);
  EXPECT_EQ(reports[0].x_m(), 3.0);
  EXPECT_EQ(reports[0].speed_mps(), 7.0);
  EXPECT_TRUE(reports[0].is_autonomous());
  EXPECT_EQ(reports[0].state(), "ENGAGED");
}

TEST_F(ConnectivityTest, PlannedHazardComesAtItsTime) {
  start(R"({"hazards": [{"time_s": 1.5, "duration_s": 10, "hazard":
            {"id": 4, "kind": "ROADWORKS", "x_m": 50, "radius_m": 8}}]})");
  bench_.advance(3'400ms);
  EXPECT_TRUE(hazards_.take().empty());

  bench_.advance(200ms);

  const auto hazards = hazards_.take();
  ASSERT_EQ(hazards.size(), 1U);
  EXPECT_EQ(hazards[0].id(), 4U);
  EXPECT_EQ(hazards[0].header().frame(), "map");
}

TEST_F(ConnectivityTest, HazardsFromOutsideAreCheckedAndPassedOn) {
  start();
  inbox_.publish(hazard(1));
  auto wrong = hazard(2);
  wrong.set_x_m(std::numeric_limits<double>::quiet_NaN());
  inbox_.publish(wrong);
  const auto hazards = hazards_.take();
  bench_.stop();

  ASSERT_EQ(hazards.size(), 1U);
  EXPECT_EQ(hazards[0].id(), 1U);
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("connectivity", "hazards_refused")), 1);
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("connectivity", "hazards_passed_on")), 1);
}

TEST(Hazard, ErrorsAreNamed) {
  const fastcycle::Time now{10s};
  EXPECT_EQ(error_in(hazard(1), now), "");
  auto wrong = hazard(1);
  wrong.set_radius_m(0.0);
  EXPECT_THAT(error_in(wrong, now), HasSubstr("radius_m"));
  wrong = hazard(1);
  wrong.set_speed_limit_mps(-1.0);
  EXPECT_THAT(error_in(wrong, now), HasSubstr("speed_limit_mps"));
  wrong = hazard(1);
  wrong.set_valid_until_ns(5);
  EXPECT_THAT(error_in(wrong, now), HasSubstr("over"));
  wrong = hazard(1);
  wrong.mutable_header()->set_frame("lidar");
  EXPECT_THAT(error_in(wrong, now), HasSubstr("frame"));
  wrong = hazard(1);
  wrong.set_kind(static_cast<connectivity::Hazard::Kind>(77));
  EXPECT_THAT(error_in(wrong, now), HasSubstr("kind"));
}

TEST(Hazard, CancellationNeedsNoPlace) {
  connectivity::Hazard cancelled;
  cancelled.set_id(1);
  cancelled.set_is_cancelled(true);

  EXPECT_EQ(error_in(cancelled, fastcycle::Time{10s}), "");
}

}  // namespace
}  // namespace ads
