#pragma once

#include <Eigen/Core>

namespace ads {

/// A position on or above the WGS-84 ellipsoid.
struct GeodeticPosition {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double altitude_m = 0.0;  ///< Above the ellipsoid.

  friend bool operator==(const GeodeticPosition&, const GeodeticPosition&) = default;
};

/// The position in earth-centred, earth-fixed coordinates, in metres.
///
/// Exact; Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems",
/// 2nd edition, 2013, equations 2.105, 2.106 and 2.112; the ellipsoid is that of NIMA TR8350.2.
Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position);

/// The inverse, by the iteration on the latitude that follows from them; within a millimetre up to
/// 100 km above the ellipsoid. The centre of the earth has no latitude.
GeodeticPosition geodetic_from_ecef(const Eigen::Vector3d& position_m);

/// The tangential plane at an origin: x east, y north, z up, in metres.
///
/// The rotation is Groves (as above), equation 2.150, with the axes in the order east, north, up.
///
/// @threads  Compatible.
class LocalFrame {
 public:
  explicit LocalFrame(const GeodeticPosition& origin);

  [[nodiscard]] const GeodeticPosition& origin() const { return origin_; }

  [[nodiscard]] Eigen::Vector3d enu_from_ecef(const Eigen::Vector3d& position_m) const {
    return enu_from_ecef_ * (position_m - origin_ecef_m_);
  }
  [[nodiscard]] Eigen::Vector3d enu_from_geodetic(const GeodeticPosition& position) const {
    return enu_from_ecef(ecef_from_geodetic(position));
  }
  [[nodiscard]] Eigen::Vector3d ecef_from_enu(const Eigen::Vector3d& position_m) const {
    return origin_ecef_m_ + enu_from_ecef_.transpose() * position_m;
  }
  [[nodiscard]] GeodeticPosition geodetic_from_enu(const Eigen::Vector3d& position_m) const {
    return geodetic_from_ecef(ecef_from_enu(position_m));
  }
  /// Rotates a velocity, or any other free vector.
  [[nodiscard]] Eigen::Vector3d rotate_to_enu(const Eigen::Vector3d& ecef_vector) const {
    return enu_from_ecef_ * ecef_vector;
  }

 private:
  GeodeticPosition origin_;
  Eigen::Vector3d origin_ecef_m_;
  Eigen::Matrix3d enu_from_ecef_;
};

}  // namespace ads
