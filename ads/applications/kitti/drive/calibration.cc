#include "applications/kitti/drive/calibration.h"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "common/files.h"

namespace kitti {
namespace {

// Nearer to the plane of the camera nothing is seen.
constexpr double kDepthMin_m = 0.1;

template <int kColumns>
Eigen::Matrix<double, 3, kColumns> read_matrix(const std::string& text, const std::string& key,
                                               const std::string& name) {
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line);
    std::string word;
    if (!(words >> word) || (word != key && word != key + ":")) {
      continue;
    }
    std::vector<double> values;
    for (double value = 0.0; words >> value && std::isfinite(value);) {
      values.push_back(value);
    }
    if (!words.eof() || values.size() != 3 * kColumns) {
      throw std::runtime_error(
          fmt::format("{}: line {}: {}: expected {} finite numbers, found {}{}", name, number, key,
                      3 * kColumns, values.size(), words.eof() ? "" : " and something else"));
    }
    return Eigen::Map<const Eigen::Matrix<double, 3, kColumns, Eigen::RowMajor>>(values.data());
  }
  throw std::runtime_error(fmt::format("{}: expected a line {}, found none", name, key));
}

}  // namespace

Calibration Calibration::read(const std::filesystem::path& file) {
  const std::string text = ads::read_file(file);
  Calibration calibration;
  calibration.projection = read_matrix<4>(text, "P2", file.string());
  calibration.rectification = read_matrix<3>(text, "R0_rect", file.string());
  calibration.lidar_to_camera = read_matrix<4>(text, "Tr_velo_to_cam", file.string());
  const Eigen::Matrix3d turn =
      calibration.rectification * calibration.lidar_to_camera.leftCols<3>();
  if (std::abs(turn.determinant() - 1.0) > 0.01) {
    throw std::runtime_error(
        fmt::format("{}: R0_rect, Tr_velo_to_cam: expected rotations, found a determinant of {}",
                    file.string(), turn.determinant()));
  }
  // Else it has no centre of projection.
  if (!calibration.projection.leftCols<3>().inverse().allFinite()) {
    throw std::runtime_error(fmt::format(
        "{}: P2: expected a projection, found one whose first three columns have no inverse",
        file.string()));
  }
  return calibration;
}

std::optional<Eigen::Vector2d> Calibration::pixel_of(const Eigen::Vector3d& place_m) const {
  const Eigen::Vector3d camera_m = rectification * (lidar_to_camera * place_m.homogeneous());
  const Eigen::Vector3d pixel = projection * camera_m.homogeneous();
  if (camera_m.z() < kDepthMin_m || pixel.z() < kDepthMin_m) {
    return std::nullopt;
  }
  return Eigen::Vector2d(pixel.head<2>() / pixel.z());
}

Eigen::Vector3d Calibration::from_camera(const Eigen::Vector3d& camera_m) const {
  const Eigen::Vector3d unrectified = rectification.inverse() * camera_m;
  return lidar_to_camera.leftCols<3>().inverse() * (unrectified - lidar_to_camera.col(3));
}

}  // namespace kitti
