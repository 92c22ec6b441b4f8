#include "common/geodesy.h"

#include <gtest/gtest.h>

namespace ads {
namespace {

TEST(Geodesy, AxesOfTheEllipsoidAreThoseOfWgs84) {
  EXPECT_NEAR(ecef_from_geodetic({0.0, 0.0, 0.0}).x(), 6378137.0, 1e-9);
  EXPECT_NEAR(ecef_from_geodetic({90.0, 0.0, 0.0}).z(), 6356752.314245, 1e-5);
  EXPECT_NEAR(ecef_from_geodetic({0.0, 90.0, 10.0}).y(), 6378147.0, 1e-9);
}

TEST(Geodesy, WayThereAndBackEndsWhereItBegan) {
  for (const double latitude_deg : {-90.0, -89.9999, -45.0, 0.0, 37.72, 49.01, 89.0, 90.0}) {
    for (const double longitude_deg : {-179.9, -122.47, 0.0, 8.4}) {
      for (const double altitude_m : {-400.0, 0.0, 115.0, 100'000.0}) {
        const Eigen::Vector3d place = ecef_from_geodetic({latitude_deg, longitude_deg, altitude_m});

        const GeodeticPosition back = geodetic_from_ecef(place);

        EXPECT_NEAR((ecef_from_geodetic(back) - place).norm(), 0.0, 1e-3) << latitude_deg;
        EXPECT_NEAR(back.altitude_m, altitude_m, 1e-3);
      }
    }
  }
}

TEST(LocalFrame, DirectionsAreEastNorthUp) {
  const LocalFrame frame({37.72, -122.47, 33.0});

  const auto north = frame.enu_from_geodetic({37.721, -122.47, 33.0});
  const auto east = frame.enu_from_geodetic({37.72, -122.469, 33.0});
  const auto up = frame.enu_from_geodetic({37.72, -122.47, 34.0});

  EXPECT_NEAR(north.y(), 110.99,
              0.02);  // a thousandth of a degree of the meridian, at 37.72 degrees
  EXPECT_NEAR(north.x(), 0.0, 1e-6);
  EXPECT_NEAR(east.x(), 88.18, 0.02);
  EXPECT_NEAR(up.z(), 1.0, 1e-6);
  EXPECT_NEAR(frame.enu_from_geodetic(frame.origin()).norm(), 0.0, 1e-6);
}

TEST(LocalFrame, WayThereAndBackEndsWhereItBegan) {
  const LocalFrame frame({37.72, -122.47, 33.0});

  const Eigen::Vector3d place(100.0, -200.0, 3.0);

  EXPECT_NEAR((frame.enu_from_ecef(frame.ecef_from_enu(place)) - place).norm(), 0.0, 1e-6);
}

TEST(LocalFrame, VectorsKeepTheirLength) {
  const LocalFrame frame({37.72, -122.47, 33.0});

  EXPECT_NEAR(frame.rotate_to_enu({1.0, 2.0, 2.0}).norm(), 3.0, 1e-12);
}

}  // namespace
}  // namespace ads
