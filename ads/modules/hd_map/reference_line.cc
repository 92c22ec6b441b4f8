#include "reference_line.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "hd_map_tuning.h"

namespace ads {
namespace {

// From 0 to 1 with no slope and no curvature at both ends.
double blend(double share) {
  return share * share * share * (10.0 + share * (-15.0 + 6.0 * share));
}

// Points along lanes, with the lane at each.
class Trail {
 public:
  explicit Trail(const LaneGraph& graph) : graph_(graph) {}

  [[nodiscard]] const std::vector<Eigen::Vector2d>& points_m() const { return points_m_; }
  [[nodiscard]] const std::vector<std::int64_t>& lanes() const { return lanes_; }

  void follow(std::int64_t lane, double from_m, double to_m) {
    const Polyline& center = graph_.node(lane).center;
    for (double along = from_m; along < to_m; along += kReferenceLine.step_m) {
      add(center.point_at(along), center.heading_at(along), lane);
    }
    add(center.point_at(to_m), center.heading_at(to_m), lane);
  }

  // Goes over from `from` to `to`; returns where on `to` it arrives.
  double change(std::int64_t from, std::int64_t to, double from_m, double length_m) {
    const Polyline& begin = graph_.node(from).center;
    const Polyline& end = graph_.node(to).center;
    const auto steps = static_cast<int>(std::max(1.0, std::ceil(length_m / kReferenceLine.step_m)));
    for (int step = 0; step <= steps; ++step) {
      const double share = static_cast<double>(step) / steps;
      const double along = from_m + share * length_m;
      const Eigen::Vector2d at_begin = begin.point_at(along);
      const Eigen::Vector2d at_end = end.point_at(end.project(at_begin).along_m);
      add(at_begin + blend(share) * (at_end - at_begin), begin.heading_at(along),
          share < 0.5 ? from : to);
    }
    return end.project(begin.point_at(from_m + length_m)).along_m;
  }

 private:
  void add(const Eigen::Vector2d& point_m, double heading_rad, std::int64_t lane) {
    if (points_m_.empty() ||
        (point_m - points_m_.back()).dot(direction(heading_rad)) > kReferenceLine.forward_m) {
      points_m_.push_back(point_m);
      lanes_.push_back(lane);
    }
  }

