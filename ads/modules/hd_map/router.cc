#include "router.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "common/scalar.h"
#include "hd_map_tuning.h"

namespace ads {
namespace {

constexpr double kAcross_rad = std::numbers::pi / 2.0;

struct Match {
  std::int64_t lane = 0;
  double distance_m = 0.0;
  double slant_rad = 0.0;
};

struct Matches {
  std::vector<Match> lanes = {};
  double nearest_m = kInfinity;  // Of all lanes in the direction, also of those too far away.
};

Matches match(const LaneGraph& graph, const Eigen::Vector2d& place_m,
              const std::optional<double>& heading_rad, const RouteOptions& options) {
  Matches matches;
  for (const auto& [id, node] : graph.nodes()) {
    const double along = node.center.project(place_m).along_m;
    const double slant_rad =
        heading_rad ? std::abs(normalize_angle(*heading_rad - node.center.heading_at(along))) : 0.0;
    if (!node.is_drivable() || slant_rad > kRouter.direction_rad) {
      continue;
    }
    const double distance_m = node.distance_m(place_m, options.beyond_m);
    matches.nearest_m = std::min(matches.nearest_m, distance_m);
    if (distance_m <= options.beside_m) {
      matches.lanes.push_back({.lane = id, .distance_m = distance_m, .slant_rad = slant_rad});
    }
  }
  // Where some contain the place, it is not on those beside them, nor behind the ends of others.
  const auto contains = [&](const Match& found) {
    return graph.node(found.lane).contains(place_m);
  };
  const bool is_on_any = std::ranges::any_of(matches.lanes, contains);
  std::erase_if(matches.lanes, [&](const Match& found) {
    return found.distance_m > matches.nearest_m + 1e-6 || (is_on_any && !contains(found));
  });
  return matches;
}

std::string no_lane(std::string_view what, const Eigen::Vector2d& place_m, double nearest_m) {
  return nearest_m == kInfinity
             ? fmt::format("{} ({:.1f}, {:.1f}): the map has no lane in its direction", what,
                           place_m.x(), place_m.y())
             : fmt::format("{} ({:.1f}, {:.1f}) is {:.1f} m from the nearest lane in its direction",
                           what, place_m.x(), place_m.y(), nearest_m);
}

std::optional<std::int64_t> straightest(const LaneGraph& graph,
                                        const std::vector<std::int64_t>& lanes, double heading_rad,
                                        bool is_next) {
  std::optional<std::int64_t> best;
  double least_rad = kInfinity;
  for (const std::int64_t id : lanes) {
    const Polyline& center = graph.node(id).center;
    const double turn_rad = std::abs(
        normalize_angle(center.heading_at(is_next ? center.length_m() : 0.0) - heading_rad));
    if (graph.node(id).is_drivable() && turn_rad < least_rad) {
      least_rad = turn_rad;
      best = id;
    }
  }
  return best;
}

// The search, from all lanes on which the start is at once.
class Search {
 public:
  Search(const LaneGraph& graph, const Eigen::Vector2d& start_m,
         const std::optional<Eigen::Vector2d>& goal_m, const RouteOptions& options)
      : graph_(graph), start_m_(start_m), goal_m_(goal_m), options_(options) {}

  void begin_at(const Match& match) {
    reach({.lane = match.lane, .has_moved = false}, kRouter.slant_m_per_rad * match.slant_rad, {},
          false);
  }

  template <typename IsGoal>
  std::optional<std::vector<LanePath::Step>> run(const IsGoal& is_goal) {
    while (!open_.empty()) {
      const State state = open_.begin()->second;
      open_.erase(open_.begin());
      if (is_goal(state.lane, state.has_moved)) {
        return way_to(state);
      }
      expand(state);
    }
    return std::nullopt;
  }

 private:
  struct State {
    std::int64_t lane = 0;
    bool has_moved = false;  // Past the end of the lane that it began on.
    auto operator<=>(const State&) const = default;
  };
  struct Arrival {
    double cost_m = kInfinity;
    std::optional<State> from = {};
    bool is_change = false;
  };

  void reach(const State& state, double cost_m, const std::optional<State>& from, bool is_change) {
    Arrival& arrival = arrivals_[state];
    if (cost_m < arrival.cost_m) {
      open_.erase({arrival.cost_m, state});
      arrival = {.cost_m = cost_m, .from = from, .is_change = is_change};
      open_.insert({cost_m, state});
    }
  }

