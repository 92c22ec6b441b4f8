#pragma once

#include <cstddef>
#include <string>

#include "localization/ego.pb.h"

namespace ads {

/// From when on an estimate is uncertain, and lost.
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

/// What the quality is judged by.
struct QualityFacts {
  double since_fix_s = 0.0;  ///< Since the last fix that was accepted, or the begin.
  double position_stddev_m = 0.0;
  double heading_stddev_rad = 0.0;
  std::size_t rejected = 0;  ///< Fixes in a row.
  double since_vehicle_state_s = 0.0;
  double since_motion_s = 0.0;
};

struct Judgement {
  localization::Quality quality = localization::GOOD;
  std::string reason;  ///< Empty if it is good.
};

/// The worst that the facts say, and the first reason for it.
[[nodiscard]] Judgement judge(const QualityLimits& limits, const QualityFacts& facts);

}  // namespace ads
