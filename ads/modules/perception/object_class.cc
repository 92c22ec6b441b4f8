#include "object_class.h"

#include "perception_tuning.h"

namespace ads {
namespace {}  // namespace

perception::ObjectClass class_of(const TrackedObject& object, double likeness_min) {
  const Track& track = object.track;
  const bool may_ride = track.speed_mps() > kObjectClass.two_wheeler_speed_mps ||
                        track.speed_stddev_mps() > kObjectClass.two_wheeler_speed_mps;
  if (object.two_wheeler_likeness > 0.0 && may_ride &&
      track.length_m() < kObjectClass.two_wheeler_length_m) {
    return perception::TWO_WHEELER;
  }
  if (object.vehicle_likeness - object.hollowness < likeness_min) {
    return perception::UNKNOWN;
  }
  if (track.width_m() < kObjectClass.person_size_m &&
      track.length_m() < kObjectClass.two_wheeler_length_m) {
    return track.length_m() < kObjectClass.person_size_m ? perception::UNKNOWN
                                                         : perception::TWO_WHEELER;
  }
  const bool is_large = track.length_m() > kObjectClass.truck_length_m ||
                        track.height_m() > kObjectClass.truck_height_m;
  return is_large ? perception::TRUCK : perception::CAR;
}

}  // namespace ads
