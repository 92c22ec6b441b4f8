#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "common/commonroad.h"
#include "predictor.h"

namespace ads {

/// The errors of predictions against the motion of recorded or simulated road users, in metres.
///
/// The inputs are the state of each road user in its scenario, its acceleration and turn rate over
/// the last 0.5 s, and the lane that scene_understanding finds for it. Static obstacles are
/// ignored.
class PredictionScores {
 public:
  static constexpr std::array<int, 4> kAhead_s{1, 2, 3, 5};

  struct Ahead {
    std::vector<double> most_probable_m = {};
    std::vector<double> closest_m = {};            ///< Of all hypotheses.
    std::vector<double> constant_velocity_m = {};  ///< Straight on at constant speed.
    std::size_t within_along = 0;  ///< Of the most probable one: within two standard deviations.
    std::size_t within_across = 0;
  };
  using OfKind = std::array<Ahead, kAhead_s.size()>;

  /// Predicts at every fifth step of `scenario`.
  void add(const Scenario& scenario, const PredictorOptions& options);
  /// By kind of road: "highway", "crossing", "town", "other"; the last is "all".
  [[nodiscard]] std::map<std::string, OfKind> by_kind() const;
  /// A row for each kind of road and prediction time, in Markdown.
  [[nodiscard]] std::string table() const;

 private:
  std::map<std::string, OfKind> kinds_;
};

[[nodiscard]] double mean_of(const std::vector<double>& values);
[[nodiscard]] double quantile_of(std::vector<double> values, double share);

}  // namespace ads
