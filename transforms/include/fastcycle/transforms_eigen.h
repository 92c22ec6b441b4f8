#pragma once

// Conversions for Eigen; FastCycle itself does not need Eigen.

#include <Eigen/Geometry>

#include "fastcycle/transforms.h"

namespace fastcycle::transforms {

[[nodiscard]] inline Eigen::Vector3d to_eigen(const Vector& vector) {
  return {vector.x, vector.y, vector.z};
}

[[nodiscard]] inline Eigen::Quaterniond to_eigen(const Quaternion& rotation) {
  return {rotation.w, rotation.x, rotation.y, rotation.z};
}

/// `point_in_b = to_eigen(a_to_b) * point_in_a`, as before.
[[nodiscard]] inline Eigen::Isometry3d to_eigen(const Transform& transform) {
  return Eigen::Translation3d(to_eigen(transform.translation)) * to_eigen(transform.rotation);
}

[[nodiscard]] inline Vector from_eigen(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

[[nodiscard]] inline Transform from_eigen(const Eigen::Isometry3d& transform) {
  const Eigen::Quaterniond rotation(transform.rotation());
  return {from_eigen(Eigen::Vector3d(transform.translation())),
          {rotation.w(), rotation.x(), rotation.y(), rotation.z()}};
}

}  // namespace fastcycle::transforms
