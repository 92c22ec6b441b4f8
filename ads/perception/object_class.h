#pragma once

#include "perception/objects.pb.h"
#include "tracker.h"

namespace ads {

/// What the object looks like.
///
/// An object as small as a person, less than 1.2 m long and wide, is `UNKNOWN`: posts, bins and
/// bushes are as small, and no labelled people have shown that they can be told apart by it.
/// `PEDESTRIAN` is never returned.
///
/// @param likeness_min  What looked less like a vehicle is `UNKNOWN`; see `TrackedObject`.
perception::ObjectClass class_of(const TrackedObject& object, double likeness_min);

}  // namespace ads
