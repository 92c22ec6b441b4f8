#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "applications/kitti/drive/calibration.h"

namespace kitti {

/// Object classes that the score distinguishes.
enum class Kind : std::uint8_t { kVehicle, kCyclist, kOther };

/// A manually labelled box around an object, in the lidar's frame.
struct Label {
  std::int64_t track = 0;
  Kind kind = Kind::kOther;
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  double heading_rad = 0.0;
  double length_m = 0.0;
  double width_m = 0.0;
  double height_m = 0.0;
};

/// A part of the picture with unlabelled objects, in pixels.
struct DontCare {
  Eigen::Vector2d least;
  Eigen::Vector2d most;
};

/// The labels of one frame.
struct LabelledFrame {
  std::vector<Label> labels;
  std::vector<DontCare> dont_care;
};

/// Labels by the number of their frame, in the layout of KITTI's tracking benchmark: frame, track,
/// type, truncated, occluded, alpha, four numbers of the box in the picture, height, width, length,
/// three of the place in the camera's frame (of the middle of the bottom), turn about its y axis.
/// Car, Van and Truck are vehicles.
///
/// @errors  Throws `std::runtime_error`, with line, expected and found, if a line has another
///          count of words or no numbers.
[[nodiscard]] std::map<std::int64_t, LabelledFrame> parse_labels(std::string_view text,
                                                                 const Calibration& calibration,
                                                                 const std::string& name);

}  // namespace kitti
