#include "lane_paths.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>

#include "prediction_tuning.h"

namespace ads {
namespace {}  // namespace

std::optional<double> LanePath::begin_of(std::int64_t lane) const {
  const auto found = std::ranges::find(parts, lane, &Part::lane);
  return found == parts.end() ? std::nullopt : std::optional(found->begin_m);
}

LanePaths::LanePaths(const hd_map::Tile& tile) {
  for (const hd_map::Lane& lane : tile.lanes()) {
    const hd_map::Line& left = lane.left();
    const hd_map::Line& right = lane.right();
    std::vector<Eigen::Vector2d> center;
    for (int index = 0;
         index < std::min({left.x_m_size(), left.y_m_size(), right.x_m_size(), right.y_m_size()});
         ++index) {
      center.emplace_back((left.x_m(index) + right.x_m(index)) / 2.0,
                          (left.y_m(index) + right.y_m(index)) / 2.0);
    }
    try {
      lanes_.emplace(lane.id(),
                     Lane{.center = Polyline(center),
                          .successors = {lane.successors().begin(), lane.successors().end()},
                          .left = lane.is_left_same_direction() ? lane.left_lane() : 0,
                          .right = lane.is_right_same_direction() ? lane.right_lane() : 0});
    } catch (const std::invalid_argument&) {
      // Without a length it is no lane.
    }
  }
  for (const auto& entry : lanes_) {
    for (const std::int64_t one : entry.second.successors) {
      const auto found = lanes_.find(one);
      if (found != lanes_.end()) {
        add_forks(entry.second.successors, one, found->second.forks);
      }
    }
  }
}

void LanePaths::add_forks(const std::vector<std::int64_t>& successors, std::int64_t lane,
                          std::vector<std::int64_t>& forks) const {
  for (const std::int64_t other : successors) {
    if (forks.size() == kLanePaths.forks_max) {
      return;
    }
    if (other != lane && has(other) && std::ranges::find(forks, other) == forks.end()) {
      forks.push_back(other);
    }
  }
}

std::int64_t LanePaths::beside(std::int64_t lane, bool is_left) const {
  const auto found = lanes_.find(lane);
  if (found == lanes_.end()) {
    return 0;
  }
  const std::int64_t other = is_left ? found->second.left : found->second.right;
  return has(other) ? other : 0;
}

void LanePaths::extend(std::vector<std::int64_t>& chain, double length_m,
                       std::vector<std::vector<std::int64_t>>& chains) const {
  const Lane& last = lanes_.at(chain.back());
  std::vector<std::pair<double, std::int64_t>> next;
  for (const std::int64_t id : last.successors) {
    if (const auto found = lanes_.find(id); found != lanes_.end()) {
      const Polyline& center = found->second.center;
      next.emplace_back(std::abs(normalize_angle(center.heading_at(center.length_m()) -
                                                 last.center.heading_at(last.center.length_m()))),
                        id);
    }
  }
  std::ranges::sort(next);
  length_m -= last.center.length_m();
  if (next.empty() || length_m <= 0.0 || chain.size() == kLanePaths.lanes_max) {
    chains.push_back(chain);
    return;
  }
  for (const auto& [turn_rad, id] : next) {
    if (chains.size() < kLanePaths.paths_max) {
      chain.push_back(id);
      extend(chain, length_m, chains);
      chain.pop_back();
    }
  }
}

std::vector<LanePath> LanePaths::from(std::int64_t lane, double length_m) const {
  std::vector<std::vector<std::int64_t>> chains;
  std::vector<std::int64_t> chain{lane};
  extend(chain, length_m, chains);
  std::vector<LanePath> paths;
  for (const auto& ids : chains) {
    std::vector<Eigen::Vector2d> points;
    std::vector<LanePath::Part> parts;
    double along_m = 0.0;
    for (const std::int64_t id : ids) {
      const auto& more = lanes_.at(id).center.points_m();
      if (!points.empty()) {
        along_m += (more.front() - points.back()).norm();
      }
      parts.push_back({.lane = id, .begin_m = along_m});
      points.insert(points.end(), more.begin(), more.end());
      along_m += lanes_.at(id).center.length_m();
    }
    paths.push_back({.line = Polyline(points), .parts = std::move(parts)});
  }
  return paths;
}

}  // namespace ads
