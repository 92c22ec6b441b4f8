#include "visualization.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <vector>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

struct LidarReturn {
  std::array<float, 3> place_m{};
  std::uint16_t time = 0;
  std::uint8_t ring = 0;
  std::uint8_t intensity = 0;
};
static_assert(sizeof(LidarReturn) == 16);

lidar::Sweep sweep(const std::vector<LidarReturn>& returns) {
  lidar::Sweep sweep;
  sweep.mutable_header()->set_taken_ns(1'000'000'000);
  sweep.mutable_header()->set_frame("lidar");
  sweep.set_duration_ns(100'000'000);
  sweep.set_mount_forward_m(1.0);
  sweep.set_mount_height_m(1.8);
  sweep.set_points(std::string(reinterpret_cast<const char*>(returns.data()),
                               returns.size() * sizeof(LidarReturn)));
  return sweep;
}

std::array<float, 3> place(const foxglove::PointCloud& cloud, std::size_t point) {
  std::array<float, 3> place{};
  std::memcpy(place.data(), cloud.data().data() + point * cloud.point_stride(), sizeof place);
  return place;
}

TEST(Drawing, TimesBefore1970CountOn) {
  google::protobuf::Timestamp timestamp;

  set_time(-1, timestamp);

  EXPECT_EQ(timestamp.seconds(), -1);
  EXPECT_EQ(timestamp.nanos(), 999'999'999);
}

TEST(Drawing, SweepHasItsReturnsAndNothingElse) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  foxglove::PointCloud cloud;

  draw_sweep(sweep({{.place_m = {3.0F, 4.0F, 5.0F}, .ring = 7, .intensity = 200},
                    {},
                    {.place_m = {nan, 0.0F, 1.0F}},
                    {.place_m = {-1.0F, 0.0F, 0.0F}}}),
             {}, 1, cloud);

  ASSERT_EQ(cloud.data().size(), 2U * cloud.point_stride());
  EXPECT_EQ(place(cloud, 0), (std::array{3.0F, 4.0F, 5.0F}));
  EXPECT_EQ(place(cloud, 1), (std::array{-1.0F, 0.0F, 0.0F}));
  EXPECT_EQ(cloud.frame_id(), "lidar");
  EXPECT_EQ(cloud.timestamp().seconds(), 1);
  EXPECT_EQ(cloud.timestamp().nanos(), 100'000'000);
  EXPECT_EQ(static_cast<std::uint8_t>(cloud.data()[cloud.fields(3).offset()]), 200);
  EXPECT_EQ(cloud.data()[cloud.fields(4).offset()], 7);
}

TEST(Drawing, SweepOfMotionStandsWhereTheSensorIsAtItsEnd) {
  foxglove::PointCloud cloud;

  draw_sweep(sweep({{.place_m = {20.0F, 0.0F, 0.0F}, .time = 32768}}), {.speed_mps = 10.0}, 1,
             cloud);
  EXPECT_NEAR(place(cloud, 0)[0], 19.5, 1e-5) << "half of a tenth of a second at 10 m/s";

  cloud.Clear();
  draw_sweep(sweep({{.place_m = {9.0F, 0.0F, 0.0F}, .time = 32768}}), {.yaw_rate_radps = 2.0}, 1,
             cloud);
  // 10 m before the centre, and then turned back by 0.1 rad.
  EXPECT_NEAR(place(cloud, 0)[0], 10.0 * std::cos(0.1) - 1.0, 1e-5);
  EXPECT_NEAR(place(cloud, 0)[1], -10.0 * std::sin(0.1), 1e-5);
}

TEST(Drawing, SweepIsThinned) {
  foxglove::PointCloud cloud;

  draw_sweep(sweep(std::vector<LidarReturn>(10, {.place_m = {1.0F, 0.0F, 0.0F}})), {}, 3, cloud);

  EXPECT_EQ(cloud.data().size(), 4U * cloud.point_stride());
}

class VisualizationTest : public ::testing::Test {
 protected:
  void start(const std::string& params = "{}") {
    bench_.add<Visualization>("visualization", R"({"params": )" + params + "}");
    bench_.start();
  }

  Bench bench_;
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<lidar::Sweep> sweeps_ = bench_.input<lidar::Sweep>("lidar/points");
  Bench::Input<perception::Objects> seen_ = bench_.input<perception::Objects>("perception/objects");
  Bench::Input<planning::Plan> plans_ = bench_.input<planning::Plan>("planning/plan");
  Bench::Input<hd_map::Tile> tiles_ = bench_.input<hd_map::Tile>("map/tile");
  Bench::Input<gnss::Position> positions_ = bench_.input<gnss::Position>("gnss/position");
  Bench::Output<foxglove::FrameTransforms> transforms_ =
      bench_.output<foxglove::FrameTransforms>("visualization/transforms");
  Bench::Output<foxglove::SceneUpdate> objects_ =
      bench_.output<foxglove::SceneUpdate>("visualization/objects");
  Bench::Output<foxglove::SceneUpdate> lanes_ =
      bench_.output<foxglove::SceneUpdate>("visualization/lanes");
  Bench::Output<foxglove::PosesInFrame> ways_ =
      bench_.output<foxglove::PosesInFrame>("visualization/plan");
  Bench::Output<foxglove::LocationFix> fixes_ =
      bench_.output<foxglove::LocationFix>("visualization/fix");
  Bench::Output<foxglove::PointCloud> clouds_ =
      bench_.output<foxglove::PointCloud>("visualization/points");
};

