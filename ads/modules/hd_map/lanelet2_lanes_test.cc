#include "lanelet2_lanes.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "lane_graph.h"
#include "map_file.h"
#include "osm_text.h"

namespace ads {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::map<std::int64_t, MapLane> lanes_of(const OsmText& osm) {
  std::map<std::int64_t, MapLane> lanes;
  for (MapLane& lane : lanelet2_lanes(osm.text(), "x.osm").lanes) {
    lanes.emplace(lane.id, std::move(lane));
  }
  return lanes;
}

std::string error_of(const std::string& text, const MapLimits& limits = {}) {
  try {
    (void)parse_map(text, "x.osm", limits);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

// Two lanes from west to east, 100 m and 100 m, beside each other: ways 11 and 12 to the left, 21
// and 22 between, 31 and 32 to the right.
OsmText two_lanes(OsmText::Tags line = {{"type", "line_thin"}, {"subtype", "dashed"}}) {
  OsmText osm;
  for (int x = 0; x < 3; ++x) {
    for (int y = 0; y < 3; ++y) {
      osm.node(10 * y + x + 1, 100.0 * x, -3.5 * y);
    }
  }
  osm.way(11, {1, 2}).way(12, {2, 3});
  osm.way(21, {11, 12}, line).way(22, {12, 13}, line);
  osm.way(31, {21, 22}).way(32, {22, 23});
  return osm;
}

TEST(Lanelet2, LanesFollowEachOtherAndLieSideBySide) {
  auto lanes =
      lanes_of(two_lanes().road(101, 11, 21).road(102, 12, 22).road(201, 21, 31).road(202, 22, 32));

  ASSERT_EQ(lanes.size(), 4U);
  EXPECT_THAT(lanes[101].successors, ElementsAre(102));
  EXPECT_THAT(lanes[102].predecessors, ElementsAre(101));
  EXPECT_THAT(lanes[102].successors, IsEmpty());
  ASSERT_TRUE(lanes[101].right);
  EXPECT_EQ(lanes[101].right->id, 201);
  EXPECT_TRUE(lanes[101].right->may_change());
  ASSERT_TRUE(lanes[201].left);
  EXPECT_EQ(lanes[201].left->id, 101);
  EXPECT_FALSE(lanes[201].right);
}

TEST(Lanelet2, PlacesAreEastAndNorthOfTheMiddleOfItsLanes) {
  const auto map = lanelet2_lanes(two_lanes().road(201, 21, 31).road(102, 12, 22).text(), "x.osm");

  EXPECT_NEAR(map.origin.latitude_deg, 49.0 - 3.5 * 8.9926e-6, 1e-9);
  EXPECT_NEAR(map.origin.longitude_deg, 8.0 + 100.0 * 1.36665e-5, 1e-9);
  const MapLane& lane = map.lanes.at(1);
  EXPECT_NEAR(lane.left_m.front().x(), -100.0, 0.02);
  EXPECT_NEAR(lane.left_m.front().y(), 0.0, 0.001);
  EXPECT_NEAR(lane.right_m.back().x(), 0.0, 0.01);
  EXPECT_NEAR(lane.right_m.back().y(), -3.5, 0.001);
}

TEST(Lanelet2, WaysMayRunEitherWay) {
  OsmText osm = two_lanes();
  osm.way(41, {12, 11}).way(42, {2, 1});

  auto lanes = lanes_of(osm.road(101, 42, 41).road(102, 12, 22));

  EXPECT_THAT(lanes[101].successors, ElementsAre(102));
  EXPECT_GT(lanes[101].left_m.back().x(), lanes[101].left_m.front().x());
  EXPECT_GT(lanes[101].right_m.back().x(), lanes[101].right_m.front().x());
}

TEST(Lanelet2, BoundMayHaveSeveralWaysOfEitherOrientation) {
  OsmText osm = two_lanes();
  osm.way(41, {2, 1}).way(43, {13, 12});
  osm.relation(101, {{"left", 41}, {"left", 12}, {"right", 21}, {"right", 43}},
               {{"type", "lanelet"}, {"subtype", "road"}});

  auto lanes = lanes_of(osm);

  EXPECT_NEAR(lanes[101].left_m.back().x() - lanes[101].left_m.front().x(), 200.0, 0.1);
  EXPECT_NEAR(lanes[101].right_m.back().x() - lanes[101].right_m.front().x(), 200.0, 0.1);
}

TEST(Lanelet2, LineBetweenSaysWhoMayChange) {
  const auto changes = [](OsmText::Tags line) {
    auto lanes = lanes_of(two_lanes(line).road(101, 11, 21).road(201, 21, 31));
    return std::string(lanes[101].right->may_change() ? "right " : "") +
           (lanes[201].left->may_change() ? "left" : "");
  };
  EXPECT_EQ(changes({{"type", "line_thick"}, {"subtype", "dashed"}}), "right left");
  EXPECT_EQ(changes({{"type", "line_thin"}, {"subtype", "solid"}}), "");
  EXPECT_EQ(changes({{"type", "line_thin"}, {"subtype", "dashed_solid"}}), "right ");
  EXPECT_EQ(changes({{"type", "line_thin"}, {"subtype", "solid_dashed"}}), "left");
  EXPECT_EQ(changes({{"type", "virtual"}}), "");
  EXPECT_EQ(changes({{"type", "curbstone"}, {"subtype", "low"}}), "");
  EXPECT_EQ(changes({{"type", "virtual"}, {"lane_change", "yes"}}), "right left");
}

TEST(Lanelet2, LaneThatIsDrivenBothWaysIsTwo) {
  auto lanes = lanes_of(two_lanes()
                            .road(101, 11, 21, {{"one_way", "no"}})
                            .road(102, 12, 22, {{"one_way", "no"}})
                            .road(201, 21, 31));

  ASSERT_EQ(lanes.size(), 5U);
  EXPECT_THAT(lanes[101].successors, ElementsAre(102));
  EXPECT_THAT(lanes[-102].successors, ElementsAre(-101));
  EXPECT_LT(lanes[-101].left_m.back().x(), lanes[-101].left_m.front().x());
  EXPECT_TRUE(lanes[101].right->may_change());
  ASSERT_TRUE(lanes[-101].left);
  EXPECT_EQ(lanes[-101].left->id, 201);
  EXPECT_FALSE(lanes[-101].left->is_same_direction);
  EXPECT_THAT(
      LaneGraph({lanes[101], lanes[102], lanes[-101], lanes[-102], lanes[201]}).node(101).conflicts,
      IsEmpty());
}

TEST(Lanelet2, WhoTakesPartSaysWhetherCarsMayDrive) {
  auto lanes = lanes_of(two_lanes()
                            .road(101, 11, 21, {{"participant:pedestrian", "yes"}})
                            .road(102, 12, 22, {{"participant:vehicle", "yes"}})
                            .relation(201, {{"left", 21}, {"right", 31}},
                                      {{"type", "lanelet"}, {"subtype", "crosswalk"}})
                            .relation(202, {{"left", 22}, {"right", 32}},
                                      {{"type", "lanelet"}, {"subtype", "bicycle_lane"}}));

  EXPECT_EQ(lanes[101].kind, LaneKind::kOther);
  EXPECT_EQ(lanes[102].kind, LaneKind::kRoad);
  EXPECT_EQ(lanes[201].kind, LaneKind::kCrossing);
  EXPECT_EQ(lanes[202].kind, LaneKind::kOther);
}

TEST(Lanelet2, SpeedLimitIsOfItsSignItsTagOrTheLaw) {
  OsmText osm = two_lanes();
  osm.way(51, {1, 2}, {{"type", "traffic_sign"}, {"subtype", "de274-60"}});
  osm.relation(300, {{"refers", 51}}, {{"type", "regulatory_element"}, {"subtype", "speed_limit"}});
  osm.relation(101, {{"left", 11}, {"right", 21}, {"regulatory_element", 300}},
               {{"type", "lanelet"}, {"subtype", "road"}});
  osm.road(102, 12, 22, {{"speed_limit", "30 mph"}});
  osm.road(201, 21, 31, {{"region", "de"}, {"location", "urban"}}).road(202, 22, 32);

  auto lanes = lanes_of(osm);

  EXPECT_NEAR(lanes[101].speed_limit_mps, 60.0 / 3.6, 1e-9);
  EXPECT_NEAR(lanes[102].speed_limit_mps, 13.4112, 1e-9);
  EXPECT_NEAR(lanes[201].speed_limit_mps, 50.0 / 3.6, 1e-9);
  EXPECT_EQ(lanes[202].speed_limit_mps, 0.0);
}

TEST(Lanelet2, RightOfWayGivesPriorityAndAStopLine) {
  OsmText osm = two_lanes();
  osm.way(51, {12, 2});
  osm.relation(300, {{"right_of_way", 201}, {"yield", 101}, {"ref_line", 51}},
               {{"type", "regulatory_element"}, {"subtype", "right_of_way"}});

  auto lanes = lanes_of(osm.road(101, 11, 21).road(201, 21, 31));

  EXPECT_EQ(lanes[101].priority, -1);
  EXPECT_EQ(lanes[201].priority, 1);
  ASSERT_TRUE(lanes[101].stop_line);
  EXPECT_EQ(lanes[101].stop_line->at(0), lanes[101].left_m.back());
  EXPECT_FALSE(lanes[201].stop_line);
}

TEST(Lanelet2, StopSignAsksForAStopAtItsLine) {
  for (const auto& [sign, is_stop] : {std::pair("de206", true), std::pair("de205", false)}) {
    OsmText osm = two_lanes();
    osm.way(51, {12, 2}).way(52, {12, 2}, {{"type", "traffic_sign"}, {"subtype", sign}});
    osm.relation(300, {{"refers", 52}, {"ref_line", 51}},
                 {{"type", "regulatory_element"}, {"subtype", "traffic_sign"}});

    osm.relation(101, {{"left", 11}, {"right", 21}, {"regulatory_element", 300}},
                 {{"type", "lanelet"}, {"subtype", "road"}});

    auto lanes = lanes_of(osm);

    EXPECT_EQ(lanes[101].has_stop_sign, is_stop);
    EXPECT_TRUE(lanes[101].stop_line);
  }
}

TEST(Lanelet2, PriorityHoldsThroughTheIntersectionUntilOthersJoin) {
  OsmText osm = two_lanes();
  osm.node(4, 250.0, 0.0).node(14, 250.0, -3.5).node(50, 150.0, 60.0).node(51, 153.5, 60.0);
  osm.way(13, {3, 4}).way(23, {13, 14}).way(61, {51, 3}).way(62, {50, 13});
  osm.relation(300, {{"yield", 101}},
               {{"type", "regulatory_element"}, {"subtype", "right_of_way"}});
  osm.road(101, 11, 21).road(102, 12, 22).road(103, 13, 23).road(104, 61, 62);

  auto lanes = lanes_of(osm);

  ASSERT_THAT(lanes[103].predecessors, ElementsAre(102, 104));
  EXPECT_EQ(lanes[101].priority, -1);
  EXPECT_EQ(lanes[102].priority, -1);
  EXPECT_EQ(lanes[103].priority, 0);
  EXPECT_EQ(lanes[104].priority, 0);
}

TEST(Lanelet2, WhatIsWrongIsReportedWithItsLine) {
  EXPECT_EQ(error_of(OsmText().way(11, {1}).way(12, {1}).road(101, 11, 12).text()),
            "x.osm:9: expected <node> 1, to which this <relation> refers, found none");
  EXPECT_EQ(error_of(OsmText().road(101, 11, 12).text()),
            "x.osm:4: expected <way> 11, to which this <member> refers, found none");
  EXPECT_THAT(error_of(two_lanes().road(101, 11, 21).road(101, 12, 22).text()),
              HasSubstr("expected no second <relation> 101, found one"));
  EXPECT_THAT(error_of(two_lanes().node(1, 0.0, 0.0).text()),
              HasSubstr("expected no second <node> 1, found one"));
  EXPECT_THAT(error_of(two_lanes().relation(101, {{"left", 11}}, {{"type", "lanelet"}}).text()),
              HasSubstr("expected a way with role right of a lanelet, found none"));
  EXPECT_THAT(
      error_of(
          two_lanes().relation(101, {{"left", 11}, {"left", 22}}, {{"type", "lanelet"}}).text()),
      HasSubstr(
          "expected a way that begins or ends at node 1, as the one before it does, found one "
          "from node 12 to node 13"));
  EXPECT_THAT(error_of(two_lanes().road(101, 11, 21, {{"speed_limit", "-3"}}).text()),
              HasSubstr("expected a speed_limit such as '50 km/h', found '-3'"));
  EXPECT_THAT(error_of(two_lanes().node(77, 5e6, 0.0).way(71, {1, 77}).road(1, 71, 31).text()),
              HasSubstr("within 50000 m of the middle of the map"));
  EXPECT_THAT(error_of(OsmText().way(11, {1, 1}).node(1, 0.0, 0.0).road(1, 11, 11).text()),
              HasSubstr("two different places on each side of a lanelet, found one"));
  EXPECT_EQ(error_of("<osm version='0.6'/>"),
            "x.osm:1: expected a relation of type=lanelet in <osm>, found none");
  EXPECT_EQ(error_of("<osm version='0.5'/>"),
            "x.osm:1: expected version 0.6 of <osm>, found '0.5'");
  EXPECT_THAT(error_of("<osm version='0.6'><node id='1' lat='nan' lon='8'/></osm>"),
              HasSubstr("as lat of <node>, found 'nan'"));
  EXPECT_THAT(error_of("<osm version='0.6'><node id='1' lat='91' lon='8'/></osm>"),
              HasSubstr("expected lat from -90 to 90"));
  EXPECT_THAT(error_of("<osm version='0.6'><way id='1'>"), HasSubstr("x.osm:1: expected XML"));
  EXPECT_EQ(error_of("<!-- <osm> --> <gpx/>"),
            "x.osm:1: expected <commonRoad>, <osm> or <OpenDRIVE>, found 'gpx'");
}

// Lanelets that ask for more than their number: they are refused, and soon.
TEST(ManyLanelets, UponEachOtherAreRefused) {
  OsmText osm = two_lanes();
  for (int id = 1; id <= 65; ++id) {
    osm.road(1000 + id, 11, 21);
  }
  EXPECT_THAT(error_of(osm.text()),
              HasSubstr("at most 64 lanelets with the same side, found more"));

  OsmText crossing;
  for (int id = 1; id <= 500; ++id) {
    const double angle = 3.1 * id / 500.0;
    crossing.node(4 * id, -50.0 * std::cos(angle), -50.0 * std::sin(angle));
    crossing.node(4 * id + 1, 50.0 * std::cos(angle), 50.0 * std::sin(angle));
    crossing.node(4 * id + 2, -50.0 * std::cos(angle), -50.0 * std::sin(angle) + 3.0);
    crossing.node(4 * id + 3, 50.0 * std::cos(angle), 50.0 * std::sin(angle) + 3.0);
    crossing.way(2 * id, {4 * id, 4 * id + 1}).way(2 * id + 1, {4 * id + 2, 4 * id + 3});
    crossing.road(id, 2 * id, 2 * id + 1);
  }
  EXPECT_THAT(error_of(crossing.text(), {.work = 100'000, .work_per_lane = 1}),
              HasSubstr("to lie upon each other in fewer places"));
}

TEST(ManyLanelets, WithLongWaysInCommonAreRefused) {
  std::string text = "<osm version='0.6'>";
  std::string way;
  for (int node = 1; node <= 1000; ++node) {
    text += fmt::format("<node id='{}' lat='49' lon='8.{:06}'/>", node, node);
    way += fmt::format("<nd ref='{}'/>", node);
  }
  text += "<way id='1'>" + way + "</way>";
  for (int id = 1; id <= 3000; ++id) {
    text += fmt::format(
        "<relation id='{}'><tag k='type' v='lanelet'/><member type='way' ref='1' "
        "role='left'/><member type='way' ref='1' role='right'/></relation>",
        id);
  }
  EXPECT_EQ(error_of(text + "</osm>"),
            "x.osm:1: expected at most 4000000 nodes of all lanelets' ways, found more");
}

TEST(ManyLanelets, NestedDeepOrCutOffAnywhereAreNoHarm) {
  std::string nested = "<osm version='0.6'>";
  for (int depth = 0; depth < 200'000; ++depth) {
    nested += "<way>";
  }
  EXPECT_THAT(error_of(nested), HasSubstr("x.osm:1: expected XML"));
  const std::string whole = two_lanes().road(101, 11, 21).road(102, 12, 22).text();
  for (std::size_t size = 0; size + 2 < whole.size(); size += 7) {
    EXPECT_THAT(error_of(whole.substr(0, size)), HasSubstr("x.osm:")) << size;
  }
}

TEST(ManyLanelets, OfKarlsruheAreJoined) {
  const auto file = std::filesystem::path(ADS_DIR) / "data/lanelet2/karlsruhe.osm";
  const MapFile map = read_map(file);

  std::size_t roads = 0;
  std::size_t crossings = 0;
  std::size_t successors = 0;
  std::size_t changes = 0;
  std::size_t yielding = 0;
  for (const auto& [id, node] : map.graph.nodes()) {
    roads += node.is_drivable() ? 1U : 0U;
    crossings += node.lane.kind == LaneKind::kCrossing ? 1U : 0U;
    successors += node.is_drivable() ? node.lane.successors.size() : 0U;
    changes += node.lane.left && node.lane.left->may_change() && node.is_drivable() ? 1U : 0U;
    yielding += node.yields_to.empty() ? 0U : 1U;
  }
  ASSERT_TRUE(map.origin);
  EXPECT_NEAR(map.origin->latitude_deg, 49.0065, 0.001);
  EXPECT_EQ(roads, 388U);
  EXPECT_EQ(crossings, 8U);
  EXPECT_EQ(successors, 378U);
  EXPECT_EQ(changes, 57U);
  EXPECT_EQ(yielding, 25U);
  // Out of a side street to who drives along the main road; and there to who walks.
  EXPECT_THAT(map.graph.node(45030).yields_to, ElementsAre(44988, 44992, 44996, 45000, 45078));
  EXPECT_THAT(map.graph.node(44992).yields_to, IsEmpty());
  EXPECT_THAT(map.graph.node(44982).yields_to, ElementsAre(44986));
}

}  // namespace
}  // namespace ads
