#pragma once

#include <cstddef>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "common/xml.h"

namespace ads {

/// a + b ds + c ds² + d ds³, from a position on a road.
struct Cubic {
  double s_m = 0.0;
  double a = 0.0;
  double b = 0.0;
  double c = 0.0;
  double d = 0.0;

  [[nodiscard]] double at(double ds) const { return a + ds * (b + ds * (c + ds * d)); }
  [[nodiscard]] double slope_at(double ds) const { return b + ds * (2.0 * c + ds * 3.0 * d); }
};

/// The value at `s_m` of cubics in the order of their positions: that of the last one that begins
/// before; 0 before the first.
double value_at(const std::vector<Cubic>& cubics, double s_m);

/// The reference line of an OpenDRIVE road, composed of lines, arcs, spirals and parametric cubics.
///
/// @threads  Compatible.
class PlanView {
 public:
  struct Pose {
    Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
    double heading_rad = 0.0;
  };

  /// Reads <planView>.
  ///
  /// @errors  Throws `std::runtime_error` with place, expected and found: if there is no geometry,
  ///          one does not begin where its predecessor ends or is of an unsupported kind, or the
  ///          total length exceeds `longest_m`.
  PlanView(const XmlElement& element, double longest_m);

  [[nodiscard]] double length_m() const;
  /// `s_m` is from 0 to the length; beyond, the last geometry is continued.
  [[nodiscard]] Pose at(double s_m) const;
  /// Where its geometries begin.
  [[nodiscard]] std::vector<double> begins_m() const;

 private:
  // A line is an arc without curvature.
  struct Arc {
    double curvature = 0.0;
  };
  struct Spiral {
    double curvature = 0.0;
    double curvature_per_m = 0.0;
    // In its own frame, each `kPlanView.spiral_step_m`.
    std::vector<Eigen::Vector2d> nodes_m = {};

    [[nodiscard]] double heading_at(double ds) const {
      return ds * (curvature + ds * curvature_per_m / 2.0);
    }
    // The displacement between two nearby positions.
    [[nodiscard]] Eigen::Vector2d between(double begin, double end) const;
  };
  struct Parametric {
    Cubic u;
    Cubic v;
    double scale = 1.0;  // Of ds, to the parameter.
  };
  struct Geometry {
    double s_m = 0.0;
    double length_m = 0.0;
    Pose begin;
    std::variant<Arc, Spiral, Parametric> shape;
  };

  static Geometry read_geometry(const XmlElement& element);
  static Spiral read_spiral(const XmlElement& element, double length_m);
  static Parametric read_parametric(const XmlElement& element, double length_m);
  // In the frame of the geometry's begin.
  static Pose local(const Arc& arc, double ds);
  static Pose local(const Spiral& spiral, double ds);
  static Pose local(const Parametric& shape, double ds);

  std::vector<Geometry> geometries_;
};

}  // namespace ads
