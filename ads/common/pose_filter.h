#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <utility>

#include <Eigen/Core>

namespace ads {

/// Parameters of sensors and car. Standard deviations are 1 sigma.
struct PoseFilterConfig {
  /// The slow error of the receiver (atmosphere, multipath): size and correlation time.
  double fix_bias_stddev_m = 1.5;
  double fix_bias_time_s = 100.0;
  /// The independent error of each fix.
  double fix_noise_m = 0.6;
  /// Squared Mahalanobis distance beyond which a fix is an outlier; 13.8 is 99.9 % of two
  /// dimensions.
  double fix_gate = 13.8;
  /// After this many consecutive outliers the filter resets to the fixes; 0: never.
  std::size_t fix_outliers_max = 20;

  /// True speed over wheel speed: its initial deviation from 1, and its random walk.
  double wheel_scale_stddev = 0.02;
  double wheel_scale_walk_per_sqrt_s = 2e-4;
  /// Noise of the distance from the wheels, as a random walk along the heading and across it
  /// (slip).
  double distance_walk_m_per_sqrt_s = 0.05;
  double slip_walk_m_per_sqrt_s = 0.05;

  /// Noise of the gyroscope, and the random walk of its offset.
  double yaw_walk_rad_per_sqrt_s = 0.001;
  double gyro_bias_stddev_radps = 0.01;
  double gyro_bias_walk_radps_per_sqrt_s = 1e-4;
  /// Noise of one measurement of the gyroscope, when it is averaged in a stationary car.
  double gyro_noise_radps = 0.01;

  /// The receiver's course is used from this speed on. The heading is initialized from it with
  /// `course_stddev_rad`; later courses are weighted with `course_noise_rad`, which exceeds their
  /// deviation because their errors last for several fixes.
  double course_speed_min_mps = 2.0;
  double course_stddev_rad = 0.09;
  double course_noise_rad = 0.05;

  /// Noise of one wheel speed. It affects only the reported speed, not the position.
  double wheel_noise_mps = 0.02;

  /// The distance from the middle of the rear axle forward to the estimated point.
  double rear_axle_to_point_m = 1.6;
};

/// A position computed by a satellite receiver, in the local plane.
struct PlaneFix {
  Eigen::Vector2d position_m{0.0, 0.0};  ///< East, north.
  std::optional<double> yaw_rad;         ///< Its course, counter-clockwise from east.
  double speed_mps = 0.0;
};

/// A pose that is known from another source.
struct KnownPose {
  Eigen::Vector2d position_m{0.0, 0.0};
  double yaw_rad = 0.0;
  double speed_mps = 0.0;
  double position_stddev_m = 1.0;  ///< Per axis.
  double yaw_stddev_rad = 0.1;
};

/// The filter's estimate at one time.
struct PoseEstimate {
  std::chrono::nanoseconds time{};
  Eigen::Vector2d position_m{0.0, 0.0};
  Eigen::Vector2d velocity_mps{0.0, 0.0};
  double yaw_rad = 0.0;
  double yaw_rate_radps = 0.0;
  bool has_heading = false;
  double position_stddev_m = 0.0;
  double yaw_stddev_rad = 0.0;
  double wheel_scale = 1.0;
  double gyro_bias_radps = 0.0;
  double speed_mps = 0.0;  ///< Of the rear axle.
  /// Of position, yaw, speed and yaw rate, in this order.
  Eigen::Matrix<double, 5, 5> covariance = Eigen::Matrix<double, 5, 5>::Zero();
};

/// Estimates the pose of a car from wheel speed, yaw rate and late GNSS fixes: an extended Kalman
/// filter (Särkkä, "Bayesian Filtering and Smoothing", 2013, algorithm 5.4).
///
/// State, in this order: east and north of the point [m], yaw counter-clockwise from east [rad],
/// wheel scale [1], gyroscope offset [rad/s], slow error of the receiver east and north [m].
///
/// Prediction: dead reckoning. The rear axle moves along the heading (no side slip), the point
/// turns about it; mean heading of each step (Thrun, Burgard, Fox, "Probabilistic Robotics", 2005,
/// section 5.4, with the arc replaced by its chord). The receiver's slow error is a first-order
/// Gauss-Markov process (Groves, "Principles of GNSS, Inertial, and Multisensor Integrated
/// Navigation Systems", 2nd edition, 2013, appendix B.4.3).
///
/// Update: a fix is the position of the point some time before the fix arrived. The filter reckons
/// back from its present state over the recorded sensor values, so that a late fix corrects the
/// present state, including heading and wheel scale, and no past state has to be kept. In a
/// stationary car the gyroscope measures its offset.
///
/// Times of successive calls must not decrease; an earlier one counts as the last. The filter
/// starts with the first fix, or with a known pose. Before, there is no estimate; after a fix there
/// is no heading until one with a course at sufficient speed.
///
/// @threads  Confined.
/// @realtime Bounded: it keeps the steps of at most one second, and no more than `kStepsMax`.
class PoseFilter {
 public:
  static constexpr std::size_t kStepsMax = 1000;

