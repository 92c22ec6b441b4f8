#include "plan_view.h"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>

namespace ads {
namespace {

using ::testing::HasSubstr;

PlanView view_of(const std::string& geometries) {
  const std::string text = "<planView>" + geometries + "</planView>";
  const XmlFile file(text, "x.xodr");
  return PlanView(file.root(), 1000.0);
}

std::string error_of(const std::string& geometries) {
  try {
    (void)view_of(geometries);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(PlanView, LineGoesStraight) {
  const PlanView view =
      view_of("<geometry s='0' x='1' y='2' hdg='0.5' length='10'><line/></geometry>");
  EXPECT_EQ(view.length_m(), 10.0);
  EXPECT_NEAR(view.at(4.0).position_m.x(), 1.0 + 4.0 * std::cos(0.5), 1e-12);
  EXPECT_NEAR(view.at(4.0).position_m.y(), 2.0 + 4.0 * std::sin(0.5), 1e-12);
}

TEST(PlanView, ArcOfAQuarterTurn) {
  const double length = 20.0 * std::numbers::pi / 2.0;
  const PlanView view = view_of("<geometry s='0' x='0' y='0' hdg='0' length='" +
                                std::to_string(length) + "'><arc curvature='-0.05'/></geometry>");
  EXPECT_NEAR(view.at(length).position_m.x(), 20.0, 1e-9);
  EXPECT_NEAR(view.at(length).position_m.y(), -20.0, 1e-9);
  EXPECT_NEAR(view.at(length).heading_rad, -std::numbers::pi / 2.0, 1e-9);
}

// C(1) and S(1) of Fresnel's integrals with pi/2 (Abramowitz and Stegun, table 7.7): a spiral of
// 100 m whose heading is pi/2 (s/100)².
TEST(PlanView, SpiralIsThatOfFresnelsIntegrals) {
  const PlanView view = view_of(
      "<geometry s='0' x='0' y='0' hdg='0' length='100'>"
      "<spiral curvStart='0' curvEnd='0.031415926535897934'/></geometry>");
  EXPECT_NEAR(view.at(100.0).position_m.x(), 77.98934, 1e-4);
  EXPECT_NEAR(view.at(100.0).position_m.y(), 43.82591, 1e-4);
  EXPECT_NEAR(view.at(100.0).heading_rad, std::numbers::pi / 2.0, 1e-9);
  EXPECT_NEAR(view.at(50.0).position_m.x(), 49.23442, 1e-4);
  EXPECT_NEAR(view.at(50.0).position_m.y(), 6.47324, 1e-4);
}

TEST(PlanView, ParametricCubicGoesByArcLengthOrByItsPart) {
  const std::string coefficients = " aU='0' bU='1' cU='0' dU='0' aV='0' bV='0' cV='0.01' dV='0'/>";
  const PlanView by_length =
      view_of("<geometry s='0' x='0' y='0' hdg='0' length='10'><paramPoly3 pRange='arcLength'" +
              coefficients + "</geometry>");
  EXPECT_NEAR(by_length.at(5.0).position_m.y(), 0.25, 1e-12);
  EXPECT_NEAR(by_length.at(5.0).heading_rad, std::atan(0.1), 1e-12);
  const PlanView by_part = view_of("<geometry s='0' x='0' y='0' hdg='0' length='10'><paramPoly3" +
                                   coefficients + "</geometry>");
  EXPECT_NEAR(by_part.at(5.0).position_m.x(), 0.5, 1e-12);
}

TEST(PlanView, WhatIsWrongIsReported) {
  EXPECT_THAT(error_of(""), HasSubstr("expected <geometry> in <planView>, found none"));
  EXPECT_THAT(error_of("<geometry s='0' x='0' y='0' hdg='0' length='-1'><line/></geometry>"),
              HasSubstr("expected a length of 0 or more of <geometry>, found -1"));
  EXPECT_THAT(error_of("<geometry s='0' x='nan' y='0' hdg='0' length='1'><line/></geometry>"),
              HasSubstr("as x of <geometry>, found 'nan'"));
  EXPECT_THAT(error_of("<geometry s='0' x='0' y='0' hdg='0' length='1'><poly3/></geometry>"),
              HasSubstr("<spiral> or <paramPoly3> in <geometry>, found <poly3>"));
  EXPECT_THAT(error_of("<geometry s='0' x='0' y='0' hdg='0' length='1e7'><line/></geometry>"),
              HasSubstr("expected at most 1000 m of roads from here on, found 1e+07"));
  EXPECT_THAT(error_of("<geometry s='5' x='0' y='0' hdg='0' length='1'><line/></geometry>"),
              HasSubstr("expected a geometry at s = 0.000, where the one before it ends, found 5"));
  EXPECT_THAT(error_of("<geometry s='0' x='0' y='0' hdg='0' length='1'><arc curvature='1e5'/>"
                       "</geometry>"),
              HasSubstr("expected curvature of <arc> up to 10/m, found 100000"));
}

}  // namespace
}  // namespace ads
