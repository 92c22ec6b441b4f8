#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "lidar/sweep.pb.h"
#include "localization/ego.pb.h"
#include "scan_matcher.h"

namespace odometry {

/// Estimates the motion of a vehicle from its lidar alone.
///
/// In:   `lidar/points`
/// Out:  `localization/ego`, at the end of each sweep; `odometry/points`, the sweeps after it
class Odometry final : public fastcycle::Component {
 public:
  explicit Odometry(fastcycle::Context& context);
  void stop() override;

 private:
  void on_sweep(const fastcycle::Sample<lidar::Sweep>& sweep);
  [[nodiscard]] bool read(const lidar::Sweep& sweep);
  void publish_ego(const lidar::Sweep& sweep);

  const Pose begin_;
  ScanMatcher matcher_;
  fastcycle::Publisher<localization::Ego> ego_;
  fastcycle::Publisher<lidar::Sweep> sweeps_;

  std::vector<TimedPoint> points_;
  std::optional<std::int64_t> last_ns_;
  std::int64_t sweep_count_ = 0;
  std::int64_t invalid_count_ = 0;
  double way_m_ = 0.0;
  double residual_sum_m_ = 0.0;
};

}  // namespace odometry
