#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "drive_picture.h"
#include "gnss/fix.pb.h"
#include "localization/pose.pb.h"
#include "scoring/score.pb.h"
#include "supervision/status.pb.h"
#include "trace.h"

namespace rav4 {

/// Draws the drive when it has ended.
///
/// In:   `gnss/fix`, `localization/pose`, `scoring/reference`, `scoring/error`,
///       `supervision/status`
/// Out:  the file `file`, at the end
class Picture final : public fastcycle::Component {
 public:
  explicit Picture(fastcycle::Context& context);
  void stop() override;

 private:
  // Enough for an hour at 4 Hz; a longer drive is drawn with fewer points.
  static constexpr std::size_t kPointsMax = 14'400;
  static constexpr std::size_t kSpansMax = 1'000;

  [[nodiscard]] double seconds_at(fastcycle::Time time) const;
  void on_pose(const localization::Pose& pose);
  void on_reference(const scoring::Reference& reference);
  void on_error(const scoring::PositionError& error);
  void on_status(const supervision::Status& status);
  void end_span();

  fastcycle::Param<fastcycle::Path> file_;
  fastcycle::Param<std::string> title_;

  std::int64_t fixes_count_ = 0;
  double distance_m_ = 0.0;
  double last_pose_s_ = 0.0;
  supervision::Judgement judgement_ = supervision::STARTING;
  double span_from_s_ = 0.0;
  std::vector<JudgedSpan> spans_;
  Trace<PlanePoint> reference_{kPointsMax};
  Trace<PlanePoint> estimate_{kPointsMax};
  Trace<ComparedPoint> fixes_{kPointsMax};
  Trace<ComparedPoint> estimates_{kPointsMax};
};

}  // namespace rav4
