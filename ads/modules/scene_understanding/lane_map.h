#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "common/plane.h"
#include "hd_map/map.pb.h"

namespace ads {

/// A position on a lane.
struct LanePlace {
  std::int64_t lane = 0;
  double along_m = 0.0;   ///< Along the lane's centre.
  double offset_m = 0.0;  ///< From there to the left.
};

/// The lanes of a tile, and the assignment of objects to them.
///
/// @threads  Immutable.
class LaneMap {
 public:
  struct Lane {
    hd_map::Lane info;
    Polyline center;
    Polyline left;
    Polyline right;
    Eigen::AlignedBox2d bounds;
  };

  LaneMap() = default;
  /// Lanes without a length are ignored.
  explicit LaneMap(const hd_map::Tile& tile);

  [[nodiscard]] bool is_empty() const { return lanes_.empty(); }
  /// Null if the tile does not contain it.
  [[nodiscard]] const Lane* find(std::int64_t id) const;

  /// The lane that fits best: the position is in the lane, or at most 1.5 m beside it, and the
  /// heading is along it. Slow objects may have any heading. An object stays on its `previous`
  /// lane, or continues on a successor, until another one fits clearly better. Lanes of `route`,
  /// the object's if it is known, are preferred: where lanes overlap, as at the start of a turn,
  /// the object is on the one that it will follow.
  [[nodiscard]] std::optional<LanePlace> match(const Eigen::Vector2d& position_m,
                                               double heading_rad, double speed_mps,
                                               std::int64_t previous,
                                               const std::set<std::int64_t>& route = {}) const;

 private:
  std::map<std::int64_t, Lane> lanes_;
};

}  // namespace ads
