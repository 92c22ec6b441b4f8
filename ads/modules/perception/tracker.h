#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "clustering.h"
#include "ego_motion.h"
#include "perception/tracker_state.pb.h"
#include "shape.h"
#include "sight_lines.h"
#include "skyline.h"
#include "track.h"

namespace ads {

struct TrackerConfig {
  ClusteringConfig clustering;
  TrackConfig track;
  /// The number of returns for a new object, and of sweeps until it is confirmed.
  int returns_min = 6;
  int sightings_min = 3;
  /// How long an unseen object is kept: in open view, and occluded.
  double open_max_s = 0.35;
  double hidden_max_s = 2.0;
  /// What a track can be that was not seen for `hidden_short_s` or longer: no farther from where it
  /// was expected than this error of its speed and this acceleration allow.
  double hidden_short_s = 0.5;
  double hidden_speed_error_mps = 3.0;
  double hidden_acceleration_mps2 = 6.0;
  /// Within this distance of its box, a track with enough returns in a group owns the whole group.
  double reach_m = 4.0;
  /// Larger objects are discarded.
  double length_max_m = 25.0;
  double width_max_m = 3.2;
  /// An object lower than 2.2 m and longer than this is split: it is restarted at its near end.
  double low_length_max_m = 25.0;
  /// Below this likeness an object is a structure: it yields returns to other objects.
  double structure_likeness = -1e3;
};

/// The returns of one sweep, and the sensor's geometry.
struct SweepReturns {
  std::int64_t begin_ns = 0;
  std::int64_t duration_ns = 0;
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();
  std::vector<LidarReturn> returns;
  std::vector<SightLine> sight_lines;  ///< Of all returns below the sensor, including the ground.
  double spread_rad = 0.0;             ///< Angle between neighbouring beams.
  double mount_forward_m = 0.0;
  double mount_height_m = 0.0;
};

/// A tracked object.
struct TrackedObject {
  std::uint64_t id = 0;
  Track track;
  std::uint32_t sightings = 0;
  std::uint32_t missed = 0;  ///< Sweeps since it was last seen.
  std::int64_t seen_ns = 0;
  bool is_confirmed = false;
  /// Accumulated evidence of the last sweeps for and against; 0 if it was unclear.
  double vehicle_likeness = 0.0;
  double two_wheeler_likeness = 0.0;
  /// Evidence against a vehicle because beams passed through its place.
  double hollowness = 0.0;
};

/// Tracks objects from sweep to sweep.
///
/// 1. A return inside a track's predicted box at the return's time belongs to the track, and is
/// moved
///    with it to the middle of the sweep.
/// 2. Returns close to each other form groups. Those of a track form one view of it, with the rest
///    of their groups; a group of several tracks is divided among them by distance.
/// 3. The other groups are assigned to the remaining tracks: greedy global nearest neighbour, by
///    increasing Mahalanobis distance (Blackman, Popoli, "Design and Analysis of Modern Tracking
///    Systems", 1999, section 6.4), which is a complete order: ties are broken by the tracks' age.
///    Remaining groups start new tracks.
///
/// Deterministic: the same sweeps give the same tracks and ids.
///
/// @threads  Confined.
class Tracker {
 public:
  explicit Tracker(const TrackerConfig& config);

  /// The objects and the id counter; `load` continues from there.
  void save(perception::TrackerState& state) const;
  /// @errors  As `Track`.
  void load(const perception::TrackerState& state);

  void update(const SweepReturns& sweep, const EgoMotion& ego);
  /// Without usable returns: removes tracks that have not been seen for too long at `time_ns`.
  void coast(std::int64_t time_ns);

  [[nodiscard]] const std::vector<TrackedObject>& objects() const { return objects_; }

 private:
  static constexpr int kNobody = -1;

  // Returns that belong together.
  struct Group {
    int owner = kNobody;  // An index in `objects_`.
    std::int64_t time_ns = 0;
    std::vector<ObjectPoint> points;
    ObjectView view;
  };

  [[nodiscard]] bool is_structure(const TrackedObject& object) const;
  void label(const SweepReturns& sweep);
  void gather(const SweepReturns& sweep, const EgoMotion& ego);
  void add_point(Group& group, const SweepReturns& sweep, std::size_t beam_return);
  void finish(Group& group, const SweepReturns& sweep, const EgoMotion& ego);
  void associate();
  [[nodiscard]] bool can_reach(const TrackedObject& object, const Group& group) const;
  void begin_tracks();
  void sight(TrackedObject& object, const Group& group);
  void look_at(TrackedObject& object, const Group& group);
  [[nodiscard]] bool is_two_wheeler(const Group& group, double heading_rad) const;
  void forget(std::int64_t time_ns, const SweepReturns* sweep, const EgoMotion* ego);
  void remove_doubles();
  [[nodiscard]] Eigen::Vector2d box_place(const TrackedObject& object, std::int64_t time_ns,
                                          const Eigen::Vector2d& place_m) const;

  const TrackerConfig config_;
  Clustering clustering_;
  Skyline skyline_;
  HighPlaces high_places_;
  SightLines sight_lines_;
  std::uint64_t next_id_ = 1;
  std::vector<TrackedObject> objects_;

  // Of one sweep.
  std::vector<int> labels_;       // Of each return: an index in `objects_`.
  std::vector<float> outside_m_;  // Its distance from that object's box.
  std::vector<Eigen::Vector2f> places_m_;
  std::vector<Group> groups_;
  std::vector<bool> is_seen_;
};

}  // namespace ads
