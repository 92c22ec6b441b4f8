#pragma once

#include "perception/objects.pb.h"
#include "tracker.h"

namespace ads {

/// The class of the object, by its shape.
///
/// An object as small as a person, less than 1.2 m long and wide, is `UNKNOWN`: posts, bins and
/// bushes are as small, and no labelled data have shown that size distinguishes people from them.
/// `PEDESTRIAN` is never returned.
///
/// @param likeness_min  Below this likeness to a vehicle it is `UNKNOWN`; see `TrackedObject`.
perception::ObjectClass class_of(const TrackedObject& object, double likeness_min);

}  // namespace ads
