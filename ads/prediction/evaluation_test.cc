// Predictions against what recorded cars did then, with their current states as known exactly.

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/commonroad.h"
#include "predictor.h"

namespace ads {
namespace {

constexpr std::int64_t kBack = 5;  // Steps over which acceleration and turn rate are taken.

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

const ScenarioState* state_at(const Obstacle& obstacle, std::int64_t step) {
  const auto found = std::ranges::find(obstacle.states, step, &ScenarioState::step);
  return found == obstacle.states.end() ? nullptr : &*found;
}

std::vector<Eigen::Vector2d> center_of(const Lanelet& lanelet) {
  std::vector<Eigen::Vector2d> center;
  for (std::size_t index = 0; index < lanelet.left_m.size(); ++index) {
    center.emplace_back((lanelet.left_m[index] + lanelet.right_m[index]) / 2.0);
  }
  return center;
}

void place(const Scenario& scenario, const Eigen::Vector2d& position_m,
           scene::SceneObject& object) {
  for (const auto& [id, lanelet] : scenario.lanelets) {
    if (contains(lanelet.polygon_m(), position_m)) {
      const auto found = Polyline(center_of(lanelet)).project(position_m);
      object.set_lane(id);
      object.set_along_m(found.along_m);
      object.set_offset_m(found.offset_m);
      return;
    }
  }
}

scene::Scene scene_at(const Scenario& scenario, std::int64_t step) {
  scene::Scene scene;
  for (const Obstacle& obstacle : scenario.obstacles) {
    const ScenarioState* const now = state_at(obstacle, step);
    const ScenarioState* const before = state_at(obstacle, step - kBack);
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
    if (before != nullptr) {
      const double span_s = static_cast<double>(kBack) * scenario.step_s;
      seen.set_acceleration_mps2((now->speed_mps - before->speed_mps) / span_s);
      seen.set_yaw_rate_radps(normalize_angle(now->heading_rad - before->heading_rad) / span_s);
    }
    place(scenario, now->position_m, object);
  }
  return scene;
}

double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values.at(static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

// What became of the predictions, at 1, 2 and 3 s.
struct Score {
  std::array<std::vector<double>, 3> best_m;      // Of the most probable hypothesis.
  std::array<std::vector<double>, 3> closest_m;   // Of the closest one.
  std::array<std::vector<double>, 3> straight_m;  // Of going straight on, to compare with.
  std::array<double, 3> within_along{};           // Within two standard deviations.
  std::array<double, 3> within_across{};
  // By tenths of the probability: how many, their sum, and how often it was the closest at 3 s.
  struct Bin {
    double count = 0.0;
    double probability = 0.0;
    double hits = 0.0;
  };
  std::array<Bin, 10> bins{};
};

double error_m(const prediction::Hypothesis& hypothesis, int point,
               const Eigen::Vector2d& truth_m) {
  return (Eigen::Vector2d(hypothesis.points(point).x_m(), hypothesis.points(point).y_m()) - truth_m)
      .norm();
}

void score_one(const prediction::PredictedObject& predicted, const Obstacle& obstacle,
               std::int64_t step, Score& score) {
  const perception::Object& seen = predicted.object().object();
  for (std::size_t second = 0; second < 3; ++second) {
    const int point = 10 * (static_cast<int>(second) + 1);
    const ScenarioState* const truth = state_at(obstacle, step + point);
    if (truth == nullptr) {
      return;
    }
    const auto& best = predicted.hypotheses(0);
    std::vector<double> errors;
    for (const auto& hypothesis : predicted.hypotheses()) {
      errors.push_back(error_m(hypothesis, point, truth->position_m));
    }
    const auto closest = std::ranges::min_element(errors);
    score.best_m[second].push_back(errors.front());
    score.closest_m[second].push_back(*closest);
    const Eigen::Vector2d straight = Eigen::Vector2d(seen.x_m(), seen.y_m()) +
                                     0.1 * point * seen.speed_mps() * direction(seen.heading_rad());
    score.straight_m[second].push_back((straight - truth->position_m).norm());
    const auto& at = best.points(point);
    const Eigen::Vector2d away = truth->position_m - Eigen::Vector2d(at.x_m(), at.y_m());
    const Eigen::Vector2d ahead = direction(at.heading_rad());
    score.within_along[second] += std::abs(away.dot(ahead)) < 2.0 * at.along_stddev_m() ? 1 : 0;
    score.within_across[second] +=
        std::abs(away.dot(left_of(ahead))) < 2.0 * at.across_stddev_m() ? 1 : 0;
    if (second == 2) {
      for (std::size_t index = 0; index < errors.size(); ++index) {
        const double probability = predicted.hypotheses(static_cast<int>(index)).probability();
        Score::Bin& bin =
            score.bins[std::min<std::size_t>(9, static_cast<std::size_t>(10.0 * probability))];
        bin.count += 1.0;
        bin.probability += probability;
        bin.hits += errors.begin() + static_cast<std::ptrdiff_t>(index) == closest ? 1.0 : 0.0;
      }
    }
  }
}

void print(const Score& score) {
  for (std::size_t second = 0; second < 3; ++second) {
    const auto count = static_cast<double>(score.best_m[second].size());
    fmt::print(
        "{} s: {} predictions; error of the most probable p50 {:.2f} m, p95 {:.2f} m; of the "
        "closest {:.2f}, {:.2f}; straight on {:.2f}, {:.2f}; within 2 sigma along {:.0f} %, "
        "across {:.0f} %\n",
        second + 1, count, quantile(score.best_m[second], 0.5),
        quantile(score.best_m[second], 0.95), quantile(score.closest_m[second], 0.5),
        quantile(score.closest_m[second], 0.95), quantile(score.straight_m[second], 0.5),
        quantile(score.straight_m[second], 0.95), 100.0 * score.within_along[second] / count,
        100.0 * score.within_across[second] / count);
  }
  for (const Score::Bin& bin : score.bins) {
    if (bin.count > 0.0) {
      fmt::print("probability {:.2f}: {} hypotheses, the closest one {:.2f}\n",
                 bin.probability / bin.count, bin.count, bin.hits / bin.count);
    }
  }
}

TEST(ManyPredictions, ComeCloseToWhatRecordedCarsDid) {
  const Scenario scenario =
      Scenario::read(std::filesystem::path(ADS_DIR) / "data/commonroad/USA_US101-23_1_T-1.xml");
  Predictor predictor({});
  predictor.use(LanePaths(tile_of(scenario)));
  Score score;
  for (std::int64_t step = kBack; step < 110; step += 5) {
    const scene::Scene scene = scene_at(scenario, step);
    prediction::Predictions predictions;
    predictor.predict(scene, predictions);
    for (const auto& predicted : predictions.objects()) {
      const auto obstacle = std::ranges::find_if(scenario.obstacles, [&](const Obstacle& one) {
        return static_cast<std::uint64_t>(one.id) == predicted.object().object().id();
      });
      score_one(predicted, *obstacle, step, score);
    }
  }
  print(score);

  ASSERT_GT(score.best_m[2].size(), 300U);
  EXPECT_LT(quantile(score.best_m[0], 0.5), 0.5);
  EXPECT_LT(quantile(score.best_m[1], 0.5), 1.2);
  EXPECT_LT(quantile(score.best_m[2], 0.5), 2.2);
  EXPECT_LT(quantile(score.best_m[2], 0.95), 8.0);
  for (std::size_t second = 0; second < 3; ++second) {
    const auto count = static_cast<double>(score.best_m[second].size());
    EXPECT_GT(score.within_along[second] / count, 0.85);
    EXPECT_GT(score.within_across[second] / count, 0.85);
  }
}

}  // namespace
}  // namespace ads
