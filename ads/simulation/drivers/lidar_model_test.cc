#include "lidar_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include <gtest/gtest.h>

namespace ads {
namespace {

// A scene around a vehicle at the origin that heads along +x, and sweeps of it without noise.
class LidarModelTest : public ::testing::Test {
 protected:
  LidarModelTest() {
    config_.range_stddev_m = 0.0;
    config_.beam_dropout = 0.0;
    scene_.mutable_ego();
  }

  void add_body(double x_m, double y_m, double height_m = 1.5) {
    auto& body = *scene_.add_bodies();
    body.set_id(scene_.bodies_size());
    body.set_x_m(x_m);
    body.set_y_m(y_m);
    body.set_length_m(4.0);
    body.set_width_m(2.0);
    body.set_height_m(height_m);
  }

  void cast() { cast(scene_, scene_); }
  void cast(const world::Scene& before, const world::Scene& after) {
    LidarModel model(config_, 1);
    std::string bytes(model.sweep_bytes(), '\x55');
    model.cast(before, after, 0, 0, config_.columns, bytes);
    points_.resize(bytes.size() / sizeof(SweepPoint));
    std::memcpy(points_.data(), bytes.data(), bytes.size());
  }

  // The point of the beam closest to these angles.
  const SweepPoint& beam(double azimuth_deg, double elevation_deg) {
    const double turn = std::fmod(azimuth_deg - config_.first_azimuth_deg + 360.0, 360.0);
    const auto column = static_cast<int>(std::lround(turn / 360.0 * config_.columns));
    const auto ring = static_cast<int>(
        std::lround((elevation_deg - config_.elevation_min_deg) /
                    (config_.elevation_max_deg - config_.elevation_min_deg) * (config_.rings - 1)));
    return points_[static_cast<std::size_t>(column % config_.columns * config_.rings + ring)];
  }

  std::size_t returns() const {
    return static_cast<std::size_t>(std::ranges::count_if(
        points_, [](const SweepPoint& point) { return point.x_m != 0.0F || point.y_m != 0.0F; }));
  }

