#include "plan_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "common/plane.h"
#include "hd_map_tuning.h"

namespace ads {
namespace {

Eigen::Vector2d turned(const Eigen::Vector2d& vector, double angle_rad) {
  return vector.x() * direction(angle_rad) + vector.y() * left_of(direction(angle_rad));
}

double read_curvature(const XmlElement& element, const char* attribute) {
  const auto curvature = element.number_attribute<double>(attribute);
  if (std::abs(curvature) > kPlanView.curvature_max_per_m) {
    element.fail(fmt::format("{} of <{}> up to {:g}/m", attribute, element.name(),
                             kPlanView.curvature_max_per_m),
                 fmt::format("{:g}", curvature));
  }
  return curvature;
}

}  // namespace

double value_at(const std::vector<Cubic>& cubics, double s_m) {
  const auto after = std::ranges::upper_bound(cubics, s_m + kPlanView.same_m, {}, &Cubic::s_m);
  if (after == cubics.begin()) {
    return 0.0;
  }
  const Cubic& cubic = *std::prev(after);
  return cubic.at(s_m - cubic.s_m);
}

PlanView::PlanView(const XmlElement& element, double longest_m) {
  for (const XmlElement& child : element.all("geometry")) {
    Geometry geometry = read_geometry(child);
    const double end_m = geometries_.empty() ? 0.0 : length_m();
    if (!(std::abs(geometry.s_m - end_m) <= kPlanView.gap_m)) {
      child.fail(fmt::format("a geometry at s = {:.3f}, where the one before it ends", end_m),
                 fmt::format("{:.3f}", geometry.s_m));
    }
    if (geometry.s_m + geometry.length_m > longest_m) {
      child.fail(fmt::format("at most {:g} m of roads from here on", longest_m - end_m),
                 fmt::format("{:g}", geometry.length_m));
    }
    if (auto* spiral = std::get_if<Spiral>(&geometry.shape)) {
      spiral->nodes_m.emplace_back(0.0, 0.0);
      for (double ds = 0.0; ds + kPlanView.spiral_step_m <= geometry.length_m;
           ds += kPlanView.spiral_step_m) {
        spiral->nodes_m.emplace_back(spiral->nodes_m.back() +
                                     spiral->between(ds, ds + kPlanView.spiral_step_m));
      }
    }
    geometries_.push_back(std::move(geometry));
  }
  if (geometries_.empty()) {
    element.fail("<geometry> in <planView>", "none");
  }
}

double PlanView::length_m() const {
  return geometries_.back().s_m + geometries_.back().length_m;
}

std::vector<double> PlanView::begins_m() const {
  std::vector<double> begins;
  for (const Geometry& geometry : geometries_) {
    begins.push_back(geometry.s_m);
  }
  return begins;
}

PlanView::Pose PlanView::at(double s_m) const {
  const auto after = std::ranges::upper_bound(geometries_, s_m, {}, &Geometry::s_m);
  const Geometry& geometry = after == geometries_.begin() ? *after : *std::prev(after);
  const double ds = s_m - geometry.s_m;
  const Pose pose = std::visit([&](const auto& shape) { return local(shape, ds); }, geometry.shape);
  return {
      .position_m = geometry.begin.position_m + turned(pose.position_m, geometry.begin.heading_rad),
      .heading_rad = geometry.begin.heading_rad + pose.heading_rad};
}

PlanView::Geometry PlanView::read_geometry(const XmlElement& element) {
  Geometry geometry{.s_m = element.number_attribute<double>("s"),
                    .length_m = element.number_attribute<double>("length"),
                    .begin = {.position_m = {element.number_attribute<double>("x"),
                                             element.number_attribute<double>("y")},
                              .heading_rad = element.number_attribute<double>("hdg")},
                    .shape = Arc{}};
  if (geometry.length_m < 0.0) {
    element.fail("a length of 0 or more of <geometry>", fmt::format("{:g}", geometry.length_m));
  }
  if (const auto arc = element.find("arc")) {
    geometry.shape = Arc{.curvature = read_curvature(*arc, "curvature")};
  } else if (const auto spiral = element.find("spiral")) {
    geometry.shape = read_spiral(*spiral, geometry.length_m);
  } else if (const auto cubic = element.find("paramPoly3")) {
    geometry.shape = read_parametric(*cubic, geometry.length_m);
  } else if (!element.has("line")) {
    const auto children = element.children();
    element.fail("<line>, <arc>, <spiral> or <paramPoly3> in <geometry>",
                 children.empty() ? "none" : fmt::format("<{}>", children.front().name()));
  }
  return geometry;
}

PlanView::Spiral PlanView::read_spiral(const XmlElement& element, double length_m) {
  const double begin = read_curvature(element, "curvStart");
  const double end = read_curvature(element, "curvEnd");
  return {.curvature = begin, .curvature_per_m = length_m > 0.0 ? (end - begin) / length_m : 0.0};
}

PlanView::Parametric PlanView::read_parametric(const XmlElement& element, double length_m) {
  const auto cubic = [&](const char* a, const char* b, const char* c, const char* d) {
    return Cubic{.a = element.number_attribute<double>(a),
                 .b = element.number_attribute<double>(b),
                 .c = element.number_attribute<double>(c),
                 .d = element.number_attribute<double>(d)};
  };
  const std::string_view range = element.find_attribute("pRange").value_or("normalized");
  if (range != "arcLength" && range != "normalized") {
    element.fail("pRange arcLength or normalized", XmlElement::quoted(range));
  }
  return {.u = cubic("aU", "bU", "cU", "dU"),
          .v = cubic("aV", "bV", "cV", "dV"),
          .scale = range == "arcLength" || length_m <= 0.0 ? 1.0 : 1.0 / length_m};
}

PlanView::Pose PlanView::local(const Arc& arc, double ds) {
  const double turn = arc.curvature * ds;
  if (std::abs(turn) < 1e-9) {
    return {.position_m = {ds, turn * ds / 2.0}, .heading_rad = turn};
  }
  return {.position_m = {std::sin(turn) / arc.curvature, (1.0 - std::cos(turn)) / arc.curvature},
          .heading_rad = turn};
}

// Gauss-Legendre quadrature with five points (Abramowitz and Stegun, "Handbook of Mathematical
// Functions", 1964, table 25.4).
Eigen::Vector2d PlanView::Spiral::between(double begin, double end) const {
  constexpr std::array<std::pair<double, double>, 5> kPoints{
      {{0.0, 0.568888888888889},
       {-0.538469310105683, 0.478628670499366},
       {0.538469310105683, 0.478628670499366},
       {-0.906179845938664, 0.236926885056189},
       {0.906179845938664, 0.236926885056189}}};
  const double half = (end - begin) / 2.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const auto& [place, weight] : kPoints) {
    sum += weight * direction(heading_at(begin + half * (1.0 + place)));
  }
  return half * sum;
}

PlanView::Pose PlanView::local(const Spiral& spiral, double ds) {
  const double last = static_cast<double>(spiral.nodes_m.size() - 1);
  const double node = std::clamp(std::floor(ds / kPlanView.spiral_step_m), 0.0, last);
  return {.position_m = spiral.nodes_m[static_cast<std::size_t>(node)] +
                        spiral.between(node * kPlanView.spiral_step_m, ds),
          .heading_rad = spiral.heading_at(ds)};
}

PlanView::Pose PlanView::local(const Parametric& shape, double ds) {
  const double p = ds * shape.scale;
  return {.position_m = {shape.u.at(p), shape.v.at(p)},
          .heading_rad = std::atan2(shape.v.slope_at(p), shape.u.slope_at(p))};
}

}  // namespace ads
