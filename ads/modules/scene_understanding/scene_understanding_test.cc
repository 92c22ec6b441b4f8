#include "scene_understanding.h"

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "small_map.h"

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""s;

class SceneUnderstandingTest : public ::testing::Test {
 protected:
  SceneUnderstandingTest() {
    bench_.add<SceneUnderstanding>("scene_understanding");
    bench_.start();
  }

  [[nodiscard]] std::int64_t now_ns() const { return bench_.now().time_since_epoch().count(); }

  // The ego 0.1 s ago, 10 m/s: now it is at x = 50.
  void know_where_the_ego_is() {
    localization::Ego ego;
    ego.mutable_header()->set_taken_ns(now_ns() - 100'000'000);
    ego.set_x_m(49.0);
    ego.set_speed_mps(10.0);
    ego.set_quality(localization::GOOD);
    egos_.publish(ego);
  }

  scene::Scene see_one_at(double x_m, double y_m) {
    perception::Objects objects;
    objects.set_is_sweep_valid(true);
    objects.mutable_header()->set_taken_ns(now_ns());
    objects.mutable_header()->set_frame("map");
    perception::Object& object = *objects.add_objects();
    object.set_id(7);
    object.set_x_m(x_m);
    object.set_y_m(y_m);
    object.set_length_m(4.0);
    object.set_width_m(2.0);
    object.set_speed_mps(8.0);
    objects_.publish(objects);
    const auto scenes = scenes_.take();
    return scenes.empty() ? scene::Scene() : scenes.back();
  }

  Bench bench_;
  Bench::Input<perception::Objects> objects_ =
      bench_.input<perception::Objects>("perception/objects");
  Bench::Input<hd_map::Tile> tiles_ = bench_.input<hd_map::Tile>("map/tile");
  Bench::Input<hd_map::Route> routes_ = bench_.input<hd_map::Route>("map/route");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<connectivity::Hazard> hazards_ =
      bench_.input<connectivity::Hazard>("connectivity/hazard");
  Bench::Output<scene::Scene> scenes_ = bench_.output<scene::Scene>("scene/scene");
};

TEST_F(SceneUnderstandingTest, ObjectsAreJudgedOnTheRoute) {
  tiles_.publish(testing::small_map());
  routes_.publish(testing::small_route());
  know_where_the_ego_is();

  const auto scene = see_one_at(80.0, 0.2);

  EXPECT_EQ(scene.ego_lane(), 1);
  EXPECT_EQ(scene.header().taken_ns(), now_ns());
  ASSERT_EQ(scene.objects_size(), 1);
  EXPECT_EQ(scene.objects(0).object().id(), 7U);
  EXPECT_EQ(scene.objects(0).relation(), scene::LEADING);
  EXPECT_EQ(scene.objects(0).lane(), 1);
  EXPECT_NEAR(scene.objects(0).offset_m(), 0.2, 1e-9);
  EXPECT_NEAR(scene.objects(0).gap_m(), 30.0 - 2.0 - 2.254, 1e-6);
}

TEST_F(SceneUnderstandingTest, NothingIsMadeOfASweepThatCannotBeUsed) {
  perception::Objects objects;
  objects.mutable_header()->set_taken_ns(now_ns());
  objects.set_is_sweep_valid(false);
  objects_.publish(objects);

  EXPECT_TRUE(scenes_.take().empty());
}

TEST_F(SceneUnderstandingTest, WithoutAPositionEverythingIsRelevant) {
  tiles_.publish(testing::small_map());

  const auto scene = see_one_at(80.0, 0.2);

  ASSERT_EQ(scene.objects_size(), 1);
  EXPECT_TRUE(scene.objects(0).is_relevant());
  EXPECT_EQ(scene.objects(0).relation(), scene::ELSEWHERE);
}

TEST_F(SceneUnderstandingTest, HazardIsReportedUntilItIsOverOrCancelled) {
  routes_.publish(testing::small_route());
  connectivity::Hazard hazard;
  hazard.set_id(3);
  hazard.set_x_m(120.0);
  hazard.set_radius_m(5.0);
  hazard.set_valid_until_ns(now_ns() + 2'000'000'000);
  hazards_.publish(hazard);
  know_where_the_ego_is();
  EXPECT_EQ(see_one_at(80.0, 0.0).hazards_size(), 1);

  hazard.set_is_cancelled(true);
  hazards_.publish(hazard);
  EXPECT_EQ(see_one_at(80.0, 0.0).hazards_size(), 0);

  hazard.set_is_cancelled(false);
  hazards_.publish(hazard);
  bench_.advance(3s);
  know_where_the_ego_is();
  EXPECT_EQ(see_one_at(80.0, 0.0).hazards_size(), 0);
}

}  // namespace
}  // namespace ads
