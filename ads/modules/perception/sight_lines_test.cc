#include "sight_lines.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr float kSensor_m = 1.7F;
const GroundBox kBox{.center_m = {15.0, 0.0}, .heading_rad = 0.0, .length_m = 4.2, .width_m = 1.8};

// What a sensor at the origin sees of something that stands ahead, and of the ground around.
class Sight {
 public:
  // Across the way at `x_m`, from the ground up to `top_m`.
  void stand(double x_m, double from_m, double to_m, double top_m, double rise_m = 0.0) {
    things_.push_back({x_m, from_m, to_m, top_m});
    rise_m_ = rise_m;
  }

  // The view of the first thing.
  bool is_seen_through() {
    std::vector<SightLine> lines;
    std::vector<ObjectPoint> points;
    for (double azimuth = -0.3; azimuth < 0.3; azimuth += 0.003) {
      for (double slope = -0.2; slope < 0.0; slope += 0.005) {
        look(azimuth, slope, lines, points);
      }
    }
    SightLines sight_lines;
    sight_lines.fill(lines);
    return sight_lines.is_seen_through({.points = points}, kBox, {4.2, 1.8});
  }

 private:
  struct Thing {
    double x_m;
    double from_m;
    double to_m;
    double top_m;
  };

  void look(double azimuth, double slope, std::vector<SightLine>& lines,
            std::vector<ObjectPoint>& points) const {
    double range = (rise_m_ - kSensor_m) / slope;  // Where it meets the ground.
    const Thing* seen = nullptr;
    for (const Thing& thing : things_) {
      const double its_range = thing.x_m / std::cos(azimuth);
      const double y = thing.x_m * std::tan(azimuth);
      const double height = kSensor_m + slope * its_range - rise_m_;
      if (its_range < range && y > thing.from_m && y < thing.to_m && height < thing.top_m) {
        range = its_range;
        seen = &thing;
      }
    }
    const double z = slope * range;
    lines.push_back({.azimuth_rad = static_cast<float>(azimuth),
                     .range_m = static_cast<float>(range),
                     .z_m = static_cast<float>(z)});
    if (seen == things_.data()) {
      points.push_back({.place_m = {range * std::cos(azimuth), range * std::sin(azimuth)},
                        .height_m = static_cast<float>(kSensor_m + z - rise_m_),
                        .azimuth_rad = static_cast<float>(azimuth),
                        .range_m = static_cast<float>(range),
                        .ground_m = static_cast<float>(rise_m_) - kSensor_m});
    }
  }

  std::vector<Thing> things_;
  double rise_m_ = 0.0;
};

TEST(SightLines, NobodySeesThroughACar) {
  Sight sight;
  sight.stand(12.9, -0.9, 0.9, 1.5);
  EXPECT_FALSE(sight.is_seen_through());
}

TEST(SightLines, OneSeesThroughMostOfABoxAroundAPost) {
  Sight sight;
  sight.stand(15.0, -0.1, 0.1, 1.5);
  EXPECT_TRUE(sight.is_seen_through());
}

TEST(SightLines, HiddenPartOfACarMayBeThere) {
  Sight sight;
  sight.stand(12.9, -0.9, -0.5, 1.5);
  EXPECT_TRUE(sight.is_seen_through());
  sight.stand(8.0, -0.5, 3.0, 2.0);
  EXPECT_FALSE(sight.is_seen_through()) << "behind what stands before it";
}

TEST(SightLines, CarThatIsNotInTheMiddleOfItsBoxIsNotSeenThrough) {
  Sight sight;
  sight.stand(14.0, 0.0, 1.8, 1.5);
  EXPECT_FALSE(sight.is_seen_through());
}

TEST(SightLines, HeightsAreThoseAboveTheGroundOfTheBox) {
  Sight sight;
  sight.stand(12.9, -0.9, 0.9, 0.9, 0.6);
  EXPECT_FALSE(sight.is_seen_through());
}

TEST(SightLines, NothingSeenIsNotSeenThrough) {
  EXPECT_FALSE(SightLines().is_seen_through({}, kBox, {4.2, 1.8}));
}

}  // namespace
}  // namespace ads
