#include "prediction.h"

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "small_map.h"

namespace ads {
namespace {

using fastcycle::testing::Bench;

TEST(Prediction, EachSceneIsAnsweredAtItsTime) {
  Bench bench;
  bench.add<Prediction>("prediction", R"({"params": {"horizon_s": 4, "step_s": 0.2}})");
  auto tiles = bench.input<hd_map::Tile>("map/tile");
  auto scenes = bench.input<scene::Scene>("scene/scene");
  auto predictions = bench.output<prediction::Predictions>("prediction/objects");
  bench.start();
  tiles.publish(testing::small_map());
  scene::Scene scene;
  scene.mutable_header()->set_taken_ns(123);
  scene::SceneObject& object = *scene.add_objects();
  object.set_lane(1);
  object.mutable_object()->set_id(9);
  object.mutable_object()->set_speed_mps(10.0);
  scene.add_hazards()->set_id(4);

  scenes.publish(scene);

  const auto published = predictions.take();
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].header().taken_ns(), 123);
  EXPECT_EQ(published[0].horizon_s(), 4.0);
  ASSERT_EQ(published[0].objects_size(), 1);
  EXPECT_EQ(published[0].objects(0).object().object().id(), 9U);
  EXPECT_EQ(published[0].objects(0).hypotheses(0).points_size(), 21);
  EXPECT_EQ(published[0].hazards(0).id(), 4U);
}

}  // namespace
}  // namespace ads
