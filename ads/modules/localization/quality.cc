#include "quality.h"

#include <utility>

#include <fmt/format.h>

namespace ads {
namespace {

class Judge {
 public:
  // `limit` of uncertain and of lost; the reason is only made if it is needed.
  template <typename Text>
  void look(double value, double uncertain, double lost, Text text) {
    const auto quality = value > lost        ? localization::LOST
                         : value > uncertain ? localization::UNCERTAIN
                                             : localization::GOOD;
    if (quality > worst_.quality) {
      worst_ = {.quality = quality, .reason = text()};
    }
  }

  [[nodiscard]] Judgement worst() && { return std::move(worst_); }

 private:
  Judgement worst_;
};

}  // namespace

Judgement judge(const QualityLimits& limits, const QualityFacts& facts) {
  Judge judge;
  judge.look(facts.since_motion_s, limits.input_lost_s, limits.input_lost_s,
             [&] { return fmt::format("no imu/motion for {:.1f} s", facts.since_motion_s); });
  judge.look(facts.since_vehicle_state_s, limits.input_lost_s, limits.input_lost_s, [&] {
    return fmt::format("no vehicle/state for {:.1f} s", facts.since_vehicle_state_s);
  });
  judge.look(static_cast<double>(facts.rejected),
             static_cast<double>(limits.rejected_uncertain) - 0.5,
             static_cast<double>(limits.rejected_lost) - 0.5,
             [&] { return fmt::format("{} fixes in a row were rejected", facts.rejected); });
  judge.look(facts.since_fix_s, limits.fix_uncertain_s, limits.fix_lost_s,
             [&] { return fmt::format("no fix was accepted for {:.1f} s", facts.since_fix_s); });
  judge.look(facts.position_stddev_m, limits.position_uncertain_m, limits.position_lost_m, [&] {
    return fmt::format("the position is known to {:.2f} m only", facts.position_stddev_m);
  });
  judge.look(facts.heading_stddev_rad, limits.heading_uncertain_rad, limits.heading_lost_rad, [&] {
    return fmt::format("the heading is known to {:.3f} rad only", facts.heading_stddev_rad);
  });
  return std::move(judge).worst();
}

}  // namespace ads
