#include "search.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/scalar.h"
#include "motion_planning_tuning.h"

namespace motion_planning {
namespace {

using ads::outside;
using ads::squared;

constexpr double kLayer_s = 2.0 * kStep_s;
constexpr std::size_t kCells = 1U << 15U;

}  // namespace

Search::Search(const Problem& problem, std::size_t beam)
    : problem_(problem),
      profile_(profile_of(problem)),
      braking_mps2_(problem.halt ? std::max(SpeedProfile::kBraking_mps2, problem.halt->braking_mps2)
                                 : SpeedProfile::kBraking_mps2),
      beam_(beam) {
  layers_ = problem.traffic.steps() / 2;
  start_ = problem.road.locate(problem.start.x_m, problem.start.y_m);
  if (problem.goal) {
    goal_ = problem.road.locate(problem.goal->centre.x_m, problem.goal->centre.y_m);
    if (problem.goal->on_road) {
      goal_.along_m = problem.goal->on_road->middle_m();
    }
  }
  cells_.assign(kCells, -1);
  place_traffic();
}

void Search::place_traffic() {
  const Road& road = problem_.road;
  blocks_.resize(problem_.traffic.steps() + 1);
  for (std::size_t step = 0; step < blocks_.size(); ++step) {
    for (const Occupant& occupant : problem_.traffic.at(step)) {
      const RoadPlace place = road.locate(occupant.x_m, occupant.y_m);
      const double room = kSearch.beyond_edge_m;
      if (place.offset_m > road.left_edge_m(place.along_m) + room ||
          -place.offset_m > road.right_edge_m(place.along_m) + room) {
        continue;
      }
      const double angle = occupant.heading_rad - place.heading_rad;
      const double cosine = std::abs(std::cos(angle));
      const double sine = std::abs(std::sin(angle));
      blocks_[step].push_back(
          {.along_m = place.along_m,
           .half_length_m = occupant.half_length_m * cosine + occupant.half_width_m * sine,
           .offset_m = place.offset_m,
           .half_width_m = occupant.half_length_m * sine + occupant.half_width_m * cosine,
           .spaces = occupant.spaces});
    }
  }
}

double Search::traffic_cost(std::size_t step, double along_m, double offset_m, bool& is_hit) const {
  const double half_length = problem_.vehicle.length_m / 2.0;
  const double half_width = problem_.vehicle.width_m / 2.0;
  double cost = 0.0;
  for (const Block& block : blocks_[step]) {
    const double across = std::abs(offset_m - block.offset_m) - block.half_width_m - half_width;
    if (across >= block.spaces.front().beside_m) {
      continue;
    }
    const double along = std::abs(along_m - block.along_m) - block.half_length_m - half_length;
    if (along >= block.spaces.front().along_m) {
      continue;
    }
    is_hit = is_hit || (along < kSearch.touch_m && across < kSearch.touch_m);
    for (const Occupant::Space& space : block.spaces) {
      const double into_along = space.along_m - along;
      const double into_across = space.beside_m - across;
      if (into_along <= 0.0 || into_across <= 0.0) {
        break;
      }
      cost += 0.5 * space.weight * squared(into_along * into_across) /
              (squared(into_along) + squared(into_across));
    }
  }
  return cost;
}

double Search::goal_offset_m(double along_m) const {
  const auto& stretch = problem_.goal->on_road;
  return stretch ? stretch->offset_m(along_m) : goal_.offset_m;
}

// How far the goal state is missed on the way from one node to the next, at the best time on it.
double Search::goal_miss(const Node& from, const Node& to, double from_s) const {
  const Goal& goal = *problem_.goal;
  const double begin = std::max(from_s, goal.time_s.low);
  const double end = std::min(from_s + kLayer_s, goal.time_s.high);
  if (begin > end) {
    return kSearch.goal_miss_max;
  }
  const double begin_share = (begin - from_s) / kLayer_s;
  const double end_share = (end - from_s) / kLayer_s;
  const double begin_m = from.along_m + begin_share * (to.along_m - from.along_m);
  const double end_m = from.along_m + end_share * (to.along_m - from.along_m);
  const double room = goal.room_along_m();
  const double along = outside(goal_.along_m, begin_m - room, end_m + room);
  const double offset = start_.offset_m + kSearch.offset_m * (to.offset - 0.5 * to.move);
  const double across =
      outside(offset - goal_offset_m(end_m), -kProblem.goal_width_share * goal.half_width_m,
              kProblem.goal_width_share * goal.half_width_m);
  const double speed = outside(to.speed_mps, goal.speed_mps.low, goal.speed_mps.high);
  return kSearch.goal_miss * (std::min(squared(along), kSearch.goal_square + std::abs(along)) +
                              std::min(squared(across), kSearch.goal_square + std::abs(across)) +
                              kSearch.goal_speed * squared(speed));
}

// The least that reaching the goal can cost from here: a linear acceleration profile, and moving
// sideways at the search's pace.
double Search::still_to_come(const Node& node, double time_s) const {
  if (!problem_.goal || time_s >= problem_.goal->time_s.high) {
    return node.goal_cost;
  }
  const Goal& goal = *problem_.goal;
  const double latest = std::max(kLayer_s, goal.time_s.high - time_s);
  const double earliest = std::max(kLayer_s, goal.time_s.low - time_s);
  const double way = goal_.along_m - node.along_m;
  const double beyond = -way - goal.room_along_m();
  if (beyond > 0.0) {  // The vehicle does not reverse.
    return std::min(kSearch.goal_miss * std::min(squared(beyond), kSearch.goal_square + beyond),
                    kSearch.goal_miss_max);
  }
  const double room = goal.on_road ? goal.room_along_m() : 0.0;
  const double late = std::max(0.0, way - room - node.speed_mps * latest);
  const double early = std::max(0.0, node.speed_mps * earliest - way - room);
  // The least integral of a^2 that gains a way of e within T is 3 e^2 / T^3.
  const double effort = late > 0.0 ? 1.5 * squared(late) / (latest * latest * latest)
                                   : 1.5 * squared(early) / (earliest * earliest * earliest);
  const double side =
      std::abs(start_.offset_m + kSearch.offset_m * node.offset - goal_offset_m(goal_.along_m));
  const double unreachable =
      std::max(0.0, side - latest) +
      std::max(0.0, 2.0 * late / squared(latest) - kSearch.reach_speeding_up_mps2) *
          kSearch.unreachable +
      std::max(0.0, 2.0 * early / squared(earliest) - kSearch.reach_braking_mps2) *
          kSearch.unreachable;
  const double estimate = 3.0 * kOptimizer.acceleration * effort +
                          0.5 * kSearch.side_speed * side * side / latest +
                          kSearch.goal_miss * squared(unreachable);
  return std::min(estimate, kSearch.goal_miss_max);
}

double Search::road_cost(const Node& node) const {
  const Road& road = problem_.road;
  const double offset = start_.offset_m + kSearch.offset_m * node.offset;
  double cost =
      0.5 * kOptimizer.lane *
      squared(std::min(kSearch.lane_far_m, std::abs(offset - road.lane_m(node.along_m, offset))));
  const double space = problem_.vehicle.width_m / 2.0 + kSearch.edge_space_m;
  cost += 0.5 * kOptimizer.edge *
          squared(std::max(0.0, offset + space - road.left_edge_m(node.along_m)));
  cost += 0.5 * kOptimizer.edge *
          squared(std::max(0.0, -offset + space - road.right_edge_m(node.along_m)));
  const double lateral = squared(node.speed_mps) * std::abs(road.curvature_per_m(node.along_m));
  cost += 0.5 * kSearch.lateral * squared(std::max(0.0, lateral - kSearch.lateral_mps2));
  return cost;
}

void Search::keep(const Node& node) {
  std::size_t slot = (node.cell * 2654435761U) % kCells;
  while (cells_[slot] >= 0) {
    Node& other = next_[static_cast<std::size_t>(cells_[slot])];
    if (other.cell == node.cell) {
      if (node.promise < other.promise) {
        other = node;
      }
      return;
    }
    slot = (slot + 1) % kCells;
  }
  cells_[slot] = static_cast<std::int32_t>(next_.size());
  next_.push_back(node);
}

// The acceleration over a layer that ends at `end_s`, limited to the permitted speed at its end.
// Above that speed the vehicle brakes comfortably, or harder if `acceleration_mps2` does.
double Search::allowed(const Node& from, double acceleration_mps2, double end_s) const {
  const double speed = std::max(0.0, from.speed_mps + acceleration_mps2 * kLayer_s);
  const double along = from.along_m + kLayer_s * 0.5 * (from.speed_mps + speed);
  const double bound = std::max(0.0, profile_.at(along, end_s).speed_mps);
  if (speed <= bound) {
    return acceleration_mps2;
  }
  const double held = std::max((bound - from.speed_mps) / kLayer_s, -braking_mps2_);
  return std::min(acceleration_mps2, held);
}

void Search::expand(std::size_t layer, const Node& from, std::int32_t index) {
  const double from_s = kLayer_s * static_cast<double>(layer);
  const std::size_t step = 2 * layer;
  bool is_at_bound = false;
  for (const double tried : kSearch.accelerations_mps2) {
    if (is_at_bound) {
      break;  // All that speed up more would be held to the same.
    }
    if (std::abs(tried - from.acceleration_mps2) > kSearch.jerk_max_mps3 * kLayer_s) {
      continue;
    }
    const double acceleration = allowed(from, tried, from_s + kLayer_s);
    is_at_bound = acceleration < tried;
    Node to = from;
    to.parent = index;
    to.acceleration_mps2 = acceleration;
    to.speed_mps = from.speed_mps + acceleration * kLayer_s;
    double driven_s = kLayer_s;
    if (to.speed_mps < 0.0) {
      driven_s = acceleration < 0.0 ? std::max(0.0, -from.speed_mps / acceleration) : 0.0;
      to.speed_mps = 0.0;
      if (acceleration < kSearch.standing_mps2 && from.speed_mps <= 0.0) {
        continue;
      }
    }
    const double way = driven_s * 0.5 * (from.speed_mps + to.speed_mps);
    to.along_m = from.along_m + way;
    const double jerk = (acceleration - from.acceleration_mps2) / kLayer_s;
    const double used =
        driven_s == kLayer_s ? acceleration : (to.speed_mps - from.speed_mps) / kLayer_s;
    double motion =
        0.5 * kLayer_s *
        (kOptimizer.jerk * squared(jerk) * 0.5 + kOptimizer.acceleration * squared(used) +
         kOptimizer.discomfort * squared(outside(used, kOptimizer.comfort_braking_mps2,
                                                 kOptimizer.comfort_speeding_up_mps2)));
    const int stride = way > kSearch.two_offsets_m ? 2 : 1;
    for (int move = -stride; move <= stride; move += stride) {
      if (move != 0 && way < kSearch.one_offset_m) {
        continue;
      }
      ++candidates_;
      to.move = move;
      to.offset = from.offset + move;
      const double offset = start_.offset_m + kSearch.offset_m * to.offset;
      const double middle_offset = offset - 0.5 * kSearch.offset_m * move;
      bool is_hit = false;
      double cost =
          traffic_cost(step + 1, 0.5 * (from.along_m + to.along_m), middle_offset, is_hit) +
          traffic_cost(step + 2, to.along_m, offset, is_hit);
      feasible_ += is_hit ? 0 : 1;
      cost *= 0.5 * kLayer_s;
      cost += motion + kLayer_s * road_cost(to);
      cost += 0.5 * kLayer_s *
              (kSearch.side_speed * squared(kSearch.offset_m * move / kLayer_s) +
               kSearch.side_change * squared(kSearch.offset_m * (move - from.move) / kLayer_s));
      const bool is_before_goal = problem_.goal && from_s < problem_.goal->time_s.high;
      const double error = to.speed_mps - cruise_at(problem_, profile_, to.along_m, is_before_goal);
      cost += 0.5 * kLayer_s * kOptimizer.cruise * cruise_share(error) * squared(error);
      to.cost = from.cost + cost;
      to.goal_cost = from.goal_cost;
      if (problem_.goal) {
        to.goal_cost = std::min(to.goal_cost, goal_miss(from, to, from_s));
      }
      to.promise = to.cost + std::min(to.goal_cost, still_to_come(to, from_s + kLayer_s));
      const auto along_cell =
          static_cast<std::uint32_t>((to.along_m - start_.along_m) / kSearch.along_cell_m);
      const auto speed_cell = static_cast<std::uint32_t>(to.speed_mps / kSearch.speed_cell_mps);
      const auto offset_cell = static_cast<std::uint32_t>(to.offset + 128) & 255U;
      to.cell = (along_cell << 16U) | (speed_cell << 8U) | offset_cell;
      keep(to);
    }
  }
}

Found Search::run() {
  nodes_.clear();
  nodes_.push_back(
      {.along_m = start_.along_m,
       .speed_mps = std::max(0.0, problem_.start.speed_mps),
       // A measured one may lie beyond all that anything can follow; of these, each has a next.
       .acceleration_mps2 =
           std::clamp(problem_.start.acceleration_mps2, kSearch.accelerations_mps2.front(),
                      kSearch.accelerations_mps2.back()),
       .goal_cost = problem_.goal ? kSearch.goal_miss_max : 0.0});
  std::size_t begin = 0;
  for (std::size_t layer = 0; layer < layers_; ++layer) {
    const std::size_t end = nodes_.size();
    next_.clear();
    std::fill(cells_.begin(), cells_.end(), -1);
    for (std::size_t index = begin; index < end; ++index) {
      expand(layer, Node(nodes_[index]), static_cast<std::int32_t>(index));
    }
    const auto is_before = [](const Node& one, const Node& other) {
      return one.promise != other.promise ? one.promise < other.promise : one.cell < other.cell;
    };
    if (next_.size() > beam_) {
      std::nth_element(next_.begin(), next_.begin() + static_cast<std::ptrdiff_t>(beam_),
                       next_.end(), is_before);
      next_.resize(beam_);
    }
    std::sort(next_.begin(), next_.end(), is_before);
    nodes_.insert(nodes_.end(), next_.begin(), next_.end());
    begin = end;
  }
  Found found{.cost = nodes_[begin].promise,
              .reaches_goal = problem_.goal && nodes_[begin].goal_cost < 0.5 * kSearch.goal_miss,
              .candidates = candidates_,
              .feasible = feasible_};
  std::vector<const Node*> way;
  for (std::int32_t index = static_cast<std::int32_t>(begin); index >= 0;
       index = nodes_[static_cast<std::size_t>(index)].parent) {
    way.push_back(&nodes_[static_cast<std::size_t>(index)]);
  }
  std::reverse(way.begin(), way.end());
  for (std::size_t layer = 0; layer + 1 < way.size(); ++layer) {
    const Node& from = *way[layer];
    const Node& to = *way[layer + 1];
    const double middle_m = from.along_m + kLayer_s * (3.0 * from.speed_mps + to.speed_mps) / 8.0;
    found.poses.push_back(
        problem_.road.pose(std::min(middle_m, to.along_m),
                           start_.offset_m + kSearch.offset_m * (to.offset - 0.5 * to.move)));
    found.poses.push_back(
        problem_.road.pose(to.along_m, start_.offset_m + kSearch.offset_m * to.offset));
  }
  return found;
}

}  // namespace motion_planning
