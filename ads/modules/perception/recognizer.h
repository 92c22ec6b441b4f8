#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "ego_motion.h"
#include "ground.h"
#include "perception/tracker_state.pb.h"
#include "road_borders.h"
#include "tracker.h"

namespace ads {

struct RecognizerConfig {
  GroundConfig ground;
  TrackerConfig tracker;
  /// What is lower belongs to the ground, and what is higher can be passed under.
  double height_min_m = 0.2;
  double height_max_m = 4.5;
  /// Returns within this box around the vehicle's centre are from the vehicle itself.
  double own_length_m = 4.8;
  double own_width_m = 2.0;
  /// A sweep with a larger share of non-finite returns, or with fewer returns, is rejected.
  double invalid_share_max = 0.2;
  int returns_min = 500;
  bool are_borders_sought = false;
};

/// A sweep as received; see `lidar.Sweep`.
struct SweepBytes {
  std::int64_t taken_ns = 0;
  std::int64_t duration_ns = 0;
  std::uint32_t columns = 0;
  std::uint32_t rings = 0;
  std::string_view points;
  double mount_forward_m = 0.0;
  double mount_height_m = 0.0;
};

/// The outcome of one sweep.
struct SweepResult {
  std::string reason;  ///< Why it was rejected; empty if it was used.
  std::uint32_t returns = 0;
  std::uint32_t invalid_returns = 0;
  std::uint32_t ground_returns = 0;
};

/// Computes tracked objects from the bytes of sweeps.
///
/// Uses only properties of the sensor that a sweep contains; the order of points is irrelevant.
///
/// @threads  Confined.
/// @realtime Allocates only while the number of returns or objects grows.
class Recognizer {
 public:
  explicit Recognizer(const RecognizerConfig& config);

  /// Saves the complete state: an instance with the same configuration that restores it by `load`
  /// continues bit for bit.
  void save(perception::TrackerState& state) const;
  /// @errors  As `Track`.
  void load(const perception::TrackerState& state);

  /// @param ego  The vehicle's poses during the sweep.
  SweepResult take(const SweepBytes& sweep, const EgoMotion& ego);
  /// Takes note that the sweep that ended at `end_ns` is unusable.
  SweepResult pass_over(std::int64_t end_ns, std::string reason);

  [[nodiscard]] const std::vector<TrackedObject>& objects() const { return tracker_.objects(); }
  [[nodiscard]] bool are_borders_sought() const { return config_.are_borders_sought; }
  /// Of the last sweep; null if it was rejected, or if borders are disabled. Relative to the
  /// sensor, at the middle of the sweep.
  [[nodiscard]] const RoadBorders* borders() const { return borders_; }

 private:
  [[nodiscard]] std::string error_of(const SweepBytes& sweep, const EgoMotion& ego) const;
  void read(const SweepBytes& sweep, SweepResult& result);
  void find_borders(const SweepBytes& sweep, const EgoMotion& ego);
  void find_obstacles(const SweepBytes& sweep, const EgoMotion& ego, SweepResult& result);

  const RecognizerConfig config_;
  Ground ground_;
  Tracker tracker_;
  BorderFinder border_finder_;
  const RoadBorders* borders_ = nullptr;
  std::int64_t last_ns_ = 0;
  std::vector<RawReturn> raw_;
  SweepReturns sweep_;
};

}  // namespace ads
