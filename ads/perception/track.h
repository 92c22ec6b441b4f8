#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "box_view.h"
#include "perception/tracker_state.pb.h"

namespace ads {

/// What is known of an object before it is seen well, and how it may move. Standard deviations are
/// 1 sigma.
struct TrackConfig {
  double length_m = 4.8;
  double length_stddev_m = 0.8;
  double width_m = 1.9;
  double width_stddev_m = 0.3;
  /// So much a size is doubted at least when it is measured anew.
  double size_doubt_m = 0.15;
  /// And so much if one side is where it should be, and the other reaches farther.
  double growth_doubt_m = 0.5;
  double speed_stddev_mps = 12.0;
  /// The acceleration lasts for about this time (Singer's model), and is of this size.
  double maneuver_s = 0.7;
  double forward_stddev_mps2 = 4.0;
  double sideways_stddev_mps2 = 1.0;
  /// How fast the yaw rate changes, and for how long it lasts.
  double yaw_walk_radps_per_sqrt_s = 0.4;
  double turn_s = 1.0;
  /// From this speed on the heading is that of the motion.
  double course_speed_mps = 2.0;
};

/// One object: its box and motion.
///
/// A linear Kalman filter holds, in this order, the centre [m], velocity [m/s] and acceleration
/// [m/s^2] in the map, and length and width [m]. The acceleration is a first-order Gauss-Markov
/// process (Singer, "Estimating Optimal Tracking Filter Performance for Manned Maneuvering
/// Targets", IEEE Transactions on Aerospace and Electronic Systems 6(4), 1970), larger along the
/// heading than across. Each edge of the box that is seen is a measurement of its own: front =
/// centre along the heading + length / 2, and so on. So the sides that are seen hold the box, the
/// size is learned whenever two opposite sides are seen, and nothing jumps when another side comes
/// into view. A side that only bounds the box pushes it outwards and never inwards.
///
/// Heading and yaw rate are a second filter: measured by the faces seen, and by the direction of
/// the velocity.
///
/// @threads  Confined.
class Track {
 public:
  Track(const TrackConfig& config, std::int64_t time_ns, const Eigen::Vector2d& center_m,
        double heading_rad);
  /// As `state` tells; the size that it begins with is of there, and not of `config`.
  ///
  /// @errors  Throws `std::invalid_argument` if `state` is not of the size of a track's.
  Track(const TrackConfig& config, const perception::TrackState& state);

  void save(perception::TrackState& state) const;

  void predict(std::int64_t time_ns);
  /// A sweep has seen the object, at the time of the track.
  void update(const ObjectView& view, const Skyline& skyline);

  /// It was taken for one with what stands behind it: its length is begun anew at the end that is
  /// closer to the sensor.
  void cut(const Eigen::Vector2d& sensor_m);

  /// The squared Mahalanobis distance of the object seen from where this one is expected.
  [[nodiscard]] double distance2(const ObjectView& view, const Skyline& skyline) const;

  [[nodiscard]] std::int64_t time_ns() const { return time_ns_; }
  [[nodiscard]] Eigen::Vector2d center_m() const { return state_.head<2>(); }
  [[nodiscard]] Eigen::Vector2d velocity_mps() const { return state_.segment<2>(2); }
  [[nodiscard]] double heading_rad() const { return heading_[0]; }
  [[nodiscard]] double yaw_rate_radps() const { return heading_[1]; }
  [[nodiscard]] double length_m() const { return state_[6]; }
  [[nodiscard]] double width_m() const { return state_[7]; }
  [[nodiscard]] double height_m() const { return height_m_; }
  [[nodiscard]] double speed_mps() const;
  [[nodiscard]] double acceleration_mps2() const;
  [[nodiscard]] double position_stddev_m() const;
  [[nodiscard]] double speed_stddev_mps() const;
  [[nodiscard]] double heading_stddev_rad() const;
  [[nodiscard]] double length_stddev_m() const;

 private:
  using State = Eigen::Matrix<double, 8, 1>;
  using Covariance = Eigen::Matrix<double, 8, 8>;

  void begin_size();
  void update_heading(double heading_rad, double stddev_rad);
  [[nodiscard]] double near_heading_of(const ObjectView& view);
  void doubt_size(const Edge& high, const Edge& low, int axis);
  void update_edge(const Edge& edge, int axis, double sign);
  [[nodiscard]] Eigen::Vector2d nearest_point(const Eigen::Vector2d& sensor_m) const;
  void turn_about(const Eigen::Vector2d& point_m, double turn_rad);
  bool follow_course();
  void turn_to(double heading_rad);

  TrackConfig config_;
  std::int64_t time_ns_;
  State state_ = State::Zero();
  Covariance covariance_ = Covariance::Zero();
  Eigen::Vector2d heading_;
  Eigen::Matrix2d heading_covariance_;
  double height_m_ = 0.0;
  bool has_course_ = false;  // Its direction of motion is known.
  int astray_ = 0;           // Sweeps in a row in which it moved across its heading.
  int misfits_ = 0;          // And in which another heading fitted better.
};

}  // namespace ads
