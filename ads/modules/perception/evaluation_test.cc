// Sweeps of recorded traffic, and how well the objects in it are recognized. One of the recorded
// cars carries the sensor, and it knows exactly where it is.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/commonroad.h"
#include "common/plane.h"
#include "lidar_model.h"
#include "recognizer.h"

namespace ads {
namespace {

constexpr double kRange_m = 40.0;
constexpr int kReturnsVisible = 20;
constexpr double kMatch_m = 2.5;
constexpr double kTrackedLong_s = 1.0;
constexpr double kSweep_s = 0.1;

struct Truth {
  std::int64_t id = 0;
  Box box;
  double speed_mps = 0.0;
};

// Where an obstacle is at a step, linear between its states.
std::optional<Truth> truth_at(const Obstacle& obstacle, double step) {
  const auto& states = obstacle.states;
  const auto after = std::ranges::find_if(
      states, [&](const ScenarioState& state) { return static_cast<double>(state.step) >= step; });
  if (after == states.end() ||
      (after == states.begin() && static_cast<double>(after->step) > step)) {
    return std::nullopt;
  }
  const ScenarioState& to = *after;
  const ScenarioState& from = after == states.begin() ? to : *(after - 1);
  const auto length = static_cast<double>(to.step - from.step);
  const double share = length > 0.0 ? (step - static_cast<double>(from.step)) / length : 0.0;
  return Truth{.id = obstacle.id,
               .box = {.center_m = from.position_m + share * (to.position_m - from.position_m),
                       .heading_rad = from.heading_rad +
                                      share * normalize_angle(to.heading_rad - from.heading_rad),
                       .length_m = obstacle.length_m,
                       .width_m = obstacle.width_m},
               .speed_mps = from.speed_mps + share * (to.speed_mps - from.speed_mps)};
}

double quantile(std::vector<double>& values, double share) {
  if (values.empty()) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  std::ranges::sort(values);
  const auto index = static_cast<std::size_t>(share * static_cast<double>(values.size()));
  return values[std::min(index, values.size() - 1)];
}

struct Score {
  std::size_t visible = 0;
  std::size_t found = 0;
  std::size_t boxes = 0;
  std::size_t false_boxes = 0;  // Of those that the last sweep has seen.
  std::size_t switches = 0;
  std::vector<double> center_m;
  std::vector<double> near_edge_m;  // Along its heading, of the end that faces the sensor.
  std::vector<double> across_m;
  std::vector<double> heading_deg;
  std::vector<double> speed_mps;

  [[nodiscard]] double recall() const {
    return static_cast<double>(found) / static_cast<double>(visible);
  }

  void print(const std::string& name) {
    fmt::print("{}: {} visible, recall {:.4f}, {} boxes, {} false, {} switches of id\n", name,
               visible, recall(), boxes, false_boxes, switches);
    for (auto [what, values] :
         {std::pair("centre, m", &center_m), std::pair("near edge, m", &near_edge_m),
          std::pair("across, m", &across_m), std::pair("heading, deg", &heading_deg),
          std::pair("speed, m/s", &speed_mps)}) {
      fmt::print("  {:14} p50 {:.3f}  p95 {:.3f}  p99 {:.3f}\n", what, quantile(*values, 0.5),
                 quantile(*values, 0.95), quantile(*values, 0.99));
    }
  }
};

class Evaluation {
 public:
  Evaluation(const Scenario& scenario, const LidarConfig& lidar)
      : scenario_(scenario), lidar_(lidar, 1), bytes_(lidar_.sweep_bytes(), '\0') {
    ego_ = &*std::ranges::max_element(
        scenario.obstacles, {}, [](const Obstacle& obstacle) { return obstacle.states.size(); });
  }

  Score run() {
    const double begin_s = static_cast<double>(ego_->states.front().step) * scenario_.step_s;
    const double end_s = static_cast<double>(ego_->states.back().step) * scenario_.step_s;
    const auto sweeps = static_cast<int>(std::floor((end_s - begin_s) / kSweep_s + 1e-6));
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      turn(begin_s + sweep * kSweep_s);
    }
    return score_;
  }

 private:
  static constexpr int kParts = 10;

  world::Scene scene_at(double time_s) const {
    world::Scene scene;
    scene.mutable_header()->set_taken_ns(time_ns(time_s));
    for (const Obstacle& obstacle : scenario_.obstacles) {
      if (const auto truth = truth_at(obstacle, time_s / scenario_.step_s)) {
        auto& body = &obstacle == ego_ ? *scene.mutable_ego() : *scene.add_bodies();
        body.set_id(truth->id);
        body.set_x_m(truth->box.center_m.x());
        body.set_y_m(truth->box.center_m.y());
        body.set_heading_rad(truth->box.heading_rad);
        body.set_length_m(truth->box.length_m);
        body.set_width_m(truth->box.width_m);
        body.set_height_m(truth->box.length_m > 7.0 ? 3.2 : 1.5);
        body.set_speed_mps(truth->speed_mps);
      }
    }
    return scene;
  }