  const LaneGraph& graph_;
  std::vector<Eigen::Vector2d> points_m_;
  std::vector<std::int64_t> lanes_;
};

// Along lanes before the place `along_m` of `lane`, and straight where there are no more.
void lead_in(Trail& trail, const LaneGraph& graph, std::int64_t lane, double along_m,
             double length_m) {
  std::vector<std::int64_t> before;
  double missing_m = length_m - along_m;
  std::int64_t first = lane;
  while (missing_m > 0.0) {
    const auto previous = straight_back(graph, first);
    if (!previous) {
      break;
    }
    first = *previous;
    before.push_back(first);
    missing_m -= graph.node(first).center.length_m();
  }
  if (before.empty()) {
    trail.follow(lane, along_m - length_m, along_m);
    return;
  }
  for (auto previous = before.rbegin(); previous != before.rend(); ++previous) {
    trail.follow(*previous, previous == before.rbegin() ? -missing_m : 0.0,
                 graph.node(*previous).center.length_m());
  }
  trail.follow(lane, 0.0, along_m);
}

void lead_out(Trail& trail, const LaneGraph& graph, std::int64_t lane, double along_m,
              double length_m) {
  const double end_m = along_m + length_m;
  auto next = straight_on(graph, lane);
  double last_m = graph.node(lane).center.length_m();
  if (!next || last_m >= end_m) {
    trail.follow(lane, along_m, end_m);
    return;
  }
  trail.follow(lane, along_m, last_m);
  double missing_m = end_m - last_m;
  while (next && missing_m > 0.0) {
    const std::int64_t current = *next;
    next = straight_on(graph, current);
    last_m = graph.node(current).center.length_m();
    trail.follow(current, 0.0, next ? std::min(last_m, missing_m) : missing_m);
    missing_m -= last_m;
  }
}

// Changes of lane that follow each other share the road up to `end_m` on the first of those lanes.
double follow_changes(Trail& trail, const LaneGraph& graph, const LanePath& path, std::size_t first,
                      std::size_t last, double along_m, double length_m) {
  const Polyline& center = graph.node(path.steps[first].lane).center;
  const bool is_at_goal = last + 1 == path.steps.size();
  const double goal_m =
      center.project(graph.node(path.steps[last].lane).center.point_at(path.goal_along_m)).along_m;
  const double end_m = is_at_goal ? goal_m : center.length_m();
  const auto changes = static_cast<double>(last - first);
  const double one_m =
      std::clamp((end_m - along_m) / changes, 2.0 * kReferenceLine.step_m, length_m);
  for (std::size_t step = first; step < last; ++step) {
    along_m = trail.change(path.steps[step].lane, path.steps[step + 1].lane, along_m, one_m);
  }
  return along_m;
}

Trail trail_of(const LaneGraph& graph, const LanePath& path, const ReferenceOptions& options) {
  Trail trail(graph);
  lead_in(trail, graph, path.steps.front().lane, path.start_along_m, options.extension_m);
  double along_m = path.start_along_m;
  for (std::size_t step = 0; step < path.steps.size(); ++step) {
    std::size_t last = step;
    while (last + 1 < path.steps.size() && path.steps[last + 1].is_change) {
      ++last;
    }
    if (last > step) {
      along_m = follow_changes(trail, graph, path, step, last, along_m, options.change_length_m);
    }
    step = last;
    const std::int64_t lane = path.steps[step].lane;
    if (step + 1 < path.steps.size()) {
      trail.follow(lane, along_m, graph.node(lane).center.length_m());
      along_m = 0.0;
    } else {
      lead_out(trail, graph, lane, along_m,
               std::max(0.0, path.goal_along_m - along_m) + options.extension_m);
    }
  }
  return trail;
}

// The mean around `index` with Gaussian weights; reflected at the ends, which so stay where they
// are.
Eigen::Vector2d mean_at(const std::vector<Eigen::Vector2d>& points_m, std::ptrdiff_t index,
                        double deviation) {
  const auto count = static_cast<std::ptrdiff_t>(points_m.size());
  const auto at = [&](std::ptrdiff_t at_index) -> Eigen::Vector2d {
    if (at_index < 0) {
      return 2.0 * points_m.front() - points_m[static_cast<std::size_t>(-at_index)];
    }
    if (at_index >= count) {
      return 2.0 * points_m.back() - points_m[static_cast<std::size_t>(2 * (count - 1) - at_index)];
    }
    return points_m[static_cast<std::size_t>(at_index)];
  };
  const auto reach = std::min(static_cast<std::ptrdiff_t>(std::ceil(3.0 * deviation)), count - 1);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weights = 0.0;
  for (std::ptrdiff_t away = -reach; away <= reach; ++away) {
    const double share = static_cast<double>(away) / deviation;
    const double weight = std::exp(-0.5 * share * share);
    sum += weight * at(index + away);
    weights += weight;
  }
  return sum / weights;
}

// How far to average at each point, in points: as far as the error allows, changing slowly.
std::vector<double> deviations(const std::vector<Eigen::Vector2d>& points_m, double most,
                               double error_m) {
  std::vector<double> result(points_m.size(), kReferenceLine.least);
  for (std::size_t index = 0; index < points_m.size(); ++index) {
    for (double deviation = kReferenceLine.least; deviation <= most; deviation *= 1.5) {
      const auto mean = mean_at(points_m, static_cast<std::ptrdiff_t>(index), deviation);
      if ((mean - points_m[index]).norm() > error_m) {
        break;
      }
      result[index] = deviation;
    }
  }
  for (std::size_t index = 1; index < result.size(); ++index) {
    result[index] = std::min(result[index], result[index - 1] + kReferenceLine.slope);
  }
  for (std::size_t index = result.size() - 1; index > 0; --index) {
    result[index - 1] = std::min(result[index - 1], result[index] + kReferenceLine.slope);
  }
  // Without kinks, which would be seen in the line's curvature.
  const std::vector<double> limits = result;
  const auto last = static_cast<std::ptrdiff_t>(limits.size()) - 1;
  for (std::ptrdiff_t index = 0; index <= last; ++index) {
    double sum = 0.0;
    for (std::ptrdiff_t away = -kReferenceLine.mean_over; away <= kReferenceLine.mean_over;
         ++away) {
      sum += limits[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(index + away, 0, last))];
    }
    result[static_cast<std::size_t>(index)] = sum / (2 * kReferenceLine.mean_over + 1);
  }
  return result;
}

std::vector<Eigen::Vector2d> smoothed(const std::vector<Eigen::Vector2d>& points_m, double most,
                                      double error_m) {
  const std::vector<double> widths = deviations(points_m, most, error_m);
  std::vector<Eigen::Vector2d> result;
  result.reserve(points_m.size());
  for (std::size_t index = 0; index < points_m.size(); ++index) {
    result.push_back(mean_at(points_m, static_cast<std::ptrdiff_t>(index), widths[index]));
  }
  return result;
}

}  // namespace

ReferenceLine reference_line(const LaneGraph& graph, const LanePath& path,
                             const ReferenceOptions& options) {
  const Trail trail = trail_of(graph, path, options);
  const Polyline raw(trail.points_m());
  const Polyline even = raw.resampled(options.step_m);
  ReferenceLine line{.points_m = smoothed(even.points_m(), options.smoothing_m / options.step_m,
                                          options.smoothing_error_m)};
  for (std::size_t index = 0; index < line.points_m.size(); ++index) {
    const auto after = std::ranges::upper_bound(raw.arclengths_m(), even.arclengths_m()[index]);
    const auto at = std::max<std::ptrdiff_t>(1, after - raw.arclengths_m().begin()) - 1;
    const std::int64_t lane = trail.lanes()[static_cast<std::size_t>(at)];
    const auto lanes = graph.beside(lane);
    const Eigen::Vector2d& point = line.points_m[index];
    line.left_edge_m.push_back(-graph.node(lanes.back()).left.project(point).offset_m);
    line.right_edge_m.push_back(graph.node(lanes.front()).right.project(point).offset_m);
    line.speed_limit_mps.push_back(graph.node(lane).lane.speed_limit_mps);
  }
  return line;
}

}  // namespace ads
