#include "noise.h"

#include <cmath>
#include <numbers>

namespace ads {
namespace {

// Of the standard normal distribution, by bisection.
double quantile(double probability) {
  double low = -8.0;
  double high = 8.0;
  while (high - low > 1e-7) {
    const double middle = 0.5 * (low + high);
    const bool is_below = 0.5 * std::erfc(-middle / std::numbers::sqrt2) < probability;
    (is_below ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

NormalTable::NormalTable() {
  for (std::size_t part = 0; part < kSize / 2; ++part) {
    const double value = quantile((static_cast<double>(part) + 0.5) / kSize);
    quantiles_[part] = static_cast<float>(value);
    quantiles_[kSize - 1 - part] = static_cast<float>(-value);
  }
}

double GaussMarkov::step(double passed_s, std::mt19937_64& random) {
  const double keeps = has_begun_ ? std::exp(-passed_s / time_s_) : 0.0;
  has_begun_ = true;
  std::normal_distribution<double> normal;
  value_ = keeps * value_ + stddev_ * std::sqrt(1.0 - keeps * keeps) * normal(random);
  return value_;
}

}  // namespace ads
