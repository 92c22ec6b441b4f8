#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include <fastcycle/fastcycle.h>

#include "common/pose_filter.h"
#include "gnss/position.pb.h"
#include "localization/ego.pb.h"
#include "localization/filter_state.pb.h"
#include "mission/goal.pb.h"
#include "motion/motion.pb.h"
#include "quality.h"
#include "speed_filter.h"
#include "vehicle/state.pb.h"

namespace ads {

/// Estimates the pose and motion of the ego vehicle; see `PoseFilter` and `SpeedFilter`.
///
/// In:   `mission/initial_pose`, `gnss/position`, `imu/motion`, `vehicle/state`
/// Out:  `localization/ego`, with every inertial measurement
/// Keeps: `filter`, its complete state
class Localization final : public fastcycle::Component {
 public:
  explicit Localization(fastcycle::Context& context);
  void stop() override;

 private:
  using Time = std::chrono::nanoseconds;

  // When each input was last received.
  struct Received {
    std::optional<Time> motion;
    std::optional<Time> vehicle_state;
    std::optional<Time> fix;
    std::optional<Time> good_fix;
  };

  // The filters' times: since the first message, so that they are small. They never decrease.
  template <typename Measurement>
  Time time_of(const Measurement& message);

  void save(localization::FilterState& state) const;
  void load(const localization::FilterState& state);
  void on_initial_pose(const mission::InitialPose& pose);
  bool take(std::optional<Time>& last, Time taken);
  void on_position(const gnss::Position& position);
  void on_motion(const motion::Imu& imu);
  void on_vehicle_state(const vehicle::State& state);
  void publish();
  [[nodiscard]] Judgement judge_estimate(const PoseEstimate& estimate) const;

  const QualityLimits limits_;
  fastcycle::Param<double> wheelbase_m_;
  fastcycle::Param<double> steering_noise_radps_;
  fastcycle::Param<double> steering_noise_share_;
  PoseFilter pose_;
  SpeedFilter speed_;
  fastcycle::Publisher<localization::Ego> egos_;
  fastcycle::State<localization::FilterState> state_;

  std::optional<Time> first_taken_;
  Time newest_{};
  Received received_;
  std::int64_t fix_count_ = 0;
  std::int64_t rejected_count_ = 0;
  std::int64_t invalid_count_ = 0;
  std::int64_t lost_count_ = 0;
  std::int64_t uncertain_count_ = 0;
};

}  // namespace ads
