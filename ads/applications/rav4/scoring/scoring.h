#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <fastcycle/fastcycle.h>

#include "common/geodesy.h"
#include "decode_check.h"
#include "gnss/fix.pb.h"
#include "localization/pose.pb.h"
#include "position_score.h"
#include "scoring/score.pb.h"
#include "vehicle/motion.pb.h"

namespace rav4 {

/// Compares the system's results with the reference that comes with the drive. No other component
/// reads the reference.
///
/// In:   `gnss/fix`, `localization/pose`, `vehicle/steering`, `vehicle/wheel_speeds`
/// Out:  `scoring/reference`, once, at the first fix; `scoring/error`, for each position compared
class Scoring final : public fastcycle::Component {
 public:
  explicit Scoring(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  void report_errors(const std::string& name, const ErrorSum& errors);
  void report_check(const std::string& name, const std::string& unit, const DecodeCheck& check);

  template <typename Measurement>
  [[nodiscard]] fastcycle::Duration offset_of(const Measurement& message) const {
    return fastcycle::Duration(message.header().taken_ns()) - start_time().time_since_epoch();
  }

  void on_fix(const gnss::Fix& fix);
  void on_pose(const localization::Pose& pose);

  // Each pose contains its origin, but the origin does not change.
  const ads::LocalFrame& plane_of(const localization::Pose& pose);
  void on_steering(const vehicle::Steering& steering);
  void on_wheel_speeds(const vehicle::WheelSpeeds& speeds);
  void publish_reference();
  void publish_error(scoring::Kind kind, const Comparison& comparison);

  fastcycle::Param<fastcycle::Path> data_;
  fastcycle::Publisher<scoring::Reference> references_;
  fastcycle::Publisher<scoring::PositionError> errors_;

  std::optional<PositionScore> score_;
  std::optional<DecodeCheck> wheel_check_;
  std::optional<DecodeCheck> steering_check_;
  std::optional<ads::LocalFrame> pose_plane_;
  std::int64_t fixes_ = 0;
};

}  // namespace rav4
