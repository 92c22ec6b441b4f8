#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace ads {

/// The same angle in (-pi, pi].
///
/// @pre  `angle_rad` is finite.
double normalize_angle(double angle_rad);

/// The unit vector in direction `heading_rad`, counter-clockwise from +x.
Eigen::Vector2d direction(double heading_rad);

/// `vector`, rotated by 90 degrees to the left.
Eigen::Vector2d left_of(const Eigen::Vector2d& vector);

/// The z component of the cross product: positive if `b` points to the left of `a`.
double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b);

/// An oriented rectangle.
///
/// @threads  Compatible.
struct Box {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;  ///< Of its length, counter-clockwise from +x.
  double length_m = 0.0;
  double width_m = 0.0;

  /// Front left, rear left, rear right, front right: counter-clockwise.
  [[nodiscard]] std::array<Eigen::Vector2d, 4> corners() const;
  /// Whether `point_m` lies in the box or on its edge.
  [[nodiscard]] bool contains(const Eigen::Vector2d& point_m) const;
};

/// Whether the boxes have a point in common, including touching ones.
bool overlap(const Box& a, const Box& b);

/// The smallest distance between points of the boxes; 0 if they overlap.
double distance_m(const Box& a, const Box& b);

/// The distance of `point_m` from the segment between `begin_m` and `end_m`.
double distance_m(const Eigen::Vector2d& point_m, const Eigen::Vector2d& begin_m,
                  const Eigen::Vector2d& end_m);

/// Whether `point_m` lies in the polygon or on its edge. The last corner is joined to the first; if
/// the edge crosses itself, the even-odd rule applies.
bool contains(std::span<const Eigen::Vector2d> polygon_m, const Eigen::Vector2d& point_m);

/// A polyline whose points are addressed by arclength. It is extended straight beyond both ends, so
/// that every point has a projection.
///
/// @threads  Compatible.
/// @realtime `project` grows with the number of points, the others with its logarithm; only those
///           that return a line allocate.
class Polyline {
 public:
  /// The position of a point relative to a line.
  struct Projection {
    double along_m =
        0.0;  ///< Of the closest point of the line: below 0 or above the length beyond.
    double offset_m = 0.0;  ///< Distance from there, positive to the left.
  };

  /// Points equal to their predecessor are left out.
  ///
  /// @errors  Throws `std::invalid_argument` if fewer than two different points remain.
  explicit Polyline(std::span<const Eigen::Vector2d> points_m);

  [[nodiscard]] const std::vector<Eigen::Vector2d>& points_m() const { return points_m_; }
  /// The arclength at each of the points.
  [[nodiscard]] const std::vector<double>& arclengths_m() const { return arclengths_m_; }
  [[nodiscard]] double length_m() const { return arclengths_m_.back(); }

  [[nodiscard]] Projection project(const Eigen::Vector2d& point_m) const;

  [[nodiscard]] Eigen::Vector2d point_at(double along_m) const;
  /// The point `offset_m` to the left of the line, perpendicular to `heading_at`.
  [[nodiscard]] Eigen::Vector2d point_at(double along_m, double offset_m) const;
  /// Continuous along the line: at each point the mean of the directions on both sides of it,
  /// linear between points. In (-pi, pi].
  [[nodiscard]] double heading_at(double along_m) const;
  /// The derivative of `heading_at` along the line, positive to the left; 0 beyond the ends.
  [[nodiscard]] double curvature_at(double along_m) const;

  /// The same line with points at most `step_m` apart along it; both ends are kept.
  ///
  /// @pre  `step_m` is above 0.
  [[nodiscard]] Polyline resampled(double step_m) const;

 private:
  // The segment that contains `along_m`; the first or the last beyond the ends.
  [[nodiscard]] std::size_t segment_at(double along_m) const;
  [[nodiscard]] double segment_length_m(std::size_t segment) const;

  std::vector<Eigen::Vector2d> points_m_;
  std::vector<double> arclengths_m_;
  // At each point; unwrapped.
  std::vector<double> headings_rad_;
};

}  // namespace ads
