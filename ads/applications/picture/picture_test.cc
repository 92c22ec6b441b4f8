#include "picture.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;
using ::testing::HasSubstr;
using ::testing::Not;

class PictureTest : public ::testing::Test {
 protected:
  PictureTest() {
    bench_.add<Picture>("picture", R"({"params": {"file": ")" + file_.string() + R"("}})");
    bench_.start();
  }
  ~PictureTest() override { std::filesystem::remove(file_); }

  void drive(supervision::DrivingState state, std::chrono::milliseconds span) {
    for (auto elapsed = 0ms; elapsed < span; elapsed += 100ms) {
      localization::Ego ego;
      ego.set_x_m(x_m_ += 1.0);
      ego.set_speed_mps(10.0);
      egos_.publish(ego);
      supervision::State message;
      message.set_state(state);
      states_.publish(message);
      objects_.publish(seen_);
      bench_.advance(100ms);
    }
  }

  std::string text() const {
    std::ifstream file(file_);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  std::filesystem::path file_ =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("picture_") + ::testing::UnitTest::GetInstance()->current_test_info()->name() +
       ".svg");
  double x_m_ = 0.0;
  perception::Objects seen_;
  Bench bench_;
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<perception::Objects> objects_ =
      bench_.input<perception::Objects>("perception/objects");
  Bench::Input<supervision::State> states_ = bench_.input<supervision::State>("supervision/state");
  Bench::Input<mission::Goal> goals_ = bench_.input<mission::Goal>("mission/goal");
  Bench::Input<hd_map::Tile> tiles_ = bench_.input<hd_map::Tile>("map/tile");
};

TEST_F(PictureTest, ShowsLanesStatesAndTheWayDriven) {
  mission::Goal goal;
  goal.set_engage_ns(bench_.now().time_since_epoch().count());
  goals_.publish(goal);
  hd_map::Tile tile;
  hd_map::Lane& lane = *tile.add_lanes();
  for (const double x_m : {0.0, 50.0}) {
    lane.mutable_left()->add_x_m(x_m);
    lane.mutable_left()->add_y_m(2.0);
    lane.mutable_right()->add_x_m(x_m);
    lane.mutable_right()->add_y_m(-2.0);
  }
  tiles_.publish(tile);

  drive(supervision::ENGAGED, 1000ms);
  seen_.add_objects()->set_id(3);
  drive(supervision::MINIMAL_RISK_STOP, 1000ms);
  bench_.stop();

  const std::string svg = text();
  EXPECT_THAT(svg, HasSubstr("</svg>"));
  EXPECT_THAT(svg, HasSubstr("off → engaged"));
  EXPECT_THAT(svg, HasSubstr("engaged → minimal-risk stop"));
  EXPECT_THAT(svg, HasSubstr("19 m; minimal-risk stop"));
  EXPECT_THAT(svg, HasSubstr(R"(fill="#e9ecef")")) << "the lane";
}

TEST_F(PictureTest, IsEmptyWithoutADrive) {
  bench_.stop();

  EXPECT_THAT(text(), HasSubstr("0 m; off"));
  EXPECT_THAT(text(), Not(HasSubstr("engaged")));
}

}  // namespace
}  // namespace ads