  LidarConfig config_;
  world::Scene scene_;
  std::vector<SweepPoint> points_;
};

TEST_F(LidarModelTest, SweepHasTheSizeOfARealOne) {
  const LidarModel model(config_, 1);

  EXPECT_EQ(model.sweep_bytes(), 1'843'200U);
}

TEST_F(LidarModelTest, BeamsThatPointDownMeetTheGround) {
  cast();

  EXPECT_NEAR(beam(0.0, -10.0).z_m, -1.8F, 1e-4F);
  EXPECT_GT(beam(0.0, -10.0).x_m, 9.0F);
  EXPECT_EQ(beam(0.0, 2.0).x_m, 0.0F);
}

TEST_F(LidarModelTest, FarGroundGivesNoReturn) {
  cast();

  for (const SweepPoint& point : points_) {
    ASSERT_LE(std::hypot(point.x_m, point.y_m, point.z_m), config_.range_max_m + 1e-3);
  }
}

TEST_F(LidarModelTest, BodyIsMetAtItsFace) {
  add_body(12.0, 0.0);
  cast();

  EXPECT_NEAR(beam(0.0, -4.0).x_m, 10.0F, 1e-3F);
  EXPECT_NEAR(beam(0.0, -4.0).y_m, 0.0F, 1e-3F);
}

TEST_F(LidarModelTest, RoofThatIsLowerThanTheSensorIsMetFromAbove) {
  add_body(7.0, 0.0);
  cast();

  const SweepPoint& point = beam(0.0, -2.7);
  EXPECT_NEAR(point.z_m, -0.3F, 1e-3F);
  EXPECT_GT(point.x_m, 5.0F);
  EXPECT_LT(point.x_m, 9.0F);
}

TEST_F(LidarModelTest, NearBodyHidesTheOneBehindIt) {
  add_body(30.0, 0.0);
  add_body(12.0, 0.0, 3.0);
  cast();

  for (const SweepPoint& point : points_) {
    const bool is_behind = point.x_m > 27.0F && std::abs(point.y_m) < 1.1F && point.z_m > -1.7F;
    ASSERT_FALSE(is_behind) << point.x_m << ", " << point.y_m << ", " << point.z_m;
  }
  EXPECT_NEAR(beam(0.0, -1.0).x_m, 10.0F, 1e-3F);
}

TEST_F(LidarModelTest, EachColumnSeesTheSceneOfItsOwnTime) {
  config_.first_azimuth_deg = -180.0;
  add_body(12.0, 0.0);
  auto after = scene_;
  after.mutable_header()->set_taken_ns(config_.turn_ns);
  after.mutable_bodies(0)->set_x_m(14.0);
  cast(scene_, after);

  // Straight ahead is half of the turn, so half of the way.
  EXPECT_NEAR(beam(0.0, -4.0).x_m, 11.0F, 1e-2F);
  EXPECT_EQ(beam(0.0, -4.0).time, 32768);
}

TEST_F(LidarModelTest, PointsAreSeenFromWhereTheSensorWas) {
  config_.first_azimuth_deg = -180.0;
  config_.mount_forward_m = 0.5;
  add_body(12.0, 0.0);
  auto after = scene_;
  after.mutable_header()->set_taken_ns(config_.turn_ns);
  after.mutable_ego()->set_x_m(2.0);
  cast(scene_, after);

  EXPECT_NEAR(beam(0.0, -4.0).x_m, 10.0F - 1.0F - 0.5F, 1e-2F);
}

TEST_F(LidarModelTest, TurnedAndMovedSceneLooksTheSame) {
  add_body(12.0, 3.0);
  scene_.mutable_bodies(0)->set_heading_rad(0.3);
  cast();
  const auto before = points_;

  auto& ego = *scene_.mutable_ego();
  auto& body = *scene_.mutable_bodies(0);
  ego.set_x_m(400'000.0);
  ego.set_heading_rad(0.5 * std::numbers::pi);
  body.set_x_m(400'000.0 - 3.0);
  body.set_y_m(12.0);
  body.set_heading_rad(0.3 + 0.5 * std::numbers::pi);
  cast();

  for (std::size_t index = 0; index < points_.size(); ++index) {
    ASSERT_NEAR(points_[index].x_m, before[index].x_m, 1e-3F);
    ASSERT_NEAR(points_[index].y_m, before[index].y_m, 1e-3F);
  }
}

TEST_F(LidarModelTest, NoiseIsAlongTheBeamAndOfItsSize) {
  config_.range_stddev_m = 0.02;
  add_body(12.0, 0.0, 4.0);
  cast();

  double square = 0.0;
  int count = 0;
  for (const SweepPoint& point : points_) {
    if (point.x_m > 9.0F && point.x_m < 11.0F && std::abs(point.y_m) < 0.9F && point.z_m > -1.5F) {
      square += std::pow(static_cast<double>(point.x_m) - 10.0, 2.0);
      ++count;
    }
  }
  ASSERT_GT(count, 500);
  EXPECT_NEAR(std::sqrt(square / count), 0.02, 0.002);
}

TEST_F(LidarModelTest, SomeBeamsGiveNoReturn) {
  cast();
  const auto all = static_cast<double>(returns());
  config_.beam_dropout = 0.1;
  cast();

  EXPECT_NEAR(static_cast<double>(returns()) / all, 0.9, 0.005);
}

TEST_F(LidarModelTest, SpoiledPointsAreNoNumbers) {
  add_body(12.0, 0.0);
  cast();
  std::string bytes(reinterpret_cast<const char*>(points_.data()), 3 * sizeof(SweepPoint));
  spoil(bytes);

  SweepPoint point;
  std::memcpy(&point, bytes.data() + sizeof point, sizeof point);
  EXPECT_TRUE(std::isnan(point.x_m) && std::isnan(point.y_m) && std::isnan(point.z_m));
  EXPECT_EQ(point.ring, points_[1].ring);
}

TEST_F(LidarModelTest, TurnsClockwiseWithRingsOfItsOwnElevations) {
  config_.columns = 4;
  config_.rings = 3;
  config_.first_azimuth_deg = 0.0;
  config_.is_clockwise = true;
  config_.elevations_deg = {-30.0, -10.0, -5.0};

  cast();

  // Columns ahead, right, behind, left.
  const auto at = [this](std::size_t column, std::size_t ring) {
    return points_[3 * column + ring];
  };
  for (std::size_t ring = 0; ring < 3; ++ring) {
    const double slope = std::tan(-config_.elevations_deg[ring] * std::numbers::pi / 180.0);
    const double distance_m = config_.mount_height_m / slope;
    EXPECT_NEAR(at(0, ring).x_m, distance_m, 1e-3);
    EXPECT_NEAR(at(1, ring).y_m, -distance_m, 1e-3);
    EXPECT_NEAR(at(2, ring).x_m, -distance_m, 1e-3);
    EXPECT_NEAR(at(3, ring).y_m, distance_m, 1e-3);
  }
}

}  // namespace
}  // namespace ads