  static constexpr int kSize = 7;
  using State = Eigen::Matrix<double, kSize, 1>;
  using Covariance = Eigen::Matrix<double, kSize, kSize>;

  /// Sensor values, constant over a step.
  struct Step {
    double duration_s = 0.0;
    double wheel_speed_mps = 0.0;
    double yaw_rate_radps = 0.0;
  };
  /// The complete state of the filter.
  struct Memory {
    std::optional<std::chrono::nanoseconds> time;
    double wheel_speed_mps = 0.0;
    double yaw_rate_radps = 0.0;
    double standing_s = 0.0;
    std::deque<Step> steps;  ///< Oldest first.
    double steps_s = 0.0;    ///< Their sum.
    bool has_position = false;
    bool has_heading = false;
    std::size_t outliers_in_a_row = 0;
    State state = State::Zero();
    Covariance covariance = Covariance::Zero();
  };

  explicit PoseFilter(const PoseFilterConfig& config);

  [[nodiscard]] const Memory& memory() const { return memory_; }
  /// Restores the state of another filter with the same configuration.
  void set_memory(Memory memory) { memory_ = std::move(memory); }

  /// Starts, or restarts, with a known pose.
  void on_known_pose(std::chrono::nanoseconds time, const KnownPose& pose);

  /// The yaw rate, counter-clockwise, including the sensor's offset.
  void on_yaw_rate(std::chrono::nanoseconds time, double radps);
  /// The speed of the rear axle.
  void on_wheel_speed(std::chrono::nanoseconds time, double mps);
  /// The yaw rate from steering angle and speed, as one measurement of the gyroscope's offset.
  void on_steered_yaw_rate(std::chrono::nanoseconds time, double radps, double stddev_radps);
  /// The same in place of a silent gyroscope: the vehicle turns at this rate until the next one.
  /// The standard deviation is of an error that lasts for about a second.
  void on_steering_alone(std::chrono::nanoseconds time, double radps, double stddev_radps);
  /// A fix that arrived at `arrival` with the position `age` before; an age beyond the recorded
  /// steps is extrapolated with the oldest speed. Returns false if it was rejected as an outlier.
  bool on_fix(std::chrono::nanoseconds arrival, std::chrono::nanoseconds age, const PlaneFix& fix);

  [[nodiscard]] bool has_position() const { return memory_.has_position; }
  [[nodiscard]] std::size_t outliers_in_a_row() const { return memory_.outliers_in_a_row; }
  /// @pre  `has_position()`
  [[nodiscard]] PoseEstimate estimate() const;

 private:
  using FixJacobian = Eigen::Matrix<double, 2, kSize>;

  // A past time, reckoned back from the present state.
  struct Past {
    Eigen::Vector2d moved_m{0.0, 0.0};            // Motion of the point from then until now.
    Eigen::Vector2d per_wheel_scale_m{0.0, 0.0};  // Its derivative by the wheel scale.
    double yaw_rad = 0.0;                         // The yaw at that time.
    Step step;                                    // The sensor values at that time.
  };

  // A measurement of one dimension.
  struct Scalar {
    double innovation = 0.0;
    double noise = 0.0;  // 1 sigma.
    double gate = 0.0;   // Squared Mahalanobis distance beyond which it is rejected.
  };

  void advance_to(std::chrono::nanoseconds time);
  void remember(const Step& step);
  void predict(const Step& step);
  [[nodiscard]] Past look_back(double age_s) const;
  void begin(const PlaneFix& fix, double age_s);
  void forget(int place, double stddev);
  void begin_heading(const PlaneFix& fix, double age_s);
  bool update_position(const PlaneFix& fix, const Past& past);
  void update_course(const PlaneFix& fix, const Past& past);
  void update_gyro_bias();
  void update_scalar(const State& jacobian, const Scalar& scalar);
  [[nodiscard]] Eigen::Vector2d velocity(double yaw_rad, const Step& step) const;

  // Constant after construction.
  const PoseFilterConfig config_;

  Memory memory_;
};

}  // namespace ads
