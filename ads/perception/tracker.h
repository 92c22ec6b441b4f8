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
  /// Echoes that a new object needs, and sweeps in which it has to be seen before it counts.
  int echoes_min = 6;
  int sightings_min = 3;
  /// For how long an object is kept that is not seen: in open view, and hidden behind others.
  double open_max_s = 0.35;
  double hidden_max_s = 2.0;
  /// A group in which a track has enough echoes is its whole group, so far around its box.
  double reach_m = 4.0;
  /// What is larger is no object.
  double length_max_m = 25.0;
  double width_max_m = 3.2;
  /// What is no higher than 2.2 m and longer than this is two: it is begun anew at its near end.
  double low_length_max_m = 25.0;
  /// What looks less like a vehicle or two-wheeler is a structure: it gives way to other objects.
  double structure_likeness = -1e3;
};

/// Echoes of one sweep, and how they were taken.
struct SweepEchoes {
  std::int64_t begin_ns = 0;
  std::int64_t duration_ns = 0;
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();
  std::vector<Echo> echoes;
  std::vector<SightLine> sight_lines;  ///< Of all echoes below the sensor, the ground as well.
  double spread_rad = 0.0;             ///< Between neighbouring beams.
  double mount_forward_m = 0.0;
  double mount_height_m = 0.0;
};

/// An object that is followed from sweep to sweep.
struct TrackedObject {
  std::uint64_t id = 0;
  Track track;
  std::uint32_t sightings = 0;
  std::uint32_t missed = 0;  ///< Sweeps since it was last seen.
  std::int64_t seen_ns = 0;
  bool is_confirmed = false;
  /// By how much more it looked like it than not in the last sweeps; 0 if that was not clear.
  double vehicle_likeness = 0.0;
  double two_wheeler_likeness = 0.0;
  /// By how much it looked less like a vehicle because one saw through its place.
  double hollowness = 0.0;
};

/// Follows objects through the sweeps.
///
/// 1. An echo inside the box that a track is expected to have at the echo's time belongs to it, and
///    is moved with it to the middle of the sweep.
/// 2. Echoes close to each other form groups. Those of a track form one view of it, with what else
///    is in their groups; a group of several tracks is divided among them by distance.
/// 3. The other groups go to the tracks that are left over: global nearest neighbour in a greedy
///    way, by increasing Mahalanobis distance (Blackman, Popoli, "Design and Analysis of Modern
///    Tracking Systems", 1999, section 6.4), which is a complete order: equal distances are decided
///    by the tracks' age. What is then left begins tracks.
///
/// Deterministic: the same sweeps give the same tracks and ids.
///
/// @threads  Confined.
class Tracker {
 public:
  explicit Tracker(const TrackerConfig& config);

  /// The objects, and the ids given; `load` goes on from there.
  void save(perception::TrackerState& state) const;
  /// @errors  As `Track`.
  void load(const perception::TrackerState& state);

  void update(const SweepEchoes& sweep, const EgoMotion& ego);
  /// No echoes can be used: tracks end that were not seen for too long by `time_ns`.
  void coast(std::int64_t time_ns);

  [[nodiscard]] const std::vector<TrackedObject>& objects() const { return objects_; }

 private:
  static constexpr int kNobody = -1;

  // Echoes that belong together.
  struct Group {
    int owner = kNobody;  // An index in `objects_`.
    std::int64_t time_ns = 0;
    std::vector<ObjectPoint> points;
    ObjectView view;
  };

  [[nodiscard]] bool is_structure(const TrackedObject& object) const;
  void label(const SweepEchoes& sweep);
  void gather(const SweepEchoes& sweep, const EgoMotion& ego);
  void add_point(Group& group, const SweepEchoes& sweep, std::size_t echo);
  void finish(Group& group, const SweepEchoes& sweep, const EgoMotion& ego);
  void associate();
  void begin_tracks();
  void sight(TrackedObject& object, const Group& group);
  void look_at(TrackedObject& object, const Group& group);
  [[nodiscard]] bool is_two_wheeler(const Group& group, double heading_rad) const;
  void forget(std::int64_t time_ns, const SweepEchoes* sweep, const EgoMotion* ego);
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
  std::vector<int> labels_;       // Of each echo: an index in `objects_`.
  std::vector<float> outside_m_;  // How far it is outside of that object's box.
  std::vector<Eigen::Vector2f> places_m_;
  std::vector<Group> groups_;
  std::vector<bool> is_seen_;
};

}  // namespace ads
