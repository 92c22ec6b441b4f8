#include "object_class.h"

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kAny = -1e3;

TrackedObject object_of(double length_m, double width_m, double height_m = 1.5) {
  const TrackConfig config{.length_m = length_m, .width_m = width_m};
  perception::TrackState state;
  Track(config, 0, {10.0, 0.0}, 0.0).save(state);
  state.set_height_m(height_m);
  return {.track = Track(config, state)};
}

TEST(ObjectClass, OfAnObjectOfACarsSizeIsCar) {
  EXPECT_EQ(class_of(object_of(4.4, 1.8), kAny), perception::CAR);
}

TEST(ObjectClass, OfALongOrAHighObjectIsTruck) {
  EXPECT_EQ(class_of(object_of(12.0, 2.5), kAny), perception::TRUCK);
  EXPECT_EQ(class_of(object_of(5.0, 2.0, 2.8), kAny), perception::TRUCK);
}

TEST(ObjectClass, OfANarrowObjectIsTwoWheeler) {
  EXPECT_EQ(class_of(object_of(1.8, 0.6), kAny), perception::TWO_WHEELER);
}

// A person is as small, and so is a post; nothing here distinguishes them.
TEST(ObjectClass, OfAnObjectAsSmallAsAPersonIsUnknown) {
  EXPECT_EQ(class_of(object_of(0.6, 0.6, 1.8), kAny), perception::UNKNOWN);
  EXPECT_EQ(class_of(object_of(1.1, 1.1, 1.0), kAny), perception::UNKNOWN);
}

TEST(ObjectClass, OfWhatLooksTooLittleLikeAVehicleIsUnknown) {
  TrackedObject object = object_of(4.4, 1.8);
  object.vehicle_likeness = 1.0;
  object.hollowness = 2.0;

  EXPECT_EQ(class_of(object, -1.5), perception::CAR);
  EXPECT_EQ(class_of(object, -0.5), perception::UNKNOWN);
}

TEST(ObjectClass, OfWhatLooksLikeSomebodyOnTwoWheelsIsTwoWheeler) {
  TrackedObject object = object_of(2.5, 1.4);
  object.two_wheeler_likeness = 1.0;  // Its speed is not known: it may ride.

  EXPECT_EQ(class_of(object, 1.0), perception::TWO_WHEELER);
}

}  // namespace
}  // namespace ads
