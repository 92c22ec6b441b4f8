#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "common/plane.h"
#include "hd_map/map.pb.h"

namespace ads {

/// The joined centres of consecutive lanes.
struct LanePath {
  struct Part {
    std::int64_t lane = 0;
    double begin_m = 0.0;  ///< Where the lane begins along the line.
  };
  Polyline line;
  std::vector<Part> parts = {};

  /// Where the lane begins along the line, if it is in the path.
  [[nodiscard]] std::optional<double> begin_of(std::int64_t lane) const;
};

/// The lanes of a tile as paths to drive along.
///
/// @threads  Immutable.
class LanePaths {
 public:
  LanePaths() = default;
  /// Lanes without a length are ignored.
  explicit LanePaths(const hd_map::Tile& tile);

  [[nodiscard]] bool has(std::int64_t lane) const { return lanes_.contains(lane); }
  /// The adjacent lane in the same direction; 0 for none.
  [[nodiscard]] std::int64_t beside(std::int64_t lane, bool is_left) const;
  /// The other lanes that begin where `lane` does: at a fork, an object may be on several.
  /// At most four.
  [[nodiscard]] const std::vector<std::int64_t>& forks_of(std::int64_t lane) const {
    return lanes_.at(lane).forks;
  }
  /// The possible paths from `lane` for `length_m`, the straightest one first; at most four, and at
  /// least one. The last lane of a map is extended straight.
  [[nodiscard]] std::vector<LanePath> from(std::int64_t lane, double length_m) const;

 private:
  struct Lane {
    Polyline center;
    std::vector<std::int64_t> successors;
    std::vector<std::int64_t> forks = {};  // Other successors of its predecessors.
    std::int64_t left = 0;                 // In the same direction, or 0.
    std::int64_t right = 0;
  };

  void add_forks(const std::vector<std::int64_t>& successors, std::int64_t lane,
                 std::vector<std::int64_t>& forks) const;
  void extend(std::vector<std::int64_t>& chain, double length_m,
              std::vector<std::vector<std::int64_t>>& chains) const;

  std::map<std::int64_t, Lane> lanes_;
};

}  // namespace ads
