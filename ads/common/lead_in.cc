#include "common/lead_in.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace ads {
namespace {

// A lane in another direction than this is not the vehicle's.
constexpr double kDirection_rad = 0.5;
constexpr double kStep_m = 0.5;
// On so much of its way the vehicle turned from the lane's direction to its own.
constexpr double kTurn_m = 20.0;
// With more than this curvature at the end of the way, its last part is straight instead: the
// wheels would jump with the first step of the scenario, and a plan made before would follow them.
constexpr double kSteered_per_m = 0.08;
constexpr double kStraightShare = 0.2;
constexpr double kTightTurn_m = 10.0;
constexpr std::size_t kLanesMax = 100;

std::optional<Polyline> centre_of(const std::vector<const Lanelet*>& lanelets) {
  std::vector<Eigen::Vector2d> points;
  for (const Lanelet* lanelet : lanelets) {
    for (std::size_t index = 0; index < lanelet->left_m.size(); ++index) {
      points.emplace_back((lanelet->left_m[index] + lanelet->right_m[index]) / 2.0);
    }
  }
  const auto is_other = [&](const Eigen::Vector2d& point) { return point != points.front(); };
  return std::ranges::any_of(points, is_other) ? std::optional<Polyline>(points) : std::nullopt;
}

// Of lanes that overlap, the one in the vehicle's direction.
const Lanelet* lane_at(const Scenario& scenario, const ScenarioState& state) {
  const Lanelet* best = nullptr;
  double least_rad = kDirection_rad;
  for (const auto& [id, lanelet] : scenario.lanelets) {
    const auto centre = centre_of({&lanelet});
    if (!centre || !contains(lanelet.polygon_m(), state.position_m)) {
      continue;
    }
    const double along_m = centre->project(state.position_m).along_m;
    const double slant_rad =
        std::abs(normalize_angle(state.heading_rad - centre->heading_at(along_m)));
    if (slant_rad < least_rad) {
      least_rad = slant_rad;
      best = &lanelet;
    }
  }
  return best;
}

const Lanelet* straightest_before(const Scenario& scenario, const Lanelet& lanelet) {
  const Lanelet* best = nullptr;
  double least_rad = std::numeric_limits<double>::infinity();
  const auto centre = centre_of({&lanelet});
  for (const std::int64_t id : lanelet.predecessors) {
    const Lanelet& before = scenario.lanelets.at(id);
    const auto other = centre_of({&before});
    if (!centre || !other) {
      continue;
    }
    const double turn_rad =
        std::abs(normalize_angle(centre->heading_at(0.0) - other->heading_at(other->length_m())));
    if (turn_rad < least_rad) {
      least_rad = turn_rad;
      best = &before;
    }
  }
  return best;
}

// The centre of the lane and of as many before it as the way needs.
std::optional<Polyline> centre_to(const Scenario& scenario, const ScenarioState& state,
                                  double length_m) {
  const Lanelet* lane = lane_at(scenario, state);
  if (lane == nullptr) {
    return std::nullopt;
  }
  std::vector<const Lanelet*> lanes = {lane};
  double known_m = centre_of(lanes)->project(state.position_m).along_m;
  while (known_m < length_m && lanes.size() < kLanesMax) {
    const Lanelet* before = straightest_before(scenario, *lanes.front());
    if (before == nullptr) {
      break;
    }
    lanes.insert(lanes.begin(), before);
    known_m += centre_of({before})->length_m();
  }
  return centre_of(lanes);
}

}  // namespace

LeadIn::LeadIn(const Scenario& scenario, const ScenarioState& initial, double to_rear_m,
               double length_m)
    : initial_{.center_m = initial.position_m, .heading_rad = normalize_angle(initial.heading_rad)},
      to_rear_m_(to_rear_m) {
  const auto centre = centre_to(scenario, initial, length_m + to_rear_m);
  if (!centre || length_m < kStep_m) {
    return;
  }
  way_ = way_along(*centre, length_m, 0.0);
  if (std::abs(way_->curvature_at(way_->length_m() - kStep_m)) > kSteered_per_m) {
    way_ = way_along(*centre, length_m, kStraightShare * length_m);
  }
}

Polyline LeadIn::way_along(const Polyline& centre, double length_m, double straight_m) const {
  const Eigen::Vector2d forward = direction(initial_.heading_rad);
  const Eigen::Vector2d end = initial_.center_m - to_rear_m_ * forward;
  const double lane_offset_m = centre.project(end).offset_m;
  const Polyline::Projection place = centre.project(end - straight_m * forward);
  const double aside_m = place.offset_m - lane_offset_m;
  const double slant =
      std::tan(normalize_angle(initial_.heading_rad - centre.heading_at(place.along_m)));
  const double turn_m = straight_m > 0.0 ? kTightTurn_m : kTurn_m;
  std::vector<Eigen::Vector2d> points;
  for (double before_m = 0.0; before_m < straight_m; before_m += kStep_m) {
    points.emplace_back(end - before_m * forward);
  }
  points.emplace_back(end - straight_m * forward);
  for (double before_m = kStep_m; before_m < length_m - straight_m + kStep_m; before_m += kStep_m) {
    const double fading = std::max(0.0, 1.0 - before_m / turn_m);
    const double offset_m = lane_offset_m + aside_m * fading - slant * before_m * fading * fading;
    points.push_back(centre.point_at(place.along_m - before_m, offset_m));
  }
  std::ranges::reverse(points);
  return Polyline(points);
}

LeadIn::Pose LeadIn::at(double before_m) const {
  if (before_m <= 0.0) {
    return initial_;
  }
  if (!way_) {
    return {.center_m = initial_.center_m - before_m * direction(initial_.heading_rad),
            .heading_rad = initial_.heading_rad};
  }
  const double along_m = way_->length_m() - before_m;
  const double heading_rad = way_->heading_at(along_m);
  return {.center_m = way_->point_at(along_m) + to_rear_m_ * direction(heading_rad),
          .heading_rad = heading_rad,
          .curvature_per_m = way_->curvature_at(along_m)};
}

}  // namespace ads
