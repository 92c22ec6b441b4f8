#pragma once

#include <filesystem>
#include <optional>

#include <Eigen/Core>

namespace kitti {

/// The projection from the lidar's frame into the picture of camera 2.
///
/// @threads  Compatible.
struct Calibration {
  Eigen::Matrix<double, 3, 4> projection = Eigen::Matrix<double, 3, 4>::Zero();  ///< `P2`
  Eigen::Matrix3d rectification = Eigen::Matrix3d::Identity();                   ///< `R0_rect`
  Eigen::Matrix<double, 3, 4> lidar_to_camera =
      Eigen::Matrix<double, 3, 4>::Zero();  ///< `Tr_velo_to_cam`

  /// @errors  Throws `std::runtime_error`, with file, line, expected and found, if one of the three
  ///          is missing, has another count of numbers, or numbers that are not finite.
  static Calibration read(const std::filesystem::path& file);

  /// The pixel of a point in the lidar's frame, from the upper left corner; none if it lies behind
  /// the camera.
  [[nodiscard]] std::optional<Eigen::Vector2d> pixel_of(const Eigen::Vector3d& place_m) const;
  /// A position in the camera's rectified frame, converted to the lidar's frame.
  [[nodiscard]] Eigen::Vector3d from_camera(const Eigen::Vector3d& camera_m) const;
};

}  // namespace kitti