  void expand(const State& state) {
    const LaneGraph::Node& node = graph_.node(state.lane);
    const double cost_m = arrivals_.at(state).cost_m;
    const double length_m = node.center.length_m();
    const double remaining_m =
        state.has_moved
            ? length_m
            : std::max(0.0, length_m - std::max(0.0, node.center.project(start_m_).along_m));
    for (const std::int64_t next : node.lane.successors) {
      if (graph_.node(next).is_drivable()) {
        reach({.lane = next, .has_moved = true}, cost_m + remaining_m, state, false);
      }
    }
    // Of changes that cost the same the earlier one.
    const double room_m = std::max(1.0, remaining_m - behind_goal_m(node));
    const double change_m = options_.lane_change_m *
                            std::max(1.0, options_.change_length_m / room_m) *
                            (1.0 + 1e-6 * cost_m);
    for (const auto& side : {node.lane.left, node.lane.right}) {
      if (side && side->may_change() && graph_.node(side->id).is_drivable()) {
        reach({.lane = side->id, .has_moved = state.has_moved}, cost_m + change_m, state, true);
      }
    }
  }

  // How much of the lane lies behind a goal that is on it or beside it.
  [[nodiscard]] double behind_goal_m(const LaneGraph::Node& node) const {
    if (!goal_m_) {
      return 0.0;
    }
    const Polyline::Projection place = node.center.project(*goal_m_);
    const bool is_beside = place.along_m >= 0.0 && place.along_m <= node.center.length_m() &&
                           std::abs(place.offset_m) < kRouter.beside_m;
    return is_beside ? node.center.length_m() - place.along_m : 0.0;
  }

  std::vector<LanePath::Step> way_to(const State& goal) const {
    std::vector<LanePath::Step> steps;
    for (std::optional<State> state = goal; state; state = arrivals_.at(*state).from) {
      steps.push_back({.lane = state->lane, .is_change = arrivals_.at(*state).is_change});
    }
    std::ranges::reverse(steps);
    return steps;
  }

  const LaneGraph& graph_;
  Eigen::Vector2d start_m_;
  std::optional<Eigen::Vector2d> goal_m_;
  const RouteOptions& options_;
  std::map<State, Arrival> arrivals_;
  std::set<std::pair<double, State>> open_;
};

// The way from the start on whose direction differs least from the vehicle's, on average over its
// first `kRouter.straight_on_m`: what a driver takes who has no other goal. Dijkstra's algorithm:
// the first way that reaches a lane is the only one to go on from it.
class StraightWay {
 public:
  StraightWay(const LaneGraph& graph, const Eigen::Vector2d& start_m, double heading_rad)
      : graph_(graph), start_m_(start_m), heading_rad_(heading_rad) {}

  std::vector<std::int64_t> find(const Matches& starts) {
    for (const Match& match : starts.lanes) {
      extend({}, match.lane, std::max(0.0, start_along_m(match.lane)));
    }
    Way way;
    std::set<std::int64_t> seen;
    while (!open_.empty() && way.length_m < kRouter.straight_on_m) {
      way = std::move(open_.extract(open_.begin()).mapped());
      if (way.length_m < kRouter.straight_on_m && seen.insert(way.lanes.back()).second) {
        go_on_from(way);
      }
    }
    return way.lanes;
  }

  [[nodiscard]] double start_along_m(std::int64_t lane) const {
    return graph_.node(lane).center.project(start_m_).along_m;
  }

 private:
  struct Way {
    std::vector<std::int64_t> lanes = {};
    double length_m = 0.0;
    double cost = 0.0;  // The integral of the difference, rad m.
  };

  void go_on_from(const Way& way) {
    bool has_next = false;
    for (const std::int64_t next : graph_.node(way.lanes.back()).lane.successors) {
      if (graph_.node(next).is_drivable()) {
        extend(way, next, 0.0);
        has_next = true;
      }
    }
    if (!has_next) {
      add({.lanes = way.lanes,
           .length_m = kRouter.straight_on_m,
           .cost = way.cost + kAcross_rad * (kRouter.straight_on_m - way.length_m)});
    }
  }

  void add(Way way) {
    const double cost = way.cost;
    open_.emplace(std::pair(cost, way.lanes), std::move(way));
  }

