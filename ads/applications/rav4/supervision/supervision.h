#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "drive_picture.h"
#include "judge.h"
#include "localization/pose.pb.h"
#include "scoring/score.pb.h"
#include "supervision/status.pb.h"
#include "trace.h"

namespace rav4 {

/// Monitors whether all streams arrive in time and are certain enough, and judges the system. Draws
/// the drive when it has ended.
///
/// In:   `can/frames`, `gnss/fix`, `imu/gyro`, `localization/pose`, `radar/tracks`,
///       `scoring/reference`, `scoring/error`, `vehicle/wheel_speeds`
/// Out:  `supervision/status`, ten times a second; a picture, at the end
class Supervision final : public fastcycle::Component {
 public:
  explicit Supervision(fastcycle::Context& context);
  void stop() override;

 private:
  // Enough for an hour at 4 Hz; a longer drive is drawn with fewer points.
  static constexpr std::size_t kPointsMax = 14'400;

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
  void on_pose(const localization::Pose& pose);
  void on_reference(const scoring::Reference& reference);
  void on_error(const scoring::PositionError& error);
  void judge_now();
  void remember_span();
  [[nodiscard]] std::vector<JudgedSpan> spans_until(fastcycle::Time time) const;
  void draw(const std::vector<JudgedSpan>& spans);

  fastcycle::Param<fastcycle::Path> picture_file_;
  fastcycle::Param<std::string> title_;
  PositionLimits position_limits_;
  fastcycle::Publisher<supervision::Status> statuses_;

  std::vector<StreamWatch> streams_;  // The first one is CAN, the second GNSS.
  std::optional<double> position_stddev_m_;
  Judgement judgement_;
  std::vector<JudgedSpan> spans_;
  double span_from_s_ = 0.0;

  double distance_m_ = 0.0;
  double last_pose_s_ = 0.0;
  Trace<PlanePoint> reference_{kPointsMax};
  Trace<PlanePoint> estimate_{kPointsMax};
  Trace<ComparedPoint> fixes_{kPointsMax};
  Trace<ComparedPoint> estimates_{kPointsMax};
};

}  // namespace rav4
