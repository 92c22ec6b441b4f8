#include "deviation.h"

#include <random>

#include "common/even.h"

namespace ads {
namespace {

constexpr double kSteeringGain = 0.05;
constexpr double kUndersteerMax_s2_per_m2 = 0.002;
constexpr double kForceGain = 0.15;
constexpr double kResistance_mps2 = 0.3;
constexpr double kAccelerationLagMax_s = 0.2;
constexpr double kSteeringLagMax_s = 0.05;
constexpr double kSpeedGain = 0.02;

}  // namespace

EgoDeviation draw_deviation(double share, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto from_0 = [&](double bound) { return share * bound * even(random); };
  const auto around_0 = [&](double bound) { return from_0(2.0 * bound) - share * bound; };
  EgoDeviation deviation;
  deviation.steering_gain += around_0(kSteeringGain);
  deviation.understeer_s2_per_m2 = from_0(kUndersteerMax_s2_per_m2);
  deviation.force_gain += around_0(kForceGain);
  deviation.resistance_mps2 = around_0(kResistance_mps2);
  deviation.acceleration_lag_s = from_0(kAccelerationLagMax_s);
  deviation.steering_lag_s = from_0(kSteeringLagMax_s);
  deviation.speed_gain += around_0(kSpeedGain);
  return deviation;
}

}  // namespace ads
