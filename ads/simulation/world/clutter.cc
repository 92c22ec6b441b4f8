#include "clutter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "common/even.h"

namespace ads {
namespace {

// Where nothing stands, this is the way from one to the next.
constexpr double kMeanDistance_m = 12.0;
constexpr double kOutsideMin_m = 0.8;
constexpr double kOutsideMax_m = 5.0;

struct Bounds {
  double low = 0.0;
  double high = 0.0;
};

struct Kind {
  double share;
  Bounds length_m;
  Bounds width_m;
  Bounds height_m;
};
// Lamps and signs; bushes and hedges; walls and fences.
constexpr std::array kKinds = {
    Kind{0.4, {0.15, 0.3}, {0.15, 0.3}, {2.5, 8.0}},
    Kind{0.35, {0.8, 2.5}, {0.8, 1.6}, {0.6, 1.8}},
    Kind{0.25, {4.0, 12.0}, {0.2, 0.4}, {0.8, 2.5}},
};

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}

  double within(const Bounds& bounds) {
    return bounds.low + (bounds.high - bounds.low) * even(random_);
  }
  const Kind& kind() {
    double left = within({0.0, 1.0});
    for (const Kind& kind : kKinds) {
      left -= kind.share;
      if (left < 0.0) {
        return kind;
      }
    }
    return kKinds.back();
  }

 private:
  std::mt19937_64 random_;
};

bool is_free_of(const std::vector<Eigen::Vector2d>& edge_m, const Box& box) {
  // Its outline in steps that are shorter than a lane is wide.
  const auto corners = box.corners();
  for (std::size_t side = 0; side < corners.size(); ++side) {
    const Eigen::Vector2d& from = corners[side];
    const Eigen::Vector2d& to = corners[(side + 1) % corners.size()];
    const double steps = std::ceil((to - from).norm());
    for (double step = 0.0; step < steps; step += 1.0) {
      const Eigen::Vector2d place = from + (step / steps) * (to - from);
      if (contains(edge_m, place)) {
        return false;
      }
      for (std::size_t index = 0; index < edge_m.size(); ++index) {
        if (distance_m(place, edge_m[index], edge_m[(index + 1) % edge_m.size()]) <
            kClutterSpace_m) {
          return false;
        }
      }
    }
  }
  return true;
}

bool is_free_of(const Obstacle& obstacle, const Box& box) {
  return std::ranges::all_of(obstacle.states, [&](const ScenarioState& state) {
    const Box its{.center_m = state.position_m,
                  .heading_rad = state.heading_rad,
                  .length_m = obstacle.length_m,
                  .width_m = obstacle.width_m};
    return distance_m(its, box) >= kClutterSpace_m;
  });
}

struct Edge {
  Eigen::Vector2d low_m;
  Eigen::Vector2d high_m;
  std::vector<Eigen::Vector2d> polygon_m;
};

std::vector<Edge> edges_of(const Scenario& scenario) {
  std::vector<Edge> edges;
  for (const auto& [id, lanelet] : scenario.lanelets) {
    Edge edge{.low_m = {}, .high_m = {}, .polygon_m = lanelet.polygon_m()};
    if (edge.polygon_m.empty()) {
      continue;
    }
    edge.low_m = edge.high_m = edge.polygon_m.front();
    for (const Eigen::Vector2d& point : edge.polygon_m) {
      edge.low_m = edge.low_m.cwiseMin(point);
      edge.high_m = edge.high_m.cwiseMax(point);
    }
    edges.push_back(std::move(edge));
  }
  return edges;
}

bool is_free(const Scenario& scenario, const std::vector<Edge>& edges, const Box& box) {
  const double reach = 0.5 * std::hypot(box.length_m, box.width_m) + kClutterSpace_m;
  for (const Edge& edge : edges) {
    const bool is_near = (box.center_m.array() > edge.low_m.array() - reach).all() &&
                         (box.center_m.array() < edge.high_m.array() + reach).all();
    if (is_near && !is_free_of(edge.polygon_m, box)) {
      return false;
    }
  }
  return std::ranges::all_of(scenario.obstacles,
                             [&](const Obstacle& obstacle) { return is_free_of(obstacle, box); });
}

}  // namespace

std::vector<Body> draw_clutter(const Scenario& scenario, double share, std::uint64_t seed) {
  std::vector<Body> clutter;
  if (!(share > 0.0)) {
    return clutter;
  }
  Draw draw(seed);
  const std::vector<Edge> edges = edges_of(scenario);
  const auto line = [&](const std::vector<Eigen::Vector2d>& bound_m, double outwards) {
    if (bound_m.size() < 2 || (bound_m.back() - bound_m.front()).norm() < 1.0) {
      return;
    }
    const Polyline edge(bound_m);
    const Bounds step{0.0, 2.0 * kMeanDistance_m / share};
    for (double along = draw.within(step); along < edge.length_m(); along += draw.within(step)) {
      const Kind& kind = draw.kind();
      Body body{.id = -1 - static_cast<std::int64_t>(clutter.size()),
                .box = {.center_m = {},
                        .heading_rad = edge.heading_at(along),
                        .length_m = draw.within(kind.length_m),
                        .width_m = draw.within(kind.width_m)},
                .height_m = draw.within(kind.height_m)};
      const double outside = draw.within({kOutsideMin_m, kOutsideMax_m}) + 0.5 * body.box.width_m;
      body.box.center_m = edge.point_at(along, outwards * outside);
      if (is_free(scenario, edges, body.box)) {
        clutter.push_back(body);
      }
    }
  };
  for (const auto& [id, lanelet] : scenario.lanelets) {
    if (!lanelet.left) {
      line(lanelet.left_m, 1.0);
    }
    if (!lanelet.right) {
      line(lanelet.right_m, -1.0);
    }
  }
  return clutter;
}

}  // namespace ads
