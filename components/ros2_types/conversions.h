#pragma once

#include "ros2/converter.h"

namespace fastcycle::ros2 {

/// The functions that mappings.json names under "conversion".
[[nodiscard]] const Conversions& shipped_conversions();

/// Markers and scenes; defined in markers.cc.
void markers_to_scene(CdrReader& in, google::protobuf::Message& out);
void scene_to_markers(const google::protobuf::Message& in, CdrWriter& out);

}  // namespace fastcycle::ros2
