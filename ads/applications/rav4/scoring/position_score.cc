#include "position_score.h"

#include <chrono>

namespace rav4 {
namespace {

using std::chrono_literals::operator""ms;

// How long the last estimate is carried on.
constexpr fastcycle::Duration kCarriedOn = 100ms;

}  // namespace

std::optional<Comparison> PositionScore::on_fix(fastcycle::Duration offset,
                                                const ads::GeodeticPosition& place) {
  if (!plane_) {
    plane_.emplace(place);
    first_fix_ = offset;
  }
  const auto truth = reference_.ecef_at(offset);
  if (!truth) {
    return std::nullopt;
  }
  const Comparison comparison{.offset = offset,
                              .position_m = plane_->enu_from_geodetic(place).head<2>(),
                              .reference_m = plane_->enu_from_ecef(*truth).head<2>()};
  fix_errors_.add(comparison.error_m());
  return comparison;
}

const std::vector<Comparison>& PositionScore::on_motion(const Motion& motion) {
  compared_.clear();
  compare_frames_before(motion.offset);
  last_motion_ = motion;
  return compared_;
}

const std::vector<Comparison>& PositionScore::finish() {
  compared_.clear();
  if (last_motion_) {
    compare_frames_before(last_motion_->offset + kCarriedOn);
  }
  return compared_;
}

void PositionScore::compare_frames_before(fastcycle::Duration end) {
  const auto& frames = reference_.frames();
  for (; plane_ && next_frame_ < frames.size() && frames[next_frame_].offset < end; ++next_frame_) {
    const Reference::Frame& frame = frames[next_frame_];
    if (!last_motion_ || frame.offset < first_fix_ || frame.offset < last_motion_->offset) {
      continue;
    }
    const std::chrono::duration<double> since = frame.offset - last_motion_->offset;
    compared_.push_back(
        {.offset = frame.offset,
         .position_m = last_motion_->position_m + since.count() * last_motion_->velocity_mps,
         .reference_m = plane_->enu_from_ecef(frame.ecef_m).head<2>()});
    estimate_errors_.add(compared_.back().error_m());
  }
}

}  // namespace rav4
