#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace odometry {

/// A position in the plane and a direction, or the motion from one to another.
struct Pose {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;

  /// This pose, moved by `motion` in its own frame.
  [[nodiscard]] Pose moved(const Pose& motion) const;
  /// The motion from here to `other`, in the frame of this pose.
  [[nodiscard]] Pose motion_to(const Pose& other) const;
};

struct ScanMatcherConfig {
  double voxel_m = 1.0;
  double range_min_m = 3.0;
  double range_max_m = 60.0;
  /// Radius of the map: points farther from the sensor are removed.
  double map_range_m = 80.0;
  /// Relative to the sensor. The ground and what hangs over the street are excluded.
  double height_min_m = -1.3;
  double height_max_m = 3.0;
  /// The maximum distance between a point and its match in the map: before the motion is known, and
  /// later.
  double reach_first_m = 2.5;
  double reach_m = 1.0;
};

/// A point of a sweep, relative to the sensor, and its time: 0 at the begin and 1 at the end.
struct TimedPoint {
  Eigen::Vector3f place_m = Eigen::Vector3f::Zero();
  float share = 0.0F;
};

/// Estimates the sensor's motion in the plane: matches each sweep with a map of earlier ones.
///
/// The scheme is that of Vizzo, Guadagnino, Mersch, Wiesmann, Behley, Stachniss, "KISS-ICP: In
/// Defense of Point-to-Point ICP" (RA-L 8(2), 2023): the motion is predicted as constant,
/// transforms the points of the turn to one time, and is corrected by iterated closest points
/// (Besl, McKay, PAMI 14(2), 1992) of voxels against a voxel map, with weights that suppress moving
/// objects. Here the pose has three unknowns, and each step has a closed form.
///
/// Deterministic: the same sweeps give the same poses.
///
/// @threads  Confined.
class ScanMatcher {
 public:
  explicit ScanMatcher(const ScanMatcherConfig& config);

  /// Matches the next sweep with the map. Sweeps may be missing before it.
  ///
  /// @param turn_s    How long the sweep took, above 0.
  /// @param passed_s  From the begin of the previous sweep to that of this one, above 0.
  void take(std::span<const TimedPoint> points, double turn_s, double passed_s);

  /// Of the sensor at the end of the last sweep; the first sweep ends at the origin.
  [[nodiscard]] const Pose& pose() const { return pose_; }
  /// The motion of the sensor over the last sweep, per second.
  [[nodiscard]] const Pose& rate() const { return rate_; }
  /// The mean distance of matched points from the map, and the matched share of points.
  [[nodiscard]] double residual_m() const { return residual_m_; }
  [[nodiscard]] double matched_share() const { return matched_share_; }

 private:
  using Voxel = std::array<int, 3>;
  struct VoxelHash {
    std::size_t operator()(const Voxel& voxel) const;
  };
  using Voxels = std::unordered_map<Voxel, std::vector<Eigen::Vector3f>, VoxelHash>;

  [[nodiscard]] Pose over(double time_s) const;
  [[nodiscard]] Pose match(std::span<const TimedPoint> points, double turn_s, double passed_s,
                           double reach_m);
  void find_first_rate(std::span<const TimedPoint> points, double turn_s, double passed_s);
  [[nodiscard]] double share_on_map(const std::vector<Eigen::Vector3f>& points,
                                    const Pose& pose) const;
  [[nodiscard]] std::vector<Eigen::Vector3f> at_end(std::span<const TimedPoint> points,
                                                    const Pose& motion) const;
  [[nodiscard]] Pose align(const std::vector<Eigen::Vector3f>& points, Pose pose, double reach_m);
  [[nodiscard]] const Eigen::Vector3f* nearest(const Eigen::Vector3f& place_m,
                                               double reach_m) const;
  void add_to_map(const std::vector<Eigen::Vector3f>& points);

  const ScanMatcherConfig config_;
  Voxels map_;
  Pose pose_;
  Pose rate_;
  std::vector<TimedPoint> first_;  // The first sweep, until the motion during it is known.
  int sweeps_ = 0;
  double residual_m_ = 0.0;
  double matched_share_ = 0.0;
};

}  // namespace odometry
