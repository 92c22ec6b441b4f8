#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "judge.h"
#include "localization/pose.pb.h"
#include "supervision/status.pb.h"

namespace rav4 {

/// Monitors whether all streams arrive in time and are certain enough, and judges the system.
///
/// In:   `can/frames`, `gnss/fix`, `imu/gyro`, `localization/pose`, `radar/tracks`,
///       `vehicle/wheel_speeds`
/// Out:  `supervision/status`, ten times a second
class Supervision final : public fastcycle::Component {
 public:
  explicit Supervision(fastcycle::Context& context);
  void stop() override;

 private:
  struct StreamDefaults {
    double rate_hz;
    double age_s;
    bool essential = false;
  };

  static double stddev(fastcycle::Context& context, std::string_view name, double fallback);

  // Counts the messages of a topic, and passes them on.
  template <typename T>
  void watch(fastcycle::Context& context, std::string_view topic, const std::string& name,
             const StreamDefaults& defaults, std::function<void(const T&)> and_then = {});
  [[nodiscard]] double seconds_at(fastcycle::Time time) const;
  void judge_now();
  void count_time();

  PositionLimits position_limits_;
  fastcycle::Publisher<supervision::Status> statuses_;

  std::vector<StreamWatch> streams_;  // The first one is CAN.
  std::optional<double> position_stddev_m_;
  Judgement judgement_;
  std::map<Verdict, double> seconds_in_;
  double counted_until_s_ = 0.0;
};

}  // namespace rav4
