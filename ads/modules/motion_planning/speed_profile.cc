#include "speed_profile.h"

#include <algorithm>
#include <cmath>

#include "common/scalar.h"
#include "motion_planning_tuning.h"

namespace motion_planning {
namespace {

using ads::kInfinity;

// A lower limit is kept from so far before it on: the road's points are a metre apart, and it may
// begin anywhere between two of them.
constexpr double kEarly_m = Road::kStep_m;

}  // namespace

SpeedProfile::SpeedProfile(const Road& road, const std::vector<SlowStretch>& slow_stretches,
                           const std::optional<Halt>& halt, const State& start)
    : halt_(halt), start_(start) {
  const auto count = static_cast<std::size_t>(road.length_m() / Road::kStep_m) + 1;
  std::vector<Point> points(count, {.square = kInfinity});
  for (std::size_t index = 0; index < count; ++index) {
    const double along = Road::kStep_m * static_cast<double>(index);
    double limit = road.speed_limit_mps(along);
    const double next = road.speed_limit_mps(along + kEarly_m);
    limit = next > 0.0 && (limit <= 0.0 || next < limit) ? next : limit;
    if (limit <= 0.0) {
      continue;
    }
    if (index == 0 || rules_.empty() || rules_.back().speed_mps != limit ||
        !std::isfinite(points[index - 1].square)) {
      rules_.push_back({.kind = RuleKind::kSpeedLimit, .along_m = along, .speed_mps = limit});
    }
    points[index] = {.square = limit * limit, .rule = rules_.size() - 1};
  }
  for (const SlowStretch& stretch : slow_stretches) {
    rules_.push_back(
        {.kind = RuleKind::kHazard, .along_m = stretch.begin_m, .speed_mps = stretch.speed_mps});
    const double square = stretch.speed_mps * stretch.speed_mps;
    for (std::size_t index = 0; index < count; ++index) {
      const double along = Road::kStep_m * static_cast<double>(index);
      if (along > stretch.begin_m - Road::kStep_m && along < stretch.end_m &&
          square < points[index].square) {
        points[index] = {.square = square, .rule = rules_.size() - 1};
      }
    }
  }
  if (rules_.empty()) {
    return;
  }
  for (std::size_t index = count - 1; index > 0; --index) {
    const Point& ahead = points[index];
    const double square = ahead.square + 2.0 * kBraking_mps2 * Road::kStep_m;
    if (square < points[index - 1].square) {
      points[index - 1] = {.square = square, .rule = ahead.rule};
    }
  }
  points_ = std::move(points);
  const double along = road.locate(start.x_m, start.y_m).along_m;
  begins_above_ = start.speed_mps > limit_at(along).speed_mps;
}

SpeedProfile::Bound SpeedProfile::limit_at(double along_m) const {
  if (points_.empty()) {
    return {.speed_mps = kInfinity};
  }
  const double place =
      std::clamp(along_m / Road::kStep_m, 0.0, static_cast<double>(points_.size() - 1));
  const auto index = static_cast<std::size_t>(place);
  const double square = points_[index].square;
  const double next = points_[std::min(index + 1, points_.size() - 1)].square;
  // A higher limit holds from its begin on.
  if (next >= square) {
    return {.speed_mps = std::sqrt(square)};
  }
  const double share = place - static_cast<double>(index);
  const double speed = std::isfinite(square)
                           ? std::sqrt(square + share * (next - square))
                           : std::sqrt(next + 2.0 * kBraking_mps2 * Road::kStep_m * (1.0 - share));
  return {.speed_mps = speed,
          .by_along = -kBraking_mps2 / std::max(kSpeedProfile.steepest_mps, speed)};
}

SpeedProfile::Bound SpeedProfile::halt_at(double along_m) const {
  if (!halt_) {
    return {.speed_mps = kInfinity};
  }
  const double way = halt_->along_m - along_m;
  const double speed = std::sqrt(2.0 * halt_->braking_mps2 * std::max(0.0, way));
  return {.speed_mps = speed,
          .by_along = -halt_->braking_mps2 / std::max(kSpeedProfile.steepest_mps, speed)};
}

// The speed of a vehicle that begins to brake comfortably at the start. A positive initial
// acceleration is ignored: each new plan would continue it.
double SpeedProfile::begun_mps(double time_s) const {
  const double from = std::clamp(start_.acceleration_mps2, -kBraking_mps2, 0.0);
  const double built_up_s = (from + kBraking_mps2) / kJerk_mps3;
  const double first = std::min(time_s, built_up_s);
  return start_.speed_mps + from * first - 0.5 * kJerk_mps3 * first * first -
         kBraking_mps2 * (time_s - first);
}

SpeedProfile::Bound SpeedProfile::at(double along_m, double time_s) const {
  Bound bound = limit_at(along_m);
  if (begins_above_) {
    const double begun = begun_mps(time_s);
    bound = begun > bound.speed_mps ? Bound{.speed_mps = begun} : bound;
  }
  const Bound stop = halt_at(along_m);
  return stop.speed_mps < bound.speed_mps ? stop : bound;
}

double SpeedProfile::wanted_mps(double along_m) const {
  return std::min(limit_at(along_m).speed_mps, halt_at(along_m).speed_mps);
}

std::optional<Rule> SpeedProfile::binding(double along_m, double speed_mps) const {
  const double limit = limit_at(along_m).speed_mps;
  const double stop = halt_at(along_m).speed_mps;
  if (speed_mps < std::min(limit, stop) - kTolerance_mps) {
    return std::nullopt;
  }
  if (stop < limit) {
    return Rule{.kind = halt_->kind, .along_m = halt_->line_m, .object = halt_->object};
  }
  if (!std::isfinite(limit)) {
    return std::nullopt;
  }
  const double place =
      std::clamp(along_m / Road::kStep_m, 0.0, static_cast<double>(points_.size() - 1));
  const auto index = static_cast<std::size_t>(place);
  const Point& here = points_[index];
  const Point& next = points_[std::min(index + 1, points_.size() - 1)];
  return rules_[next.square < here.square ? next.rule : here.rule];
}

}  // namespace motion_planning
