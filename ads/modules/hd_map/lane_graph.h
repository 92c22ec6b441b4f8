#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "common/plane.h"

namespace ads {

enum class LaneKind : std::uint8_t { kRoad, kHighway, kRamp, kShoulder, kCrossing, kOther };

/// The adjacent lane of another one.
struct LaneBeside {
  std::int64_t id = 0;
  bool is_same_direction = false;
  /// According to the line between them, from the lane that has this one beside it.
  bool is_change_allowed = true;

  /// Whether a change to it is permitted.
  [[nodiscard]] bool may_change() const { return is_same_direction && is_change_allowed; }
};

/// The maximum number of predecessors, and of successors, of a lane.
constexpr std::size_t kLinksMax = 64;

/// Limits on the size of a map. A larger one is not a city map, and would take minutes to process.
struct MapLimits {
  std::size_t lanes = 50'000;
  /// Of all lanes, and of OpenDRIVE's roads.
  double lanes_length_m = 2e7;
  double roads_length_m = 2e6;
  /// Of all lanes' bounds together; lanes may share them, so that a small file may need much
  /// memory.
  std::size_t points = 4'000'000;
  /// The number of points examined to find overlapping lanes, and the number added for each lane:
  /// twenty times what city maps need.
  std::int64_t work = 20'000'000;
  std::int64_t work_per_lane = 10'000;
};

/// A lane of a map, independent of the file format. All referenced lanes are in the map.
struct MapLane {
  std::int64_t id = 0;
  /// Its name in the file, for display: "road 3, section 0, lane -1".
  std::string name = {};
  LaneKind kind = LaneKind::kRoad;
  /// In driving direction, with the same number of points.
  std::vector<Eigen::Vector2d> left_m = {};
  std::vector<Eigen::Vector2d> right_m = {};
  std::vector<std::int64_t> predecessors = {};
  std::vector<std::int64_t> successors = {};
  std::optional<LaneBeside> left = {};
  std::optional<LaneBeside> right = {};
  double speed_limit_mps = 0.0;  ///< 0 if the map has none.
  /// From left to right.
  std::optional<std::array<Eigen::Vector2d, 2>> stop_line = {};
  bool has_stop_sign = false;  ///< Stop at the stop line in any case.
  bool is_in_intersection = false;
  /// From its signs: above 0 for a priority road, below 0 for yield and stop.
  int priority = 0;
  /// Lanes with traffic from the right that has priority; from the left, if the map says so.
  std::vector<std::int64_t> from_right = {};
};

/// The lanes of a map, their connections, and right of way between them. Independent of files.
///
/// Two lanes conflict if one's centre line runs through the other, or if they lead into the same
/// lane; lanes that follow each other, are adjacent, or only diverge do not, nor do both directions
/// of one lane.
/// Of two conflicting lanes one yields, by the first rule that applies:
/// 1. the one that is not a pedestrian crossing;
/// 2. the one with the lower `priority` of its signs;
/// 3. the ramp, if it leads into the same lane as one that is not a ramp;
/// 4. the one that turns left, to oncoming traffic that does not; in left-hand traffic, that turns
///    right;
/// 5. the one that has the other in `from_right`, unless both have priority.
/// Traffic keeps to the left where lanes have the opposite direction on their right, for three
/// times the length for which they have it on their left.
///
/// @threads  Immutable.
class LaneGraph {
 public:
  struct Node {
    MapLane lane;
    Polyline center;
    Polyline left;
    Polyline right;
    Eigen::AlignedBox2d bounds;
    std::vector<std::int64_t> conflicts = {};
    std::vector<std::int64_t> yields_to = {};

    [[nodiscard]] bool contains(const Eigen::Vector2d& point_m) const;
    /// The distance of `point_m` from the lane; 0 on it. A lane without predecessors, or without
    /// successors, is extended there by `beyond_m`.
    [[nodiscard]] double distance_m(const Eigen::Vector2d& point_m, double beyond_m) const;
    /// Whether a vehicle may drive along it.
    [[nodiscard]] bool is_drivable() const;
  };

  /// @errors  Throws `std::runtime_error` if a lane has no length, its bounds do not match, it
  ///          references a missing lane, or the map exceeds the limits.
  explicit LaneGraph(std::vector<MapLane> lanes, const MapLimits& limits = {});

  [[nodiscard]] const std::map<std::int64_t, Node>& nodes() const { return nodes_; }
  [[nodiscard]] const Node& node(std::int64_t id) const { return nodes_.at(id); }

  /// The drivable lanes next to `id` to which a change is permitted, and `id` itself, from right to
  /// left; at most 64 to each side.
  [[nodiscard]] std::vector<std::int64_t> beside(std::int64_t id) const;

  /// The lanes within `radius_m` of the position, in the order of their ids.
  [[nodiscard]] std::vector<std::int64_t> within(const Eigen::Vector2d& place_m,
                                                 double radius_m) const;

 private:
  void check_references() const;
  void find_conflicts(std::int64_t work_max);
  [[nodiscard]] bool keeps_left() const;
  void add_conflict(Node& a, Node& b) const;
  [[nodiscard]] bool is_conflict(const Node& a, const Node& b, std::int64_t work_max,
                                 std::int64_t& work) const;
  [[nodiscard]] bool yields(const Node& a, const Node& b) const;

  std::map<std::int64_t, Node> nodes_;
  bool keeps_left_ = false;
};

}  // namespace ads
