#include "dds_gateway/clock_difference.h"

#include <algorithm>

namespace fastcycle::dds_gateway {

Duration ClockDifference::bound_of(const Sample& sample, Time now) {
  const auto drift =
      static_cast<double>(std::max(now - sample.back, Duration(0)).count()) * kDriftMax;
  return sample.round_trip / 2 + Duration(static_cast<Duration::rep>(drift));
}

void ClockDifference::add(const RoundTrip& trip) {
  const Duration there = trip.answered - trip.came;
  const Duration round_trip = trip.back - trip.asked - there;
  if (there < Duration(0) || round_trip < Duration(0)) {
    return;
  }
  const Sample sample{.ahead = ((trip.came - trip.asked) + (trip.answered - trip.back)) / 2,
                      .round_trip = round_trip,
                      .back = trip.back};
  if (const auto known = at(trip.back)) {
    const Duration apart =
        sample.ahead > known->ahead ? sample.ahead - known->ahead : known->ahead - sample.ahead;
    if (apart > known->bound + round_trip / 2) {
      samples_.clear();
    }
  }
  samples_.push_back(sample);
  if (samples_.size() > kKept) {
    samples_.pop_front();
  }
}

std::optional<ClockDifference::Estimate> ClockDifference::at(Time now) const {
  if (samples_.empty()) {
    return {};
  }
  const auto best = std::ranges::min_element(
      samples_, {}, [&](const Sample& sample) { return bound_of(sample, now); });
  return Estimate{
      .ahead = best->ahead, .bound = bound_of(*best, now), .round_trip = best->round_trip};
}

}  // namespace fastcycle::dds_gateway
