#include "common/geodesy.h"

#include <cmath>
#include <numbers>

namespace ads {
namespace {

constexpr double kSemiMajorAxis_m = 6'378'137.0;
constexpr double kFlattening = 1.0 / 298.257223563;
constexpr double kEccentricitySquared = kFlattening * (2.0 - kFlattening);
constexpr double kRadPerDeg = std::numbers::pi / 180.0;

}  // namespace

Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position) {
  const double latitude = position.latitude_deg * kRadPerDeg;
  const double longitude = position.longitude_deg * kRadPerDeg;
  const double sine = std::sin(latitude);
  const double normal_m = kSemiMajorAxis_m / std::sqrt(1.0 - kEccentricitySquared * sine * sine);
  const double axis_distance_m = (normal_m + position.altitude_m) * std::cos(latitude);
  return {axis_distance_m * std::cos(longitude), axis_distance_m * std::sin(longitude),
          (normal_m * (1.0 - kEccentricitySquared) + position.altitude_m) * sine};
}

GeodeticPosition geodetic_from_ecef(const Eigen::Vector3d& position_m) {
  constexpr int kRounds = 6;  // Each makes the error smaller by more than a factor of a hundred.
  const double axis_distance_m = std::hypot(position_m.x(), position_m.y());
  double latitude = std::atan2(position_m.z(), axis_distance_m * (1.0 - kEccentricitySquared));
  double normal_m = kSemiMajorAxis_m;
  for (int round = 0; round < kRounds; ++round) {
    const double sine = std::sin(latitude);
    normal_m = kSemiMajorAxis_m / std::sqrt(1.0 - kEccentricitySquared * sine * sine);
    latitude = std::atan2(position_m.z() + kEccentricitySquared * normal_m * sine, axis_distance_m);
  }
  // Along the normal: right at the poles and at the equator.
  const double altitude_m = axis_distance_m * std::cos(latitude) +
                            position_m.z() * std::sin(latitude) -
                            kSemiMajorAxis_m * kSemiMajorAxis_m / normal_m;
  return {latitude / kRadPerDeg, std::atan2(position_m.y(), position_m.x()) / kRadPerDeg,
          altitude_m};
}

LocalFrame::LocalFrame(const GeodeticPosition& origin)
    : origin_(origin), origin_ecef_m_(ecef_from_geodetic(origin)) {
  const double sin_latitude = std::sin(origin.latitude_deg * kRadPerDeg);
  const double cos_latitude = std::cos(origin.latitude_deg * kRadPerDeg);
  const double sin_longitude = std::sin(origin.longitude_deg * kRadPerDeg);
  const double cos_longitude = std::cos(origin.longitude_deg * kRadPerDeg);
  enu_from_ecef_ << -sin_longitude, cos_longitude, 0.0,                            //
      -sin_latitude * cos_longitude, -sin_latitude * sin_longitude, cos_latitude,  //
      cos_latitude * cos_longitude, cos_latitude * sin_longitude, sin_latitude;
}

}  // namespace ads
