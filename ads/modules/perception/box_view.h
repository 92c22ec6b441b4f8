#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "perception_tuning.h"
#include "skyline.h"

namespace ads {

/// One point of an object: its position at the object's time, and how it was measured.
struct ObjectPoint {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  float time_s = 0.0F;  ///< Since the begin of the sweep.
  float height_m = 0.0F;
  float azimuth_rad = 0.0F;
  float range_m = 0.0F;
  float ground_m = 0.0F;   ///< Height of the ground there, relative to the sensor.
  bool is_of_top = false;  ///< From the topmost beam.
};

/// The points of one object in one sweep, all at one time, and the sensor's position.
struct ObjectView {
  std::span<const ObjectPoint> points;
  Eigen::Vector2d sensor_m = Eigen::Vector2d::Zero();
  double spread_rad = 0.0;  ///< Angle between neighbouring beams.
  double sensor_heading_rad = 0.0;
};

/// The extent of an object in one direction.
struct Edge {
  double place_m = 0.0;  ///< Along the direction's axis, from the reference point.
  double stddev_m = 0.0;
  /// Whether the object really ends here; if not, this is only as far as it was seen.
  bool is_end = false;
};

/// The constraints of one sweep on the box of an object with known heading.
///
/// A face turned to the sensor and seen over some width gives its edge directly. A face turned away
/// is located only by the silhouette of the adjacent faces, and only if nothing occludes that end
/// of the silhouette. All other edges are bounds: the object extends at least to there.
struct BoxView {
  Edge front;
  Edge rear;
  Edge left;
  Edge right;
  double height_m = 0.0;
};

/// The width that `view_box` assumes of an unknown object.
inline constexpr double kUsualWidth_m = kBoxView.usual_width_m;

/// Of an object that is known to be narrow, as by `width_m`, less of a face is enough.
[[nodiscard]] BoxView view_box(const ObjectView& view, const Skyline& skyline,
                               const Eigen::Vector2d& reference_m, double heading_rad,
                               double width_m = kUsualWidth_m);

/// A measured heading.
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
/// Scanners", IV 2017, search by the closeness criterion). With a `reach_rad` of pi / 4 all
/// rectangles are searched.
[[nodiscard]] double heading_by_closeness(const ObjectView& view, double middle_rad,
                                          double reach_rad);

}  // namespace ads
