#include "hd_map.h"

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <utility>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>

#include "common/commonroad.h"
#include "common/plane.h"
#include "lane_graph.h"
#include "map_file.h"

namespace ads {
namespace {

using fastcycle::testing::Bench;
using ::testing::HasSubstr;

// Two lanelets of Karlsruhe with 430 m of road between them.
constexpr std::int64_t kBegin = 45252;
constexpr std::int64_t kEnd = 45558;

class HdMapTest : public ::testing::Test {
 protected:
  HdMapTest() {
    bench_.configure(R"({"topics": {"map/tile": {"latched": 1}, "map/route": {"latched": 1}}})");
    bench_.add<HdMap>("hd_map",
                      R"({"params": {"map": ")" + file_.string() + R"(", "radius_m": 60}})");
    bench_.start();
  }

  void start_at(double x_m, double y_m, double heading_rad) {
    mission::InitialPose pose;
    pose.set_x_m(x_m);
    pose.set_y_m(y_m);
    pose.set_heading_rad(heading_rad);
    poses_.publish(pose);
  }

  void drive_to(double x_m, double y_m) {
    localization::Ego ego;
    ego.set_x_m(x_m);
    ego.set_y_m(y_m);
    ego.set_quality(localization::GOOD);
    egos_.publish(ego);
  }

