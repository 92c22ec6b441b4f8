#include <cmath>

#include "fastcycle/transforms.h"

namespace fastcycle::transforms {
namespace {

constexpr double kNoAngle = 1e-12;  // Below, half an angle is too small to divide by its sine.

Vector cross(const Vector& a, const Vector& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

Vector operator+(const Vector& a, const Vector& b) noexcept {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}

Vector operator*(double factor, const Vector& vector) noexcept {
  return {factor * vector.x, factor * vector.y, factor * vector.z};
}

Quaternion normalized(const Quaternion& q) noexcept {
  const double norm = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  return {q.w / norm, q.x / norm, q.y / norm, q.z / norm};
}

Quaternion weighted(double a, const Quaternion& p, double b, const Quaternion& q) noexcept {
  return normalized({a * p.w + b * q.w, a * p.x + b * q.x, a * p.y + b * q.y, a * p.z + b * q.z});
}

Quaternion slerp(const Quaternion& from, const Quaternion& to, double part) noexcept {
  const Quaternion between = to * from.conjugate();
  const double sine =
      std::sqrt(between.x * between.x + between.y * between.y + between.z * between.z);
  // A quaternion and its negative are the same rotation: use the nearer one.
  const double sign = between.w < 0.0 ? -1.0 : 1.0;
  if (sine < kNoAngle) {
    return weighted(1.0 - part, from, sign * part, to);
  }
  const double angle = std::atan2(sine, std::abs(between.w));
  return weighted(std::sin((1.0 - part) * angle), from, sign * std::sin(part * angle), to);
}

}  // namespace

Vector Quaternion::operator*(const Vector& vector) const noexcept {
  const Vector axis{x, y, z};
  const Vector twice = 2.0 * cross(axis, vector);
  return vector + w * twice + cross(axis, twice);
}

Quaternion Quaternion::operator*(const Quaternion& first) const noexcept {
  return {w * first.w - x * first.x - y * first.y - z * first.z,
          w * first.x + x * first.w + y * first.z - z * first.y,
          w * first.y - x * first.z + y * first.w + z * first.x,
          w * first.z + x * first.y - y * first.x + z * first.w};
}

Quaternion from_roll_pitch_yaw(double roll, double pitch, double yaw) noexcept {
  const Quaternion about_x{std::cos(roll / 2), std::sin(roll / 2), 0.0, 0.0};
  const Quaternion about_y{std::cos(pitch / 2), 0.0, std::sin(pitch / 2), 0.0};
  const Quaternion about_z{std::cos(yaw / 2), 0.0, 0.0, std::sin(yaw / 2)};
  return about_z * about_y * about_x;
}

Vector Transform::operator*(const Vector& point) const noexcept {
  return rotation * point + translation;
}

Transform Transform::operator*(const Transform& first) const noexcept {
  return {*this * first.translation, rotation * first.rotation};
}

Transform Transform::inverse() const noexcept {
  const Quaternion back = rotation.conjugate();
  return {back * (-1.0 * translation), back};
}

Transform interpolate(const Transform& from, const Transform& to, double part) noexcept {
  return {(1.0 - part) * from.translation + part * to.translation,
          slerp(from.rotation, to.rotation, part)};
}

Pose from_message(const transform::Transform& message) {
  Pose pose{.taken = Time(Duration(message.header().taken_ns()))};
  if (message.has_translation()) {
    const auto& translation = message.translation();
    pose.child_to_parent.translation = {translation.x_m(), translation.y_m(), translation.z_m()};
  }
  if (message.has_rotation()) {
    const auto& rotation = message.rotation();
    pose.child_to_parent.rotation = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
  }
  return pose;
}

void to_message(std::string_view parent, std::string_view child, const Pose& pose,
                transform::Transform& message) {
  message.mutable_header()->set_taken_ns(pose.taken.time_since_epoch().count());
  message.mutable_header()->mutable_frame()->assign(parent);
  message.mutable_child()->assign(child);
  auto& translation = *message.mutable_translation();
  translation.set_x_m(pose.child_to_parent.translation.x);
  translation.set_y_m(pose.child_to_parent.translation.y);
  translation.set_z_m(pose.child_to_parent.translation.z);
  auto& rotation = *message.mutable_rotation();
  rotation.set_w(pose.child_to_parent.rotation.w);
  rotation.set_x(pose.child_to_parent.rotation.x);
  rotation.set_y(pose.child_to_parent.rotation.y);
  rotation.set_z(pose.child_to_parent.rotation.z);
}

}  // namespace fastcycle::transforms
