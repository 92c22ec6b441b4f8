#pragma once

#include <array>
#include <cstdint>
#include <random>

namespace ads {

/// Normally distributed numbers by table lookup: quantiles of the standard normal distribution at
/// the centres of 4096 equal parts. None is beyond 3.7.
///
/// @threads  Compatible.
class NormalTable {
 public:
  NormalTable();

  /// The number for the low 12 bits; higher ones are ignored.
  [[nodiscard]] float operator()(std::uint64_t bits) const { return quantiles_[bits % kSize]; }

 private:
  static constexpr std::size_t kSize = 4096;

  std::array<float, kSize> quantiles_;
};

/// An error that changes slowly: a first-order Gauss-Markov process (Groves, "Principles of GNSS,
/// Inertial, and Multisensor Integrated Navigation Systems", 2nd edition, 2013, appendix B.4.3).
class GaussMarkov {
 public:
  GaussMarkov(double stddev, double time_s) : stddev_(stddev), time_s_(time_s) {}

  /// The error `passed_s` after the last call; the first call draws one of `stddev`.
  double step(double passed_s, std::mt19937_64& random);

 private:
  double stddev_;
  double time_s_;
  double value_ = 0.0;
  bool has_begun_ = false;
};

}  // namespace ads
