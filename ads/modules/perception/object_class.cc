#include "object_class.h"

namespace ads {
namespace {

// Posts stand.
constexpr double kTwoWheelerSpeed_mps = 1.5;
constexpr double kTwoWheelerLength_m = 3.0;
// An object that is neither longer nor wider may be a person.
constexpr double kPersonSize_m = 1.2;
constexpr double kTruckLength_m = 7.0;
constexpr double kTruckHeight_m = 2.6;

}  // namespace

perception::ObjectClass class_of(const TrackedObject& object, double likeness_min) {
  const Track& track = object.track;
  const bool may_ride =
      track.speed_mps() > kTwoWheelerSpeed_mps || track.speed_stddev_mps() > kTwoWheelerSpeed_mps;
  if (object.two_wheeler_likeness > 0.0 && may_ride && track.length_m() < kTwoWheelerLength_m) {
    return perception::TWO_WHEELER;
  }
  if (object.vehicle_likeness - object.hollowness < likeness_min) {
    return perception::UNKNOWN;
  }
  if (track.width_m() < kPersonSize_m && track.length_m() < kTwoWheelerLength_m) {
    return track.length_m() < kPersonSize_m ? perception::UNKNOWN : perception::TWO_WHEELER;
  }
  const bool is_large = track.length_m() > kTruckLength_m || track.height_m() > kTruckHeight_m;
  return is_large ? perception::TRUCK : perception::CAR;
}

}  // namespace ads
