#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "box_view.h"
#include "perception/tracker_state.pb.h"

namespace ads {

/// The prior of an object's size, and its motion model. Standard deviations are 1 sigma.
struct TrackConfig {
  double length_m = 4.8;
  double length_stddev_m = 0.8;
  double width_m = 1.9;
  double width_stddev_m = 0.3;
  /// The minimum uncertainty of a size when it is measured again.
  double size_doubt_m = 0.15;
  /// The same if one side is where it should be, and the other extends farther.
  double growth_doubt_m = 0.5;
  double speed_stddev_mps = 12.0;
  /// Time constant and standard deviation of the acceleration (Singer's model).
  double maneuver_s = 0.7;
  double forward_stddev_mps2 = 4.0;
  double sideways_stddev_mps2 = 1.0;
  /// The random walk of the yaw rate, and its time constant.
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
/// heading than across it.
///
/// Each edge of the box that is seen is a separate measurement: front = centre along the heading +
/// length / 2, and so on. So the visible sides determine the box, the size is estimated whenever
/// two opposite sides are visible, and nothing jumps when another side comes into view. A side that
/// only bounds the box pushes it outwards and never inwards.
///
/// Heading and yaw rate are a second filter: measured by the faces seen, and by the direction of
/// the velocity.
///
/// @threads  Confined.
class Track {
 public:
  Track(const TrackConfig& config, std::int64_t time_ns, const Eigen::Vector2d& center_m,
        double heading_rad);
  /// Restores `state`; the initial size is that of `state`, not of `config`.
  ///
  /// @errors  Throws `std::invalid_argument` if `state` is not of the size of a track's.
  Track(const TrackConfig& config, const perception::TrackState& state);

  void save(perception::TrackState& state) const;

  void predict(std::int64_t time_ns);
  /// Updates the track with a view of the object, at the time of the track.
  void update(const ObjectView& view, const Skyline& skyline);

  /// Separates it from an object behind it: its length is reset from the end closer to the sensor.
  void cut(const Eigen::Vector2d& sensor_m);

  /// The squared Mahalanobis distance between the view and the prediction.
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
  int astray_ = 0;           // Consecutive sweeps in which it moved across its heading.
  int misfits_ = 0;          // Consecutive sweeps in which another heading fitted better.
};

}  // namespace ads