localization::Ego ego() {
  localization::Ego ego;
  ego.mutable_header()->set_taken_ns(2'500'000'000);
  ego.mutable_header()->set_frame("map");
  ego.set_x_m(3.0);
  ego.set_y_m(4.0);
  ego.set_heading_rad(std::numbers::pi / 2.0);
  ego.set_quality(localization::GOOD);
  return ego;
}

TEST_F(VisualizationTest, FramesLeadFromTheMapToTheLidar) {
  start();

  egos_.publish(ego());
  sweeps_.publish(sweep({}));

  const auto transforms = transforms_.take();
  ASSERT_EQ(transforms.size(), 2U);
  const foxglove::FrameTransform& vehicle = transforms[0].transforms(0);
  EXPECT_EQ(vehicle.parent_frame_id(), "map");
  EXPECT_EQ(vehicle.child_frame_id(), "vehicle");
  EXPECT_EQ(vehicle.timestamp().nanos(), 500'000'000);
  EXPECT_EQ(vehicle.translation().y(), 4.0);
  EXPECT_NEAR(vehicle.rotation().z(), std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(vehicle.rotation().w(), std::sqrt(0.5), 1e-12);
  const foxglove::FrameTransform& lidar = transforms[1].transforms(0);
  EXPECT_EQ(lidar.parent_frame_id(), "vehicle");
  EXPECT_EQ(lidar.child_frame_id(), "lidar");
  EXPECT_EQ(lidar.translation().z(), 1.8);
}

TEST_F(VisualizationTest, ObjectsTakeThePlaceOfThoseBefore) {
  start();
  perception::Objects objects;
  objects.mutable_header()->set_frame("map");
  perception::Object& car = *objects.add_objects();
  car.set_id(17);
  car.set_object_class(perception::CAR);
  car.set_x_m(10.0);
  car.set_length_m(4.0);
  car.set_height_m(1.5);
  car.set_speed_mps(-5.0);

  seen_.publish(objects);

  const auto updates = objects_.take();
  ASSERT_EQ(updates.size(), 1U);
  ASSERT_EQ(updates[0].deletions_size(), 1);
  EXPECT_EQ(updates[0].deletions(0).type(), foxglove::SceneEntityDeletion::ALL);
  ASSERT_EQ(updates[0].entities_size(), 1);
  const foxglove::SceneEntity& entity = updates[0].entities(0);
  EXPECT_EQ(entity.frame_id(), "map");
  EXPECT_EQ(entity.cubes(0).size().x(), 4.0);
  EXPECT_EQ(entity.cubes(0).pose().position().z(), 0.75);
  EXPECT_NEAR(entity.arrows(0).pose().orientation().z(), 1.0, 1e-12) << "it drives backwards";
  EXPECT_EQ(entity.texts(0).text(), "17 CAR -5.0 m/s");
}

TEST_F(VisualizationTest, WhatNobodyCanNameIsABoxAndNoMore) {
  start();
  perception::Objects objects;
  perception::Object& bush = *objects.add_objects();
  bush.set_object_class(perception::UNKNOWN);
  bush.set_speed_mps(5.0);

  seen_.publish(objects);

  const auto updates = objects_.take();
  ASSERT_EQ(updates.size(), 1U);
  EXPECT_EQ(updates[0].entities(0).cubes_size(), 1);
  EXPECT_EQ(updates[0].entities(0).arrows_size(), 0);
  EXPECT_EQ(updates[0].entities(0).texts_size(), 0);
}

TEST_F(VisualizationTest, LanesAndPlansAreLines) {
  start();
  hd_map::Tile tile;
  hd_map::Lane& lane = *tile.add_lanes();
  for (const double x_m : {0.0, 1.0, 2.0}) {
    lane.mutable_left()->add_x_m(x_m);
    lane.mutable_left()->add_y_m(1.0);
  }
  lane.mutable_right()->add_x_m(1.0);  // Without a y.
  planning::Plan plan;
  plan.mutable_nominal()->add_points()->set_x_m(8.0);

  tiles_.publish(tile);
  plans_.publish(plan);

  const auto lanes = lanes_.take();
  ASSERT_EQ(lanes.size(), 1U);
  EXPECT_EQ(lanes[0].entities(0).lines(0).points_size(), 3);
  EXPECT_EQ(lanes[0].entities(0).lines(1).points_size(), 0);
  const auto ways = ways_.take();
  ASSERT_EQ(ways.size(), 1U);
  EXPECT_EQ(ways[0].poses(0).position().x(), 8.0);
}

TEST_F(VisualizationTest, FixesNeedTheOriginOfTheMap) {
  start(R"({"origin_deg": [49.0, 8.4]})");
  gnss::Position position;
  position.set_y_m(1000.0);
  position.set_stddev_m(2.0);

  positions_.publish(position);

  const auto fixes = fixes_.take();
  ASSERT_EQ(fixes.size(), 1U);
  EXPECT_NEAR(fixes[0].latitude(), 49.0 + 1.0 / 111.21, 1e-5);
  EXPECT_NEAR(fixes[0].longitude(), 8.4, 1e-9);
  EXPECT_EQ(fixes[0].position_covariance(4), 4.0);
}

TEST_F(VisualizationTest, WhatIsExceptedIsNotMade) {
  start(R"({"except": ["points", "objects"]})");

  sweeps_.publish(sweep({}));
  seen_.publish({});

  EXPECT_TRUE(clouds_.take().empty());
  EXPECT_TRUE(objects_.take().empty());
  EXPECT_EQ(transforms_.take().size(), 1U);
}

TEST(Visualization, UnknownOutputsAreErrors) {
  Bench bench;
  bench.add<Visualization>("visualization", R"({"params": {"except": ["pionts"]}})");

  EXPECT_THAT([&] { bench.start(); }, ::testing::ThrowsMessage<std::runtime_error>(
                                          ::testing::HasSubstr("found \"pionts\"")));
}

}  // namespace
}  // namespace ads
