#include "evaluation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include <fmt/format.h>

#include "modules/scene_understanding/lane_map.h"

namespace ads {
namespace {

constexpr std::int64_t kBack = 5;  // Steps over which acceleration and turn rate are taken.
// A state as known exactly still has one: trajectories are recorded to some centimetres.
constexpr double kPositionStddev_m = 0.1;
constexpr std::int64_t kEach = 5;  // Steps from one prediction to the next.

hd_map::Tile tile_of(const Scenario& scenario) {
  hd_map::Tile tile;
  const auto fill = [](const std::vector<Eigen::Vector2d>& points, hd_map::Line& line) {
    for (const Eigen::Vector2d& point : points) {
      line.add_x_m(point.x());
      line.add_y_m(point.y());
    }
  };
  for (const auto& [id, lanelet] : scenario.lanelets) {
    hd_map::Lane& lane = *tile.add_lanes();
    lane.set_id(id);
    fill(lanelet.left_m, *lane.mutable_left());
    fill(lanelet.right_m, *lane.mutable_right());
    for (const std::int64_t next : lanelet.successors) {
      lane.add_successors(next);
    }
    for (const std::int64_t last : lanelet.predecessors) {
      lane.add_predecessors(last);
    }
    if (lanelet.left) {
      lane.set_left_lane(lanelet.left->id);
      lane.set_is_left_same_direction(lanelet.left->is_same_direction);
    }
    if (lanelet.right) {
      lane.set_right_lane(lanelet.right->id);
      lane.set_is_right_same_direction(lanelet.right->is_same_direction);
    }
  }
  return tile;
}

std::string kind_of(const Scenario& scenario) {
  const auto has_type = [&](const char* type) {
    return std::ranges::any_of(scenario.lanelets, [&](const auto& entry) {
      return std::ranges::find(entry.second.types, type) != entry.second.types.end();
    });
  };
  if (has_type("highway") || has_type("interstate") || has_type("accessRamp")) {
    return "highway";
  }
  if (!scenario.intersections.empty()) {
    return "crossing";
  }
  return has_type("urban") ? "town" : "other";
}

const ScenarioState* state_at(const Obstacle& obstacle, std::int64_t step) {
  const auto found = std::ranges::lower_bound(obstacle.states, step, {}, &ScenarioState::step);
  return found == obstacle.states.end() || found->step != step ? nullptr : &*found;
}

/// The road users that have a state at `step`, on the lanes that they were found on before.
scene::Scene scene_at(const Scenario& scenario, const LaneMap& lanes, std::int64_t step,
                      std::map<std::int64_t, std::int64_t>& lane_before) {
  scene::Scene scene;
  for (const Obstacle& obstacle : scenario.obstacles) {
    const ScenarioState* const now =
        obstacle.is_static ? &obstacle.states.front() : state_at(obstacle, step);
    if (now == nullptr) {
      continue;
    }
    scene::SceneObject& object = *scene.add_objects();
    perception::Object& seen = *object.mutable_object();
    seen.set_id(static_cast<std::uint64_t>(obstacle.id));
    seen.set_x_m(now->position_m.x());
    seen.set_y_m(now->position_m.y());
    seen.set_heading_rad(now->heading_rad);
    seen.set_speed_mps(now->speed_mps);
    seen.set_length_m(obstacle.length_m);
    seen.set_width_m(obstacle.width_m);
    seen.set_position_stddev_m(kPositionStddev_m);
    if (const ScenarioState* const before = state_at(obstacle, step - kBack)) {
      const double span_s = static_cast<double>(kBack) * scenario.step_s;
      seen.set_acceleration_mps2((now->speed_mps - before->speed_mps) / span_s);
      seen.set_yaw_rate_radps(normalize_angle(now->heading_rad - before->heading_rad) / span_s);
    }
    std::int64_t& lane = lane_before[obstacle.id];
    const auto place = lanes.match(now->position_m, now->heading_rad, now->speed_mps, lane);
    lane = place ? place->lane : 0;
    if (place) {
      object.set_lane(place->lane);
      object.set_along_m(place->along_m);
      object.set_offset_m(place->offset_m);
    }
  }
  return scene;
}

double error_m(const prediction::Point& point, const ScenarioState& truth) {
  return std::hypot(point.x_m() - truth.position_m.x(), point.y_m() - truth.position_m.y());
}

void score(const prediction::PredictedObject& predicted, const ScenarioState& truth, int ahead_s,
           double step_s, PredictionScores::Ahead& result) {
  const int index = static_cast<int>(std::lround(ahead_s / step_s));
  const prediction::Point& best = predicted.hypotheses(0).points(index);
  double closest_m = error_m(best, truth);
  result.most_probable_m.push_back(closest_m);
  for (const auto& hypothesis : predicted.hypotheses()) {
    closest_m = std::min(closest_m, error_m(hypothesis.points(index), truth));
  }
  result.closest_m.push_back(closest_m);
  const perception::Object& seen = predicted.object().object();
  const Eigen::Vector2d straight = Eigen::Vector2d(seen.x_m(), seen.y_m()) +
                                   ahead_s * seen.speed_mps() * direction(seen.heading_rad());
  result.constant_velocity_m.push_back((straight - truth.position_m).norm());
  const Eigen::Vector2d away = truth.position_m - Eigen::Vector2d(best.x_m(), best.y_m());
  const Eigen::Vector2d along = direction(best.heading_rad());
  result.within_along += std::abs(away.dot(along)) < 2.0 * best.along_stddev_m() ? 1 : 0;
  result.within_across += std::abs(away.dot(left_of(along))) < 2.0 * best.across_stddev_m() ? 1 : 0;
}

}  // namespace

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double quantile_of(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values.at(static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

void PredictionScores::add(const Scenario& scenario, const PredictorOptions& options) {
  const hd_map::Tile tile = tile_of(scenario);
  const LaneMap lanes(tile);
  Predictor predictor(options);
  predictor.use(LanePaths(tile));
  std::map<std::int64_t, const Obstacle*> moving;
  std::int64_t first = 0;
  std::int64_t last = 0;
  for (const Obstacle& obstacle : scenario.obstacles) {
    if (!obstacle.is_static) {
      moving[obstacle.id] = &obstacle;
      first = std::min(first, obstacle.states.front().step);
      last = std::max(last, obstacle.states.back().step);
    }
  }
  OfKind& kind = kinds_[kind_of(scenario)];
  std::map<std::int64_t, std::int64_t> lane_before;
  for (std::int64_t step = first + kBack; step <= last; step += kEach) {
    const scene::Scene scene = scene_at(scenario, lanes, step, lane_before);
    prediction::Predictions predictions;
    predictor.predict(scene, predictions);
    for (const auto& predicted : predictions.objects()) {
      const auto found = moving.find(static_cast<std::int64_t>(predicted.object().object().id()));
      if (found == moving.end()) {
        continue;
      }
      for (std::size_t ahead = 0; ahead < kAhead_s.size(); ++ahead) {
        const auto steps =
            static_cast<std::int64_t>(std::lround(kAhead_s[ahead] / scenario.step_s));
        if (const ScenarioState* const truth = state_at(*found->second, step + steps)) {
          score(predicted, *truth, kAhead_s[ahead], options.step_s, kind[ahead]);
        }
      }
    }
  }
}

std::map<std::string, PredictionScores::OfKind> PredictionScores::by_kind() const {
  std::map<std::string, OfKind> result = kinds_;
  OfKind& all = result["all"];
  for (const auto& [name, kind] : kinds_) {
    for (std::size_t ahead = 0; ahead < kAhead_s.size(); ++ahead) {
      const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
        to.insert(to.end(), from.begin(), from.end());
      };
      append(all[ahead].most_probable_m, kind[ahead].most_probable_m);
      append(all[ahead].closest_m, kind[ahead].closest_m);
      append(all[ahead].constant_velocity_m, kind[ahead].constant_velocity_m);
      all[ahead].within_along += kind[ahead].within_along;
      all[ahead].within_across += kind[ahead].within_across;
    }
  }
  return result;
}

std::string PredictionScores::table() const {
  std::string text =
      "| Road | Ahead | Predictions | Most probable: mean, p50, p95 | Constant velocity | "
      "Closest | Within 2 sigma along, across |\n|---|---|---|---|---|---|---|\n";
  const auto cell = [](const std::vector<double>& errors_m) {
    return fmt::format("{:.2f}, {:.2f}, {:.2f} m", mean_of(errors_m), quantile_of(errors_m, 0.5),
                       quantile_of(errors_m, 0.95));
  };
  for (const auto& [name, kind] : by_kind()) {
    for (std::size_t ahead = 0; ahead < kAhead_s.size(); ++ahead) {
      const Ahead& one = kind[ahead];
      const std::size_t count = one.most_probable_m.size();
      if (count == 0) {
        continue;
      }
      text += fmt::format("| {} | {} s | {} | {} | {} | {} | {} %, {} % |\n", name, kAhead_s[ahead],
                          count, cell(one.most_probable_m), cell(one.constant_velocity_m),
                          cell(one.closest_m), 100 * one.within_along / count,
                          100 * one.within_across / count);
    }
  }
  return text;
}

}  // namespace ads