  void extend(Way way, std::int64_t lane, double from_m) {
    const Polyline& center = graph_.node(lane).center;
    const double to_m = std::min(center.length_m(), from_m + kRouter.straight_on_m - way.length_m);
    for (double along = from_m; along < to_m; along += kRouter.heading_step_m) {
      const double step_m = std::min(kRouter.heading_step_m, to_m - along);
      const double heading = center.heading_at(along + step_m / 2.0);
      way.cost += std::abs(normalize_angle(heading - heading_rad_)) * step_m;
    }
    way.length_m += std::max(0.0, to_m - from_m);
    way.lanes.push_back(lane);
    add(std::move(way));
  }

  const LaneGraph& graph_;
  Eigen::Vector2d start_m_;
  double heading_rad_;
  std::map<std::pair<double, std::vector<std::int64_t>>, Way> open_;
};

LanePath path_anywhere(const LaneGraph& graph, const Eigen::Vector2d& start_m, double heading_rad,
                       const Matches& starts, double length_m) {
  StraightWay straight(graph, start_m, heading_rad);
  LanePath path;
  double way_m = 0.0;
  const auto add = [&](std::int64_t lane) {
    path.steps.push_back({.lane = lane});
    way_m += graph.node(lane).center.length_m();
  };
  std::ranges::for_each(straight.find(starts), add);
  path.start_along_m = straight.start_along_m(path.steps.front().lane);
  way_m -= path.start_along_m;
  for (auto next = straight_on(graph, path.steps.back().lane); next && way_m < length_m;
       next = straight_on(graph, *next)) {
    add(*next);
  }
  path.goal_lanes = {path.steps.back().lane};
  path.goal_along_m = graph.node(path.steps.back().lane).center.length_m();
  return path;
}

}  // namespace

std::optional<std::int64_t> straight_on(const LaneGraph& graph, std::int64_t lane) {
  const LaneGraph::Node& node = graph.node(lane);
  return straightest(graph, node.lane.successors, node.center.heading_at(node.center.length_m()),
                     true);
}

std::optional<std::int64_t> straight_back(const LaneGraph& graph, std::int64_t lane) {
  const LaneGraph::Node& node = graph.node(lane);
  return straightest(graph, node.lane.predecessors, node.center.heading_at(0.0), false);
}

std::variant<LanePath, std::string> find_path(const LaneGraph& graph,
                                              const Eigen::Vector2d& start_m, double heading_rad,
                                              const RouteGoal& goal, const RouteOptions& options) {
  const Matches starts = match(graph, start_m, heading_rad, options);
  if (starts.lanes.empty()) {
    return no_lane("the start", start_m, starts.nearest_m);
  }
  std::vector<std::int64_t> goals;
  if (goal.place_m) {
    const Matches found = match(graph, *goal.place_m, goal.heading_rad, options);
    if (found.lanes.empty()) {
      return no_lane("the goal", *goal.place_m, found.nearest_m);
    }
    for (const Match& match : found.lanes) {
      goals.push_back(match.lane);
    }
  } else if (goal.lanes.empty()) {
    return path_anywhere(graph, start_m, heading_rad, starts, options.anywhere_m);
  } else {
    std::ranges::copy_if(goal.lanes, std::back_inserter(goals),
                         [&](std::int64_t id) { return graph.nodes().contains(id); });
    if (goals.empty()) {
      return fmt::format("none of the goal's lanes {} is in the map", fmt::join(goal.lanes, ", "));
    }
  }

  Search search(graph, start_m, goal.place_m, options);
  for (const Match& start : starts.lanes) {
    search.begin_at(start);
  }
  const auto steps = search.run([&](std::int64_t lane, bool has_moved) {
    if (std::ranges::find(goals, lane) == goals.end()) {
      return false;
    }
    const Polyline& center = graph.node(lane).center;
    return has_moved || !goal.place_m ||
           center.project(*goal.place_m).along_m >
               center.project(start_m).along_m - kRouter.passed_m;
  });
  if (!steps) {
    return fmt::format("no way leads from lane {} to lane {}", starts.lanes.front().lane,
                       fmt::join(goals, ", "));
  }
  const Polyline& last = graph.node(steps->back().lane).center;
  return LanePath{
      .steps = *steps,
      .start_along_m = graph.node(steps->front().lane).center.project(start_m).along_m,
      .goal_along_m = goal.place_m ? last.project(*goal.place_m).along_m : last.length_m(),
      .goal_lanes = goals};
}

}  // namespace ads
