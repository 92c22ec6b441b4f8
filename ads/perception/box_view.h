#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "skyline.h"

namespace ads {

/// One point of an object: where it was at the object's time, and how it was seen.
struct ObjectPoint {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  float time_s = 0.0F;  ///< Since the begin of the sweep.
  float height_m = 0.0F;
  float azimuth_rad = 0.0F;
  float range_m = 0.0F;
  float ground_m = 0.0F;   ///< How high the ground is there, from the sensor.
  bool is_of_top = false;  ///< No beam looks higher.
};

/// The points of one object in one sweep, all at one time, and where they were seen from.
struct ObjectView {
  std::span<const ObjectPoint> points;
  Eigen::Vector2d sensor_m = Eigen::Vector2d::Zero();
  double spread_rad = 0.0;  ///< Between neighbouring beams.
  double sensor_heading_rad = 0.0;
};

/// Where an object ends in one direction.
struct Edge {
  double place_m = 0.0;  ///< Along the direction's axis, from the reference point.
  double stddev_m = 0.0;
  /// The object really ends here; if not, this is as far as it was seen, and it may go on.
  bool is_end = false;
};

/// What one sweep tells of the box around an object whose heading is known.
///
/// A face that is turned to the sensor and seen over some width gives its edge directly. A face
/// that is turned away shows where it is only by the silhouette of the faces beside it, and only if
/// nothing stands before that end of the silhouette. All else are bounds: the object reaches at
/// least there.
struct BoxView {
  Edge front;
  Edge rear;
  Edge left;
  Edge right;
  double height_m = 0.0;
};

[[nodiscard]] BoxView view_box(const ObjectView& view, const Skyline& skyline,
                               const Eigen::Vector2d& reference_m, double heading_rad);

/// A heading that was seen.
struct SeenHeading {
  double heading_rad = 0.0;
  double stddev_rad = 0.0;
};

/// The heading near `heading_rad` along which a face of the object lies; none if no face is seen
/// over enough of its length. Least squares over the points of the face.
[[nodiscard]] std::optional<SeenHeading> heading_of_faces(const ObjectView& view,
                                                          const Eigen::Vector2d& reference_m,
                                                          double heading_rad);

/// The heading within `reach_rad` of `middle_rad` of the rectangle to whose edges the points are
/// closest (Zhang, Xu, Dong, Dolan, "Efficient L-Shape Fitting for Vehicle Detection Using Laser
/// Scanners", IV 2017, search by the closeness criterion). An eighth of a turn reaches all
/// rectangles.
[[nodiscard]] double heading_by_closeness(const ObjectView& view, double middle_rad,
                                          double reach_rad);

}  // namespace ads