  static std::int64_t time_ns(double time_s) {
    return 1'000'000'000'000'000'000 + static_cast<std::int64_t>(std::llround(time_s * 1e9));
  }

  void add_pose(const world::Scene& scene) {
    motion_.add({.time_ns = scene.header().taken_ns(),
                 .position_m = {scene.ego().x_m(), scene.ego().y_m()},
                 .heading_rad = scene.ego().heading_rad(),
                 .speed_mps = scene.ego().speed_mps()});
  }

  void turn(double begin_s) {
    world::Scene before = scene_at(begin_s);
    for (int part = 0; part < kParts; ++part) {
      const world::Scene after = scene_at(begin_s + kSweep_s * (part + 1) / kParts);
      add_pose(before);
      add_pose(after);
      const int columns = lidar_.config().columns;
      lidar_.cast(before, after, time_ns(begin_s), columns * part / kParts,
                  columns * (part + 1) / kParts, bytes_);
      before = after;
    }
    const SweepResult result =
        recognizer_.take({.taken_ns = time_ns(begin_s),
                          .duration_ns = lidar_.config().turn_ns,
                          .columns = static_cast<std::uint32_t>(lidar_.config().columns),
                          .rings = static_cast<std::uint32_t>(lidar_.config().rings),
                          .points = bytes_,
                          .mount_forward_m = lidar_.config().mount_forward_m,
                          .mount_height_m = lidar_.config().mount_height_m},
                         motion_);
    ASSERT_EQ(result.reason, "");
    judge(begin_s + kSweep_s);
  }

  // How many returns of the sweep are on each body.
  std::map<std::int64_t, int> count_returns(double end_s) const {
    std::map<std::int64_t, int> counts;
    std::array<std::vector<Truth>, 2 * kParts> truths;
    std::array<Truth, 2 * kParts> egos;
    for (std::size_t slot = 0; slot < truths.size(); ++slot) {
      const double time_s =
          end_s - kSweep_s * (1.0 - (static_cast<double>(slot) + 0.5) / (2 * kParts));
      for (const Obstacle& obstacle : scenario_.obstacles) {
        if (const auto truth = truth_at(obstacle, time_s / scenario_.step_s)) {
          if (&obstacle == ego_) {
            egos[slot] = *truth;
          } else {
            truths[slot].push_back(*truth);
          }
        }
      }
    }
    for (std::size_t offset = 0; offset < bytes_.size(); offset += sizeof(SweepPoint)) {
      SweepPoint point;
      std::memcpy(&point, bytes_.data() + offset, sizeof point);
      if (point.intensity < 100) {
        continue;  // The ground, or nothing.
      }
      const std::size_t slot = static_cast<std::size_t>(point.time) * 2 * kParts / 65536;
      const Eigen::Vector2d ahead = direction(egos[slot].box.heading_rad);
      const Eigen::Vector2d place = egos[slot].box.center_m +
                                    static_cast<double>(point.x_m) * ahead +
                                    static_cast<double>(point.y_m) * left_of(ahead);
      for (const Truth& truth : truths[slot]) {
        Box box = truth.box;
        box.length_m += 0.3;
        box.width_m += 0.3;
        if (box.contains(place)) {
          ++counts[truth.id];
          break;
        }
      }
    }
    return counts;
  }