  std::filesystem::path file_ =
      std::filesystem::path(ADS_DIR) / "data/commonroad/USA_US101-23_1_T-1.xml";
  Scenario scenario_ = Scenario::read(file_);
  Bench bench_;
  Bench::Input<mission::InitialPose> poses_ =
      bench_.input<mission::InitialPose>("mission/initial_pose");
  Bench::Input<mission::Goal> goals_ = bench_.input<mission::Goal>("mission/goal");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Output<hd_map::Tile> tiles_ = bench_.output<hd_map::Tile>("map/tile");
  Bench::Output<hd_map::Route> routes_ = bench_.output<hd_map::Route>("map/route");
  Bench::Caller<hd_map::TileRequest, hd_map::Tile> caller_ =
      bench_.client<hd_map::TileRequest, hd_map::Tile>("map/tiles");
};

TEST_F(HdMapTest, TileComesAtTheStartAndWhenTheVehicleHasMoved) {
  start_at(0.0, 0.0, -0.7);
  const auto first = tiles_.take();
  ASSERT_EQ(first.size(), 1U);
  EXPECT_GE(first[0].lanes_size(), 6);
  EXPECT_EQ(first[0].lanes(0).left().x_m_size(), first[0].lanes(0).right().x_m_size());
  EXPECT_EQ(first[0].header().frame(), "map");

  drive_to(10.0, -10.0);
  EXPECT_TRUE(tiles_.take().empty());
  drive_to(15.0, -15.0);
  EXPECT_EQ(tiles_.take().size(), 1U);
}

TEST_F(HdMapTest, TilesAreServedOnRequest) {
  hd_map::TileRequest request;
  request.set_radius_m(5'000.0);
  const auto all = caller_.call(request);
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(all->lanes_size(), 18);

  request.set_radius_m(-1.0);
  const auto refused = caller_.call(request);
  EXPECT_EQ(refused.status(), fastcycle::CallStatus::kRejected);
  EXPECT_THAT(refused.error(), HasSubstr("radius"));
}

TEST_F(HdMapTest, RouteLeadsFromBeforeTheSceneToItsGoal) {
  const PlanningProblem& problem = scenario_.problem();
  const ScenarioState& initial = problem.initial;
  const Eigen::Vector2d start =
      initial.position_m - 2.0 * initial.speed_mps * direction(initial.heading_rad);
  const Box& box = problem.goals.at(0).boxes.at(0);
  mission::Goal goal;
  goal.mutable_rectangle()->set_x_m(box.center_m.x());
  goal.mutable_rectangle()->set_y_m(box.center_m.y());
  goals_.publish(goal);
  EXPECT_TRUE(routes_.take().empty());
  start_at(start.x(), start.y(), initial.heading_rad);

  const auto routes = routes_.take();

  ASSERT_EQ(routes.size(), 1U);
  const hd_map::Route& route = routes[0];
  ASSERT_TRUE(route.is_found()) << route.reason();
  ASSERT_GE(route.sections_size(), 2);
  EXPECT_EQ(route.sections(0).lanes_size(), 6);
  EXPECT_EQ(route.sections(0).continuing_size(), 6);
  EXPECT_EQ(route.sections(route.sections_size() - 1).continuing_size(), 1);
  std::vector<Eigen::Vector2d> points;
  for (int index = 0; index < route.reference().x_m_size(); ++index) {
    points.emplace_back(route.reference().x_m(index), route.reference().y_m(index));
  }
  ASSERT_EQ(route.left_edge_m_size(), route.reference().x_m_size());
  const Polyline line(points);
  EXPECT_LT(std::abs(line.project(start).offset_m), 4.0);
  EXPECT_GT(line.project(start).along_m, 30.0);
  EXPECT_LT(std::abs(line.project(box.center_m).offset_m), 2.5);
  EXPECT_LT(line.project(box.center_m).along_m, line.length_m() - 30.0);
  for (std::size_t index = 0; index < points.size(); ++index) {
    EXPECT_LT(std::abs(line.curvature_at(line.arclengths_m()[index])), 0.01);
    EXPECT_GT(route.left_edge_m(static_cast<int>(index)), 1.0);
    EXPECT_GT(route.right_edge_m(static_cast<int>(index)), 1.0);
  }
}

TEST_F(HdMapTest, GoalOffTheMapIsReportedWithTheReason) {
  start_at(scenario_.problem().initial.position_m.x(), scenario_.problem().initial.position_m.y(),
           scenario_.problem().initial.heading_rad);
  mission::Goal goal;
  goal.mutable_rectangle()->set_x_m(5'000.0);
  goals_.publish(goal);

  const auto routes = routes_.take();

  ASSERT_EQ(routes.size(), 1U);
  EXPECT_FALSE(routes[0].is_found());
  EXPECT_THAT(routes[0].reason(), HasSubstr("the goal (5000.0, 0.0)"));
}

// A drive through Karlsruhe along the route's reference, in steps of 2 m.
TEST(ManyTiles, OfARealMapComeAlongTheWay) {
  const auto file = std::filesystem::path(ADS_DIR) / "data/lanelet2/karlsruhe.osm";
  const LaneGraph graph = read_map(file).graph;
  const Polyline& begin = graph.node(kBegin).center;
  Bench bench;
  bench.configure(R"({"topics": {"map/tile": {"latched": 1}, "map/route": {"latched": 1}}})");
  bench.add<HdMap>("hd_map", R"({"params": {"map": ")" + file.string() + R"(", "radius_m": 60}})");
  auto poses = bench.input<mission::InitialPose>("mission/initial_pose");
  auto goals = bench.input<mission::Goal>("mission/goal");
  auto egos = bench.input<localization::Ego>("localization/ego");
  auto tiles = bench.output<hd_map::Tile>("map/tile");
  auto routes = bench.output<hd_map::Route>("map/route");
  bench.start();
  mission::Goal goal;
  goal.add_lanes(kEnd);
  goals.publish(goal);
  mission::InitialPose pose;
  pose.set_x_m(begin.point_at(0.0).x());
  pose.set_y_m(begin.point_at(0.0).y());
  pose.set_heading_rad(begin.heading_at(0.0));
  poses.publish(pose);
  const auto found = routes.take();
  ASSERT_EQ(found.size(), 1U);
  ASSERT_TRUE(found[0].is_found()) << found[0].reason();
  const hd_map::Line& way = found[0].reference();
  ASSERT_GT(way.x_m_size(), 500);

  hd_map::Tile tile = tiles.take().at(0);
  std::size_t count = 1;
  for (int index = 60; index < way.x_m_size() - 60; index += 2) {
    const Eigen::Vector2d place(way.x_m(index), way.y_m(index));
    localization::Ego ego;
    ego.set_x_m(place.x());
    ego.set_y_m(place.y());
    ego.set_quality(localization::GOOD);
    egos.publish(ego);
    for (hd_map::Tile& next : tiles.take()) {
      tile = std::move(next);
      ++count;
    }
    EXPECT_LT((place - Eigen::Vector2d(tile.x_m(), tile.y_m())).norm(), 20.0 + 1e-9);
    std::set<std::int64_t> sent;
    for (const hd_map::Lane& lane : tile.lanes()) {
      sent.insert(lane.id());
    }
    for (const std::int64_t id : graph.within(place, 39.0)) {
      EXPECT_TRUE(sent.contains(id)) << "lane " << id << " near " << place.transpose();
    }
    EXPECT_FALSE(graph.within(place, 0.5).empty());
  }
  EXPECT_GT(count, 15U);
}

TEST(HdMap, MissingFileIsNamed) {
  Bench bench;
  bench.add<HdMap>("hd_map", R"({"params": {"map": "/no/such/map.xml"}})");
  bench.start();

  EXPECT_THAT(bench.faults("hd_map"), ::testing::ElementsAre(HasSubstr("/no/such/map.xml")));
}

}  // namespace
}  // namespace ads
