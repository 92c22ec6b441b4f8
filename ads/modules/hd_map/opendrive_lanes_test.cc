#include "opendrive_lanes.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "common/files.h"
#include "lane_graph.h"
#include "map_file.h"

namespace ads {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::filesystem::path kCrossing =
    std::filesystem::path(ADS_DIR) / "data/opendrive/crossing.xodr";

// Lanes by their place in the file: road, section, lane.
std::map<std::string, MapLane> lanes_of(std::string_view text) {
  std::map<std::string, MapLane> lanes;
  for (MapLane& lane : opendrive_lanes(text, "x.xodr")) {
    lanes.emplace(lane.name, std::move(lane));
  }
  return lanes;
}

class OpenDrive : public ::testing::Test {
 protected:
  const MapLane& lane(int road, int section, int number) {
    return lanes_.at(fmt::format("road {}, section {}, lane {}", road, section, number));
  }
  std::int64_t id(int road, int section, int number) { return lane(road, section, number).id; }

  std::map<std::string, MapLane> lanes_ = lanes_of(read_file(kCrossing));
};

// A road of 100 m with lane -1, and what is put in.
std::string road(std::string_view in_lane = {}, std::string_view in_link = {},
                 std::string_view more = {}, std::string_view section = "<laneSection s='0'>") {
  return fmt::format(
      "<OpenDRIVE><header revMajor='1'/>\n<road id='1' length='100'><link>{}</link>\n<planView>"
      "<geometry s='0' x='0' y='0' hdg='0' length='100'><line/></geometry></planView>\n"
      "<lanes>{}<right><lane id='-1' type='driving'>"
      "<width sOffset='0' a='3.5' b='0' c='0' d='0'/>{}</lane></right></laneSection></lanes>"
      "</road>\n{}</OpenDRIVE>",
      in_link, section, in_lane, more);
}

std::string error_of(const std::string& text) {
  try {
    (void)parse_map(text, "x.xodr");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST_F(OpenDrive, RightLanesAreDrivenAlongTheRoadAndLeftOnesBack) {
  const MapLane& right = lane(1, 0, -2);
  EXPECT_NEAR(right.left_m.front().x(), 0.0, 1e-9);
  EXPECT_NEAR(right.left_m.front().y(), -3.5, 1e-9);
  EXPECT_NEAR(right.right_m.back().x(), 100.0, 1e-9);
  EXPECT_NEAR(right.right_m.back().y(), -7.0, 1e-9);
  const MapLane& left = lane(1, 0, 1);
  EXPECT_NEAR(left.left_m.front().x(), 100.0, 1e-9);
  EXPECT_NEAR(left.left_m.front().y(), 0.0, 1e-9);
  EXPECT_NEAR(left.right_m.back().x(), 0.0, 1e-9);
  EXPECT_NEAR(left.right_m.back().y(), 3.5, 1e-9);
}

TEST_F(OpenDrive, LanesLeadThroughSectionsRoadsAndJunctions) {
  EXPECT_THAT(lane(1, 0, -1).successors, ElementsAre(id(1, 1, -1)));
  EXPECT_THAT(lane(1, 1, 1).successors, ElementsAre(id(1, 0, 1)));
  EXPECT_THAT(lane(1, 1, -1).successors, ElementsAre(id(3, 0, -1)));
  EXPECT_THAT(lane(1, 1, -2).successors, ElementsAre(id(2, 0, -1)));
  EXPECT_THAT(lane(1, 1, -3).successors, IsEmpty());
  EXPECT_THAT(lane(2, 0, -1).successors, ElementsAre(id(4, 0, -1)));
  EXPECT_THAT(lane(3, 0, -1).successors, ElementsAre(id(5, 0, 1)));
  EXPECT_THAT(lane(5, 0, 1).predecessors, ElementsAre(id(3, 0, -1)));
  EXPECT_TRUE(lane(3, 0, -1).is_in_intersection);
  EXPECT_FALSE(lane(1, 0, -1).is_in_intersection);
}

TEST_F(OpenDrive, LanesThatFollowEachOtherMeet) {
  for (const auto& [name, before] : lanes_) {
    for (const std::int64_t next : before.successors) {
      for (const auto& [other, after] : lanes_) {
        if (after.id == next) {
          EXPECT_LT((before.left_m.back() - after.left_m.front()).norm(), 1e-6) << name << other;
          EXPECT_LT((before.right_m.back() - after.right_m.front()).norm(), 1e-6) << name << other;
        }
      }
    }
  }
}

TEST_F(OpenDrive, MarkBetweenSaysWhoMayChange) {
  ASSERT_TRUE(lane(1, 0, -1).right);
  EXPECT_EQ(lane(1, 0, -1).right->id, id(1, 0, -2));
  EXPECT_TRUE(lane(1, 0, -1).right->may_change());
  EXPECT_TRUE(lane(1, 0, -2).left->may_change());
  EXPECT_FALSE(lane(1, 1, -1).right->may_change());
  EXPECT_TRUE(lane(1, 1, -3).left->may_change());
  ASSERT_TRUE(lane(1, 1, -1).left);
  EXPECT_EQ(lane(1, 1, -1).left->id, id(1, 1, 1));
  EXPECT_FALSE(lane(1, 1, -1).left->is_same_direction);
  ASSERT_TRUE(lane(1, 1, 1).left);
  EXPECT_EQ(lane(1, 1, 1).left->id, id(1, 1, -1));
}

TEST_F(OpenDrive, AttributeOfTheMarkCountsMoreThanItsType) {
  const std::string text = read_file(kCrossing);
  const std::string mark = "<roadMark sOffset='0' type='broken'/>";
  std::string changed = text;
  changed.replace(text.find(mark), mark.size(),
                  "<roadMark sOffset='0' type='broken' laneChange='increase'/>");
  auto lanes = lanes_of(changed);
  EXPECT_FALSE(lanes["road 1, section 0, lane -1"].right->may_change());
  EXPECT_TRUE(lanes["road 1, section 0, lane -2"].left->may_change());
}

TEST_F(OpenDrive, SpeedIsTheLanesOrTheRoads) {
  EXPECT_NEAR(lane(1, 1, -1).speed_limit_mps, 50.0 / 3.6, 1e-9);
  EXPECT_NEAR(lane(5, 0, 1).speed_limit_mps, 30.0 / 3.6, 1e-9);
  EXPECT_EQ(lane(4, 0, -1).speed_limit_mps, 0.0);
}

TEST_F(OpenDrive, KindsAndPriority) {
  EXPECT_EQ(lane(1, 0, -1).kind, LaneKind::kRoad);
  EXPECT_EQ(lane(1, 0, -3).kind, LaneKind::kOther);
  EXPECT_EQ(lane(2, 0, -1).priority, 1);
  EXPECT_EQ(lane(3, 0, -1).priority, -1);
}

TEST_F(OpenDrive, WidthsAreCubicsFromTheirPlaces) {
  const MapLane& third = lane(1, 1, -3);
  EXPECT_NEAR((third.left_m.front() - third.right_m.front()).norm(), 0.0, 1e-9);
  EXPECT_NEAR((third.left_m[25] - third.right_m[25]).norm(), 1.75, 1e-9);
  EXPECT_NEAR((third.left_m.back() - third.right_m.back()).norm(), 3.5, 1e-9);
}

TEST_F(OpenDrive, OnTheLeftHandLanesAreDrivenTheOtherWay) {
  std::string text = road();
  text.replace(text.find("<road id"), 5, "<road rule='LHT'");
  EXPECT_NEAR(lanes_of(text).begin()->second.left_m.front().x(), 100.0, 1e-9);
}

TEST_F(OpenDrive, WhatIsWrongIsReportedWithItsLine) {
  EXPECT_EQ(error_of("<OpenDRIVE/>"), "x.xodr:1: expected <header> in <OpenDRIVE>, found none");
  EXPECT_EQ(error_of("<OpenDRIVE><header revMajor='2'/></OpenDRIVE>"),
            "x.xodr:1: expected revMajor 1 of <header>, found '2'");
  EXPECT_EQ(error_of("<OpenDRIVE><header revMajor='1'/></OpenDRIVE>"),
            "x.xodr:1: expected <lane> in a <road>, found none");
  EXPECT_EQ(
      error_of(road("", "<successor elementType='road' elementId='7' contactPoint='start'/>")),
      "x.xodr:2: expected road '7', to which this <successor> refers, found none");
  EXPECT_EQ(error_of(road("", "<successor elementType='road' elementId='7'/>")),
            "x.xodr:2: expected an attribute contactPoint of <successor>, found none");
  EXPECT_EQ(error_of(road("<link><successor id='-4'/></link>",
                          "<successor elementType='road' elementId='1' contactPoint='start'/>")),
            "x.xodr:4: expected lane -4, to which this <lane> refers, found none");
  EXPECT_EQ(error_of(road("<speed max='fast'/>")),
            "x.xodr:4: expected a number of at most 1e+08 as max of <speed>, found 'fast'");
  EXPECT_EQ(error_of(road("</lane><lane id='-3' type='driving'>")),
            "x.xodr:4: expected lane -2 between lane -3 and the middle, found none");
  EXPECT_EQ(error_of(road("</lane><lane id='-1' type='driving'>")),
            "x.xodr:4: expected no second lane -1 in the section, found one");
  EXPECT_EQ(error_of(road("", "", "", "<laneSection s='200'>")),
            "x.xodr:4: expected <laneSection> at s from 0 to less than 100, found 200");
  EXPECT_EQ(error_of(road("<width sOffset='-5' a='1' b='0' c='0' d='0'/>")),
            "x.xodr:4: expected sOffset of <width> in ascending order, found -5 after 0");
  EXPECT_EQ(error_of(road("", "",
                          "<junction id='4'><connection incomingRoad='1' "
                          "connectingRoad='1' contactPoint='start'/></junction>")),
            "x.xodr:5: expected road '1' to lead into junction '4', found no such link");
}

TEST_F(OpenDrive, RoadThatFollowsItselfIsARing) {
  auto lanes = lanes_of(road("<link><successor id='-1'/></link>",
                             "<successor elementType='road' elementId='1' contactPoint='start'/>"));
  EXPECT_THAT(lanes.begin()->second.successors, ElementsAre(1));
}

// Sections without end, one after the other, each with many lanes: refused before it takes memory.
TEST(ManyOpenDriveLanes, AreRefused) {
  std::string lanes;
  for (int number = 1; number <= 3000; ++number) {
    lanes += fmt::format(
        "<lane id='-{}' type='driving'><width sOffset='0' a='1' b='0' c='0' d='0'/>"
        "</lane>",
        number);
  }
  const std::string text =
      "<OpenDRIVE><header revMajor='1'/><road id='1' length='2000'><planView><geometry s='0' x='0' "
      "y='0' hdg='0' length='2000'><line/></geometry></planView><lanes><laneSection s='0'><right>" +
      lanes + "</right></laneSection></lanes></road></OpenDRIVE>";
  EXPECT_EQ(error_of(text),
            "x.xodr:1: expected at most 4000000 points of all lanes' bounds, found more");
}

TEST(ManyOpenDriveLanes, CutOffAnywhereAreNoHarm) {
  const std::string whole = read_file(kCrossing);
  for (std::size_t size = 0; size + 2 < whole.size(); size += 29) {
    EXPECT_THAT(error_of(whole.substr(0, size)), HasSubstr("x.xodr:")) << size;
  }
}

TEST(ManyOpenDriveLanes, OfOtherFilesAreRead) {
  const char* const data = std::getenv("FASTCYCLE_DATA");
  const auto folder = std::filesystem::path(data == nullptr ? "" : data) / "hdmaps";
  if (data == nullptr || !std::filesystem::exists(folder / "fabriksgatan.xodr")) {
    GTEST_SKIP() << "FASTCYCLE_DATA names no folder with hdmaps/fabriksgatan.xodr";
  }
  std::size_t drivable = 0;
  const MapFile crossing = read_map(folder / "fabriksgatan.xodr");
  for (const auto& [id, node] : crossing.graph.nodes()) {
    drivable += node.is_drivable() ? 1U : 0U;
  }
  EXPECT_EQ(drivable, 20U);
  EXPECT_EQ(read_map(folder / "soderleden.xodr").graph.nodes().size(), 33U);
}

}  // namespace
}  // namespace ads
