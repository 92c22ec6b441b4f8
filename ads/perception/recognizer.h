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
  /// What is lower above the ground belongs to it, and what is higher is passed under.
  double height_min_m = 0.2;
  double height_max_m = 4.5;
  /// Echoes so close around the vehicle's centre are its own.
  double own_length_m = 4.8;
  double own_width_m = 2.0;
  /// A sweep with a larger share of echoes that are not finite, or with fewer echoes, is not used.
  double invalid_share_max = 0.2;
  int echoes_min = 500;
  bool are_borders_sought = false;
};

/// A sweep as it was received; see `lidar.Sweep`.
struct SweepBytes {
  std::int64_t taken_ns = 0;
  std::int64_t duration_ns = 0;
  std::uint32_t columns = 0;
  std::uint32_t rings = 0;
  std::string_view points;
  double mount_forward_m = 0.0;
  double mount_height_m = 0.0;
};

/// What became of one sweep.
struct SweepResult {
  std::string reason;  ///< Why it could not be used; empty if it was.
  std::uint32_t echoes = 0;
  std::uint32_t invalid_echoes = 0;
  std::uint32_t ground_echoes = 0;
};

/// From the bytes of sweeps to tracked objects.
///
/// Knows of the sensor only what a sweep says; the order of its points does not matter.
///
/// @threads  Confined.
/// @realtime Allocates while sweeps and objects become more.
class Recognizer {
 public:
  explicit Recognizer(const RecognizerConfig& config);

  /// All that it remembers from one sweep to the next: one of the same configuration that takes it
  /// over by `load` goes on bit for bit.
  void save(perception::TrackerState& state) const;
  /// @errors  As `Track`.
  void load(const perception::TrackerState& state);

  /// @param ego  The vehicle's poses during the sweep.
  SweepResult take(const SweepBytes& sweep, const EgoMotion& ego);
  /// A sweep that ended at `end_ns` cannot be used.
  SweepResult pass_over(std::int64_t end_ns, std::string reason);

  [[nodiscard]] const std::vector<TrackedObject>& objects() const { return tracker_.objects(); }
  [[nodiscard]] bool are_borders_sought() const { return config_.are_borders_sought; }
  /// Of the last sweep; null if it could not be used, or if they are not sought. From the sensor,
  /// in the middle of the sweep.
  [[nodiscard]] const RoadBorders* borders() const { return borders_; }

 private:
  [[nodiscard]] std::string mistake_of(const SweepBytes& sweep, const EgoMotion& ego) const;
  void read(const SweepBytes& sweep, SweepResult& result);
  void find_borders(const SweepBytes& sweep, const EgoMotion& ego);
  void find_obstacles(const SweepBytes& sweep, const EgoMotion& ego, SweepResult& result);

  const RecognizerConfig config_;
  Ground ground_;
  Tracker tracker_;
  BorderFinder border_finder_;
  const RoadBorders* borders_ = nullptr;
  std::int64_t last_ns_ = 0;
  std::vector<RawEcho> raw_;
  SweepEchoes sweep_;
};

}  // namespace ads