  void judge(double end_s) {
    const auto returns = count_returns(end_s);
    const Truth ego = *truth_at(*ego_, end_s / scenario_.step_s);
    std::vector<Truth> truths;
    for (const Obstacle& obstacle : scenario_.obstacles) {
      const auto truth = truth_at(obstacle, end_s / scenario_.step_s);
      if (truth && &obstacle != ego_) {
        truths.push_back(*truth);
      }
    }
    std::vector<std::pair<const TrackedObject*, Track>> objects;
    for (const TrackedObject& object : recognizer_.objects()) {
      if (object.is_confirmed) {
        objects.emplace_back(&object, object.track);
        objects.back().second.predict(time_ns(end_s));
      }
    }
    std::vector<int> object_of(truths.size(), -1);
    std::vector<int> truth_of(objects.size(), -1);
    std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
    for (std::size_t truth = 0; truth < truths.size(); ++truth) {
      for (std::size_t object = 0; object < objects.size(); ++object) {
        const double apart =
            (objects[object].second.center_m() - truths[truth].box.center_m).norm();
        if (apart < kMatch_m) {
          pairs.emplace_back(apart, truth, object);
        }
      }
    }
    std::ranges::sort(pairs);
    for (const auto& [apart, truth, object] : pairs) {
      if (object_of[truth] < 0 && truth_of[object] < 0) {
        object_of[truth] = static_cast<int>(object);
        truth_of[object] = static_cast<int>(truth);
      }
    }
    for (std::size_t index = 0; index < truths.size(); ++index) {
      const Truth& truth = truths[index];
      const auto found = returns.find(truth.id);
      const bool is_visible = found != returns.end() && found->second >= kReturnsVisible;
      int& sweeps = visible_sweeps_[truth.id];
      sweeps = is_visible ? sweeps + 1 : 0;
      // An object is reported when it was seen three times.
      if (sweeps <= 3 || (truth.box.center_m - ego.box.center_m).norm() > kRange_m) {
        continue;
      }
      ++score_.visible;
      if (object_of[index] >= 0) {
        ++score_.found;
        const auto& [object, track] = objects[static_cast<std::size_t>(object_of[index])];
        judge(truth, object->id, track, ego, end_s);
      }
    }
    for (std::size_t index = 0; index < objects.size(); ++index) {
      const auto& [object, track] = objects[index];
      if (object->missed == 0 && (track.center_m() - ego.box.center_m).norm() < kRange_m) {
        ++score_.boxes;
        score_.false_boxes += truth_of[index] < 0 ? 1 : 0;
      }
    }
  }

  void judge(const Truth& truth, std::uint64_t id, const Track& track, const Truth& ego,
             double end_s) {
    const auto known = id_of_.find(truth.id);
    score_.switches += known != id_of_.end() && known->second != id ? 1 : 0;
    id_of_[truth.id] = id;
    const double begin_s = begin_of_.emplace(id, end_s).first->second;
    if (end_s - begin_s < kTrackedLong_s) {
      return;
    }
    const Eigen::Vector2d ahead = direction(truth.box.heading_rad);
    const Eigen::Vector2d off = track.center_m() - truth.box.center_m;
    const double end = (ego.box.center_m - truth.box.center_m).dot(ahead) > 0.0 ? 0.5 : -0.5;
    score_.center_m.push_back(off.norm());
    score_.near_edge_m.push_back(
        std::abs(off.dot(ahead) + end * (track.length_m() - truth.box.length_m)));
    score_.across_m.push_back(std::abs(off.dot(left_of(ahead))));
    score_.heading_deg.push_back(
        std::abs(normalize_angle(track.heading_rad() - truth.box.heading_rad)) * 57.29578);
    score_.speed_mps.push_back(std::abs(track.speed_mps() - truth.speed_mps));
  }

  const Scenario& scenario_;
  const Obstacle* ego_;
  LidarModel lidar_;
  std::string bytes_;
  EgoMotion motion_;
  Recognizer recognizer_{RecognizerConfig{}};
  std::map<std::int64_t, int> visible_sweeps_;
  std::map<std::int64_t, std::uint64_t> id_of_;
  std::map<std::uint64_t, double> begin_of_;
  Score score_;
};

Score score_of(const std::string& name, const LidarConfig& lidar = {}) {
  const Scenario scenario =
      Scenario::read(std::string(ADS_DIR) + "/data/commonroad/" + name + ".xml");
  Score score = Evaluation(scenario, lidar).run();
  score.print(name);
  return score;
}

void expect_good(Score score) {
  EXPECT_GT(score.recall(), 0.97);
  EXPECT_LT(static_cast<double>(score.false_boxes), 0.02 * static_cast<double>(score.boxes));
  EXPECT_LT(quantile(score.center_m, 0.5), 0.15);
  EXPECT_LT(quantile(score.center_m, 0.95), 0.5);
  EXPECT_LT(quantile(score.near_edge_m, 0.95), 0.25);
  EXPECT_LT(quantile(score.across_m, 0.95), 0.25);
  EXPECT_LT(quantile(score.heading_deg, 0.95), 6.0);
  EXPECT_LT(quantile(score.speed_mps, 0.95), 1.2);
}

TEST(ManyRecordedCars, AreFoundInFlowingTraffic) {
  expect_good(score_of("USA_US101-23_1_T-1"));
}

TEST(ManyRecordedCars, AreFoundInAJam) {
  expect_good(score_of("USA_US101-4_1_T-1"));
}

TEST(ManyRecordedCars, AreFoundWithATenthOfTheBeamsMissing) {
  expect_good(score_of("USA_US101-3_1_T-1", {.beam_dropout = 0.1}));
}

}  // namespace
}  // namespace ads
