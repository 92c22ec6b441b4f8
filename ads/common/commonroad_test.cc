#include "common/commonroad.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/files.h"

namespace ads {
namespace {

const std::filesystem::path kData = std::filesystem::path(ADS_DIR) / "data/commonroad";

std::string bound(std::string_view name, double y_m) {
  return fmt::format(
      "<{0}><point><x>0</x><y>{1}</y></point><point><x>100.0</x><y>{1}</y></point></{0}>", name,
      y_m);
}

std::string lanelet(int id, double y_m, std::string_view more = "") {
  return fmt::format("<lanelet id=\"{}\">{}{}{}</lanelet>\n", id, bound("leftBound", y_m + 1.5),
                     bound("rightBound", y_m - 1.5), more);
}

std::string state(std::string_view name, double x_m, std::string_view time) {
  return fmt::format(
      "<{0}><position><point><x>{1}</x><y>0</y></point></position>"
      "<orientation><exact>0.1</exact></orientation><velocity><exact>7</exact></velocity>"
      "<time>{2}</time></{0}>\n",
      name, x_m, time);
}

const std::string kGoal =
    "<goalState><time><intervalStart>10</intervalStart><intervalEnd>20</intervalEnd></time>"
    "</goalState>\n";

std::string problem(std::string_view goals = kGoal) {
  return fmt::format("<planningProblem id=\"9\">{}{}</planningProblem>",
                     state("initialState", 1.0, "<exact>0</exact>"), goals);
}

std::string file(std::string_view content, std::string_view version = "2020a") {
  return fmt::format(
      "<?xml version=\"1.0\"?>\n<commonRoad benchmarkID=\"TEST-1\" commonRoadVersion=\"{}\" "
      "timeStepSize=\"0.1\">\n{}\n</commonRoad>\n",
      version, content);
}

Scenario parse(std::string_view content, std::string_view version = "2020a") {
  return Scenario::parse(file(content, version), "x.xml");
}

std::string refusal_of_text(std::string_view text) {
  try {
    Scenario::parse(text, "x.xml");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

std::string refusal(std::string_view content) {
  return refusal_of_text(file(content));
}

TEST(CommonRoad, RecordedHighwayIsReadWhole) {
  const Scenario scenario = Scenario::read(kData / "USA_US101-23_1_T-1.xml");

  EXPECT_EQ(scenario.name, "USA_US101-23_1_T-1");
  EXPECT_EQ(scenario.version, "2020a");
  EXPECT_EQ(scenario.step_s, 0.1);
  EXPECT_EQ(scenario.lanelets.size(), 18U);
  EXPECT_EQ(scenario.obstacles.size(), 57U);
  const Obstacle& first = scenario.obstacles.front();
  EXPECT_EQ(first.id, 14);
  EXPECT_FALSE(first.is_static);
  EXPECT_EQ(first.type, "car");
  EXPECT_EQ(first.length_m, 7.3152);
  EXPECT_EQ(first.states.size(), 34U);
  EXPECT_EQ(first.states.back().step, 33);
  EXPECT_EQ(scenario.problem().id, 97);
  EXPECT_EQ(scenario.problem().initial.speed_mps, 16.8859);
  const GoalState& goal = scenario.problem().goals.at(0);
  EXPECT_EQ(goal.boxes.at(0).center_m, Eigen::Vector2d(173.0496, -137.6949));
  EXPECT_EQ(goal.heading_rad->low, -0.77835);
  EXPECT_EQ(goal.speed_mps->high, 19.5903);
  EXPECT_EQ(goal.first_step, 130);
  EXPECT_EQ(goal.last_step, 140);
}

TEST(CommonRoad, OlderVersionIsReadToo) {
  const Scenario scenario = Scenario::read(kData / "USA_US101-3_1_T-1.xml");

  EXPECT_EQ(scenario.version, "2018b");
  EXPECT_EQ(scenario.lanelets.size(), 12U);
  EXPECT_EQ(scenario.obstacles.size(), 35U);
  const auto only_seen_once =
      std::ranges::find_if(scenario.obstacles, [](const auto& o) { return o.states.size() == 1; });
  EXPECT_EQ(only_seen_once->id, 375);
  EXPECT_EQ(scenario.problem().initial.heading_rad, -0.72348);
}

TEST(CommonRoad, LanesOfARecordedHighwayAreJoined) {
  for (const char* name :
       {"USA_US101-23_1_T-1.xml", "USA_US101-3_1_T-1.xml", "USA_US101-4_1_T-1.xml"}) {
    const Scenario scenario = Scenario::read(kData / name);
    std::size_t joints = 0;
    for (const auto& [id, lane] : scenario.lanelets) {
      for (const std::int64_t next : lane.successors) {
        const Lanelet& successor = scenario.lanelets.at(next);
        EXPECT_LT((lane.left_m.back() - successor.left_m.front()).norm(), 0.1);
        EXPECT_LT((lane.right_m.back() - successor.right_m.front()).norm(), 0.1);
        ++joints;
      }
      if (lane.left) {
        EXPECT_TRUE(lane.left->is_same_direction);
        EXPECT_EQ(scenario.lanelets.at(lane.left->id).right->id, id);
      }
    }
    EXPECT_EQ(joints, name == std::string_view("USA_US101-23_1_T-1.xml") ? 12U : 6U);
  }
}

// A scene of a city, under a license of its own and so not shipped.
TEST(CommonRoad, IntersectionsOfACityAreRead) {
  const char* const data = std::getenv("FASTCYCLE_DATA");
  const auto path =
      std::filesystem::path(data == nullptr ? "" : data) / "commonroad/USA_Peach-2_1_T-1.xml";
  if (data == nullptr || !std::filesystem::exists(path)) {
    GTEST_SKIP() << "FASTCYCLE_DATA names no folder with commonroad/USA_Peach-2_1_T-1.xml";
  }

  const Scenario scenario = Scenario::read(path);

  EXPECT_EQ(scenario.lanelets.size(), 75U);
  EXPECT_EQ(scenario.signs.size(), 74U);
  EXPECT_EQ(scenario.intersections.size(), 4U);
  const Intersection::Incoming& incoming = scenario.intersections.at(0).incomings.at(0);
  EXPECT_EQ(incoming.lanelets.size(), 3U);
  EXPECT_EQ(incoming.right, (std::vector<std::int64_t>{53878}));
  EXPECT_EQ(incoming.straight.size(), 3U);
  EXPECT_EQ(incoming.left, (std::vector<std::int64_t>{53862}));
  EXPECT_EQ(incoming.left_of, 53981);
  const Lanelet& lane = scenario.lanelets.at(53758);
  EXPECT_FALSE(lane.left->is_same_direction);
  EXPECT_EQ(lane.left->id, 53762);
  EXPECT_EQ(lane.types, (std::vector<std::string>{"urban"}));
  std::size_t limits = 0;
  std::size_t stop_lines = 0;
  for (const auto& [id, each] : scenario.lanelets) {
    limits += each.speed_limit_mps ? 1 : 0;
    stop_lines += each.stop_line ? 1 : 0;
  }
  EXPECT_EQ(limits, 75U);
  EXPECT_EQ(stop_lines, 1U);
}

TEST(CommonRoad, SignsLightsAndStopLinesBelongToTheirLanelets) {
  const Scenario scenario = parse(
      lanelet(1, 0.0,
              "<stopLine><point><x>90</x><y>1.5</y></point><point><x>90</x><y>-1.5</y></point>"
              "<lineMarking>solid</lineMarking><trafficSignRef ref=\"4\"/>"
              "<trafficLightRef ref=\"6\"/></stopLine><laneletType>urban</laneletType>"
              "<laneletType>crosswalk</laneletType><trafficSignRef ref=\"4\"/>"
              "<trafficSignRef ref=\"5\"/><trafficLightRef ref=\"6\"/>") +
      "<trafficSign id=\"4\"><trafficSignElement><trafficSignID>274</trafficSignID>"
      "<additionalValue>13.9</additionalValue></trafficSignElement><trafficSignElement>"
      "<trafficSignID>206</trafficSignID></trafficSignElement></trafficSign>"
      "<trafficSign id=\"5\"><trafficSignElement><trafficSignID>274</trafficSignID>"
      "<additionalValue>8.3</additionalValue></trafficSignElement><position><point><x>3</x>"
      "<y>4</y></point></position><virtual>true</virtual></trafficSign>"
      "<trafficLight id=\"6\"><cycle><cycleElement><duration>50</duration><color>red</color>"
      "</cycleElement><cycleElement><duration>10</duration><color>green</color></cycleElement>"
      "<timeOffset>7</timeOffset></cycle><direction>right</direction><active>false</active>"
      "</trafficLight>");

  const Lanelet& lane = scenario.lanelets.at(1);
  EXPECT_EQ(lane.speed_limit_mps, 8.3);
  EXPECT_EQ(lane.types, (std::vector<std::string>{"urban", "crosswalk"}));
  EXPECT_EQ(lane.stop_line->ends_m->at(1), Eigen::Vector2d(90.0, -1.5));
  EXPECT_EQ(lane.stop_line->signs, (std::vector<std::int64_t>{4}));
  EXPECT_EQ(lane.lights, (std::vector<std::int64_t>{6}));
  EXPECT_EQ(scenario.signs.at(4).elements.at(1).sign, "206");
  EXPECT_TRUE(scenario.signs.at(5).is_virtual);
  EXPECT_EQ(scenario.signs.at(5).position_m, Eigen::Vector2d(3.0, 4.0));
  const TrafficLight& light = scenario.lights.at(6);
  EXPECT_EQ(light.cycle.at(0).steps, 50);
  EXPECT_EQ(light.cycle.at(1).color, "green");
  EXPECT_EQ(light.offset_steps, 7);
  EXPECT_EQ(light.direction, "right");
  EXPECT_FALSE(light.is_active);
}

TEST(CommonRoad, ReferencesToWhatWasCutOffAreLeftOut) {
  const Scenario scenario = parse(
      lanelet(1, 0.0,
              "<predecessor ref=\"7\"/><successor ref=\"2\"/><successor ref=\"8\"/>"
              "<adjacentLeft ref=\"9\" drivingDir=\"same\"/>"
              "<adjacentRight ref=\"2\" drivingDir=\"opposite\"/><trafficSignRef ref=\"5\"/>") +
      lanelet(2, -3.0) +
      "<intersection id=\"3\"><incoming id=\"4\"><incomingLanelet ref=\"1\"/>"
      "<successorsLeft ref=\"8\"/></incoming><crossing><crossingLanelet ref=\"2\"/>"
      "<crossingLanelet ref=\"8\"/></crossing></intersection>");

  const Lanelet& lane = scenario.lanelets.at(1);
  EXPECT_TRUE(lane.predecessors.empty());
  EXPECT_EQ(lane.successors, (std::vector<std::int64_t>{2}));
  EXPECT_FALSE(lane.left);
  EXPECT_FALSE(lane.right->is_same_direction);
  EXPECT_TRUE(lane.signs.empty());
  EXPECT_TRUE(scenario.intersections.at(0).incomings.at(0).left.empty());
  EXPECT_EQ(scenario.intersections.at(0).crossings, (std::vector<std::int64_t>{2}));
}

TEST(CommonRoad, EveryShapeBecomesABox) {
  const auto obstacle = [](int id, std::string_view shape) {
    return fmt::format(
        "<staticObstacle id=\"{}\"><type>parkedVehicle</type><shape>{}</shape>{}"
        "</staticObstacle>",
        id, shape,
        "<initialState><position><point><x>10</x><y>20</y></point></position>"
        "<orientation><exact>1.5707963267948966</exact></orientation>"
        "<time><exact>0</exact></time></initialState>");
  };
  const Scenario scenario =
      parse(obstacle(1, "<rectangle><length>4</length><width>2</width></rectangle>") +
            obstacle(2,
                     "<rectangle><length>4</length><width>2</width><orientation>0.5</orientation>"
                     "<center><x>3</x><y>1</y></center></rectangle>") +
            obstacle(3, "<circle><radius>1.5</radius></circle>") +
            obstacle(4,
                     "<polygon><point><x>-1</x><y>-1</y></point><point><x>4</x><y>0</y></point>"
                     "<point><x>0</x><y>2</y></point></polygon>"));

  EXPECT_TRUE(scenario.obstacles.at(0).is_static);
  EXPECT_EQ(scenario.obstacles.at(0).states.at(0).position_m, Eigen::Vector2d(10.0, 20.0));
  const ScenarioState& shifted = scenario.obstacles.at(1).states.at(0);
  EXPECT_TRUE(shifted.position_m.isApprox(Eigen::Vector2d(9.0, 23.0)));
  EXPECT_NEAR(shifted.heading_rad, 2.0707963267948966, 1e-12);
  EXPECT_EQ(scenario.obstacles.at(2).length_m, 3.0);
  EXPECT_EQ(scenario.obstacles.at(2).width_m, 3.0);
  EXPECT_EQ(scenario.obstacles.at(3).length_m, 5.0);
  EXPECT_EQ(scenario.obstacles.at(3).width_m, 3.0);
  EXPECT_TRUE(
      scenario.obstacles.at(3).states.at(0).position_m.isApprox(Eigen::Vector2d(9.5, 21.5)));
}

TEST(CommonRoad, IntervalsAndAreasHaveAMiddle) {
  const Scenario scenario = parse(
      "<obstacle id=\"1\"><role>dynamic</role><type>car</type><shape><rectangle><length>4</length>"
      "<width>2</width></rectangle></shape>" +
          state("initialState", 0.0, "<exact>0</exact>") + "<trajectory>" +
          state("state", 0.0, "<exact>0</exact>") +
          "<state><position><rectangle><length>2</length><width>1</width><center><x>5</x><y>6</y>"
          "</center></rectangle></position><orientation><intervalStart>0.2</intervalStart>"
          "<intervalEnd>0.4</intervalEnd></orientation><velocity><intervalStart>3</intervalStart>"
          "<intervalEnd>5</intervalEnd></velocity><time><intervalStart>4</intervalStart>"
          "<intervalEnd>6</intervalEnd></time></state></trajectory></obstacle>",
      "2018b");

  ASSERT_EQ(scenario.obstacles.at(0).states.size(), 2U);
  const ScenarioState& last = scenario.obstacles.at(0).states.at(1);
  EXPECT_EQ(last.step, 5);
  EXPECT_TRUE(last.position_m.isApprox(Eigen::Vector2d(5.0, 6.0)));
  EXPECT_NEAR(last.heading_rad, 0.3, 1e-12);
  EXPECT_EQ(last.speed_mps, 4.0);
}

TEST(CommonRoad, StepThatATrajectoryTellsTwiceCountsOnce) {
  const Scenario scenario = parse(
      "<obstacle id=\"1\"><role>dynamic</role><type>car</type><shape><rectangle><length>4</length>"
      "<width>2</width></rectangle></shape>" +
          state("initialState", 0.0, "<exact>0</exact>") + "<trajectory>" +
          state("state", 1.0, "<exact>1</exact>") + state("state", 1.5, "<exact>1</exact>") +
          state("state", 2.0, "<exact>2</exact>") + "</trajectory></obstacle>",
      "2018b");

  const auto& states = scenario.obstacles.at(0).states;
  ASSERT_EQ(states.size(), 3U);
  EXPECT_EQ(states[1].position_m.x(), 1.0);
  EXPECT_EQ(states[2].step, 2);
}

TEST(CommonRoad, GoalMayBeOneOfSeveral) {
  const Scenario scenario = parse(
      lanelet(1, 0.0) +
      problem("<goalState><position><lanelet ref=\"1\"/><lanelet ref=\"2\"/></position>"
              "<time><exact>30</exact></time></goalState>"
              "<goalState><position><circle><radius>3</radius><center><x>1</x><y>2</y></center>"
              "</circle><polygon><point><x>0</x><y>0</y></point><point><x>1</x><y>0</y></point>"
              "<point><x>0</x><y>1</y></point></polygon></position><time><intervalStart>1"
              "</intervalStart><intervalEnd>2</intervalEnd></time></goalState>" +
              kGoal));

  const auto& goals = scenario.problem().goals;
  ASSERT_EQ(goals.size(), 3U);
  EXPECT_EQ(goals[0].lanelets, (std::vector<std::int64_t>{1, 2}));
  EXPECT_EQ(goals[0].first_step, 30);
  EXPECT_EQ(goals[0].last_step, 30);
  EXPECT_EQ(goals[1].circles.at(0).radius_m, 3.0);
  EXPECT_EQ(goals[1].polygons.at(0).size(), 3U);
  EXPECT_FALSE(goals[2].has_position());
  EXPECT_FALSE(goals[2].heading_rad);
}

TEST(CommonRoad, ErrorsAreReportedWithTheirLine) {
  EXPECT_EQ(refusal_of_text("<commonRoad>\n<lanelet id='3'>\n</commonRoad>"),
            "x.xml:3: expected XML, found Start-end tags mismatch");
  EXPECT_EQ(refusal_of_text("<html/>"), "x.xml:1: expected <commonRoad>, found <html>");
  EXPECT_EQ(refusal_of_text(file("", "2017a")),
            "x.xml:2: expected commonRoadVersion 2018b or 2020a, found '2017a'");
  EXPECT_EQ(refusal(lanelet(1, 0.0) + lanelet(1, 3.0)),
            "x.xml:4: expected no second <lanelet> 1, found one");
  EXPECT_EQ(refusal("\n<lanelet id=\"1\">" + bound("leftBound", 0.0) + "</lanelet>"),
            "x.xml:4: expected <rightBound> in <lanelet>, found none");
  EXPECT_EQ(refusal("<lanelet id=\"one\"/>"),
            "x.xml:3: expected an integer as id of <lanelet>, found 'one'");
  EXPECT_EQ(refusal("<lanelet id=\"1\"><leftBound><point><x>nan</x><y>0</y></point></leftBound>"
                    "</lanelet>"),
            "x.xml:3: expected a number of at most 1e+08 in <x>, found 'nan'");
  EXPECT_EQ(refusal("<planningProblem id=\"1\">" + state("initialState", 0.0, "<exact>0</exact>") +
                    "</planningProblem>"),
            "x.xml:3: expected <goalState> in <planningProblem>, found none");
}

TEST(CommonRoad, WhatCannotBeIsRefused) {
  EXPECT_NE(refusal("<lanelet id=\"1\"><leftBound/><rightBound/></lanelet>"), "");
  EXPECT_NE(refusal("<obstacle id=\"1\"><role>other</role></obstacle>"), "");
  EXPECT_NE(refusal("<staticObstacle id=\"1\"><shape/>" +
                    state("initialState", 0.0, "<exact>0</exact>") + "</staticObstacle>"),
            "");
  EXPECT_NE(refusal("<staticObstacle id=\"1\"><shape><circle><radius>-1</radius></circle></shape>" +
                    state("initialState", 0.0, "<exact>0</exact>") + "</staticObstacle>"),
            "");
  EXPECT_NE(refusal(problem("<goalState><position/><time><exact>1</exact></time></goalState>")),
            "");
  EXPECT_NE(refusal(problem("<goalState><time><exact>2e7</exact></time></goalState>")), "");
  EXPECT_NE(refusal(problem("<goalState><time><intervalStart>5</intervalStart><intervalEnd>4"
                            "</intervalEnd></time></goalState>")),
            "");
  EXPECT_NE(refusal_of_text(""), "");
  EXPECT_THROW((void)parse("").problem(), std::runtime_error);
  EXPECT_THROW(Scenario::read(kData / "missing.xml"), std::runtime_error);
}

TEST(CommonRoad, DeepFileDoesNoHarm) {
  std::string text;
  for (int depth = 0; depth < 100'000; ++depth) {
    text += "<commonRoad commonRoadVersion=\"2020a\" timeStepSize=\"0.1\">";
  }

  EXPECT_NE(refusal_of_text(text), "");
}

TEST(CommonRoad, NoCutOrChangedFileDoesHarm) {
  const std::string whole =
      file(lanelet(1, 0.0, "<successor ref=\"2\"/>") + lanelet(2, 3.0) +
           "<dynamicObstacle id=\"5\"><type>car</type><shape><rectangle><length>4</length>"
           "<width>2</width></rectangle></shape>" +
           state("initialState", 0.0, "<exact>0</exact>") + "<trajectory>" +
           state("state", 1.0, "<exact>1</exact>") + "</trajectory></dynamicObstacle>" + problem());
  ASSERT_EQ(refusal_of_text(whole), "");
  for (std::size_t size = 0; size < whole.size(); ++size) {
    refusal_of_text(std::string_view(whole).substr(0, size));
  }
  std::mt19937 random;  // NOLINT(bugprone-random-generator-seed): the same changes in each run
  for (int change = 0; change < 3000; ++change) {
    std::string changed = whole;
    for (int count = 0; count < 3; ++count) {
      changed[random() % changed.size()] = static_cast<char>(random());
    }
    refusal_of_text(changed);
  }
}

}  // namespace
}  // namespace ads
