#pragma once

#include <cstddef>
#include <string>

#include "localization/ego.pb.h"

namespace ads {

/// The limits beyond which an estimate is uncertain, and lost.
struct QualityLimits {
  double fix_uncertain_s = 1.0;
  double fix_lost_s = 10.0;
  double position_uncertain_m = 0.6;
  double position_lost_m = 1.5;
  double heading_uncertain_rad = 0.03;
  double heading_lost_rad = 0.1;
  std::size_t rejected_uncertain = 3;
  std::size_t rejected_lost = 20;
  double input_lost_s = 0.3;
};

/// The inputs of the quality assessment.
struct QualityFacts {
  double since_fix_s = 0.0;  ///< Since the last accepted fix, or the start.
  double position_stddev_m = 0.0;
  double heading_stddev_rad = 0.0;
  std::size_t rejected = 0;  ///< Consecutive rejected fixes.
  double since_vehicle_state_s = 0.0;
  double since_motion_s = 0.0;
};

struct Judgement {
  localization::Quality quality = localization::GOOD;
  std::string reason;  ///< Empty if the quality is good.
};

/// The worst quality that any fact implies, and the first reason for it.
[[nodiscard]] Judgement judge(const QualityLimits& limits, const QualityFacts& facts);

}  // namespace ads
