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

/// The lane beside another one.
struct LaneBeside {
  std::int64_t id = 0;
  bool is_same_direction = false;
  /// By the line between, for one who comes from the lane that has this one beside it.
  bool is_change_allowed = true;

  /// Whether one may go over to it.
  [[nodiscard]] bool may_change() const { return is_same_direction && is_change_allowed; }
};

/// More lanes than this neither precede nor follow one.
constexpr std::size_t kLinksMax = 64;

/// How large a map may be. What is more is no map of a city, and would take minutes.
struct MapLimits {
  std::size_t lanes = 50'000;
  /// Of all lanes, and of the roads of OpenDRIVE.
  double lanes_length_m = 2e7;
  double roads_length_m = 2e6;
  /// Of all lanes' bounds together; lanes may share them, so a small file may ask for a lot.
  std::size_t points = 4'000'000;
  /// How many points are looked at to see which lanes lie upon each other, and how many more for
  /// each lane: twenty times what maps of cities need.
  std::int64_t work = 20'000'000;
  std::int64_t work_per_lane = 10'000;
};

/// What a map says of a lane, whatever its file format is. Lanes that are named are in the map.
struct MapLane {
  std::int64_t id = 0;
  /// What it is in the file, for people: "road 3, section 0, lane -1".
  std::string name = {};
  LaneKind kind = LaneKind::kRoad;
  /// In driving direction, with the same number of points.
  std::vector<Eigen::Vector2d> left_m = {};
  std::vector<Eigen::Vector2d> right_m = {};
  std::vector<std::int64_t> predecessors = {};
  std::vector<std::int64_t> successors = {};
  std::optional<LaneBeside> left = {};
  std::optional<LaneBeside> right = {};
  double speed_limit_mps = 0.0;  ///< 0 where the map says nothing.
  /// From left to right.
  std::optional<std::array<Eigen::Vector2d, 2>> stop_line = {};
  bool has_stop_sign = false;  ///< To stop at the stop line in any case.
  bool is_in_intersection = false;
  /// Of its signs: above 0 for a road with priority, below 0 for yield and stop.
  int priority = 0;
  /// Lanes whose traffic comes from the right, where the one from the right goes first.
  std::vector<std::int64_t> from_right = {};
};

/// The lanes of a map, how they are joined, and who goes first where they meet. Knows no file.
///
/// Two lanes conflict when one's centre line runs through the other, or when they lead into the
/// same lane; lanes that follow each other, lie side by side, or only part from each other do not,
/// nor do both directions of one lane.
/// Of two that conflict, one yields:
/// 1. to what crosses on foot;
/// 2. the one with the lower `priority` of the signs;
/// 3. the ramp, where it leads into a lane that is no ramp;
/// 4. who turns left, to oncoming traffic that does not;
/// 5. to whom comes `from_right`, unless both have priority.
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
    /// How far `point_m` is from the lane; 0 on it. Where nothing comes before, or after, the lane
    /// reaches `beyond_m` farther.
    [[nodiscard]] double distance_m(const Eigen::Vector2d& point_m, double beyond_m) const;
    /// Whether a vehicle may drive along it.
    [[nodiscard]] bool is_drivable() const;
  };

  /// @errors  Throws `std::runtime_error` if a lane has no length, its bounds do not fit together,
  ///          it names a lane that there is not, or the map is larger than the limits.
  explicit LaneGraph(std::vector<MapLane> lanes, const MapLimits& limits = {});

  [[nodiscard]] const std::map<std::int64_t, Node>& nodes() const { return nodes_; }
  [[nodiscard]] const Node& node(std::int64_t id) const { return nodes_.at(id); }

  /// The drivable lanes side by side with `id` to which one may change from it, from right to left,
  /// with it; 64 to each side at most.
  [[nodiscard]] std::vector<std::int64_t> beside(std::int64_t id) const;

  /// The lanes of which something is within `radius_m` of the place, in the order of their ids.
  [[nodiscard]] std::vector<std::int64_t> within(const Eigen::Vector2d& place_m,
                                                 double radius_m) const;

 private:
  void check_references() const;
  void find_conflicts(std::int64_t work_max);
  static void add_conflict(Node& a, Node& b);
  [[nodiscard]] bool is_conflict(const Node& a, const Node& b, std::int64_t work_max,
                                 std::int64_t& work) const;
  [[nodiscard]] static bool yields(const Node& a, const Node& b);

  std::map<std::int64_t, Node> nodes_;
};

}  // namespace ads
