#pragma once

#include <cstdint>
#include <optional>
#include <random>

#include <fastcycle/fastcycle.h>

#include "gnss/position.pb.h"
#include "lidar/sweep.pb.h"
#include "lidar_model.h"
#include "motion/motion.pb.h"
#include "noise.h"
#include "world/scene.pb.h"

namespace ads {

/// Fault modes of the lidar.
enum class LidarFault : std::uint8_t { kNone, kNan, kEmpty };

/// The simulated sensors of the vehicle: computes their measurements of the true scene.
///
/// In:   `world/scene`
/// Out:  `lidar/points`, `gnss/position`, `imu/motion`
class Drivers final : public fastcycle::Component {
 public:
  explicit Drivers(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  struct GnssParams {
    fastcycle::Param<double> period_s;
    fastcycle::Param<double> noise_m;
    fastcycle::Param<double> bias_m;
    fastcycle::Param<double> bias_time_s;
    fastcycle::Param<std::uint32_t> fix_dropout;
  };
  struct ImuParams {
    fastcycle::Param<double> forward_noise_mps2;
    fastcycle::Param<double> left_noise_mps2;
    fastcycle::Param<double> yaw_rate_noise_radps;
    fastcycle::Param<double> acceleration_bias_mps2;
    fastcycle::Param<double> yaw_rate_bias_radps;
    fastcycle::Param<double> bias_time_s;
  };
  // Factors on the errors of the params.
  struct ErrorSizes {
    double gnss_noise = 1.0;
    double gnss_bias = 1.0;
    double imu_noise = 1.0;
    double imu_bias = 1.0;
  };
  // The slow errors of one run.
  struct Errors {
    GaussMarkov east;
    GaussMarkov north;
    GaussMarkov forward;
    GaussMarkov left;
    GaussMarkov yaw_rate;
  };

  void on_scene(const fastcycle::Sample<world::Scene>& scene);
  void turn_lidar(const world::Scene& after);
  void begin_turn(std::int64_t time_ns);
  void end_turn();
  void publish_position(const world::Scene& scene);
  void publish_motion(const world::Scene& scene, double passed_s);
  [[nodiscard]] static ErrorSizes draw_sizes(double share, std::uint64_t seed);
  [[nodiscard]] double noise(double stddev);

  const LidarConfig lidar_config_;
  GnssParams gnss_;
  ImuParams imu_;
  fastcycle::Param<double> noise_deviation_;
  fastcycle::Param<std::uint64_t> seed_;
  fastcycle::Param<LidarFault> lidar_fault_;
  fastcycle::Param<double> lidar_fault_after_s_;
  fastcycle::Publisher<lidar::Sweep> sweeps_;
  fastcycle::Publisher<gnss::Position> positions_;
  fastcycle::Publisher<motion::Imu> motions_;

  // From `start` on.
  std::mt19937_64 random_;
  std::optional<LidarModel> lidar_;
  std::optional<Errors> errors_;
  ErrorSizes sizes_;

  fastcycle::Sample<world::Scene> before_;
  std::optional<fastcycle::Loan<lidar::Sweep>> sweep_;  // Of the current turn.
  std::int64_t turn_begin_ns_ = 0;
  int next_column_ = 0;
  std::int64_t next_position_ns_ = 0;
  std::int64_t sweep_count_ = 0;
  std::int64_t position_count_ = 0;
  std::int64_t dropped_count_ = 0;
};

}  // namespace ads
