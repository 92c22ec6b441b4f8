#include "tracker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include "common/plane.h"
#include "perception_tuning.h"
#include "shape.h"

namespace ads {
namespace {

// From the visible faces: a completely visible face no longer than a car's width is its front or
// rear, a longer one its side. A smaller visible part is assumed to lie as `likely_rad` does. Of
// both directions, the one closer to that.
double first_heading(const ObjectView& view, const Skyline& skyline,
                     const Eigen::Vector2d& reference_m, double likely_rad) {
  double heading = heading_by_closeness(view, likely_rad, 0.25 * std::numbers::pi);
  const BoxView box = view_box(view, skyline, reference_m, heading);
  const double along = box.front.place_m - box.rear.place_m;
  const double across = box.left.place_m - box.right.place_m;
  const bool is_across = along > across && along < kTracker.side_from_m &&
                         along > kTracker.front_from_m && box.front.is_end && box.rear.is_end;
  if (across > kTracker.side_from_m || is_across) {
    heading += 0.5 * std::numbers::pi;
  }
  return std::cos(heading - likely_rad) < 0.0 ? heading + std::numbers::pi : heading;
}

}  // namespace

Tracker::Tracker(const TrackerConfig& config) : config_(config), clustering_(config.clustering) {}

void Tracker::save(perception::TrackerState& state) const {
  state.set_last_id(next_id_ - 1);
  for (const TrackedObject& object : objects_) {
    perception::TrackedObjectState& its = *state.add_objects();
    its.set_id(object.id);
    object.track.save(*its.mutable_track());
    its.set_sightings(object.sightings);
    its.set_missed(object.missed);
    its.set_seen_ns(object.seen_ns);
    its.set_is_confirmed(object.is_confirmed);
    its.set_vehicle_likeness(object.vehicle_likeness);
    its.set_two_wheeler_likeness(object.two_wheeler_likeness);
    its.set_hollowness(object.hollowness);
  }
}

void Tracker::load(const perception::TrackerState& state) {
  next_id_ = state.last_id() + 1;
  objects_.clear();
  for (const perception::TrackedObjectState& its : state.objects()) {
    objects_.push_back({.id = its.id(),
                        .track = Track(config_.track, its.track()),
                        .sightings = its.sightings(),
                        .missed = its.missed(),
                        .seen_ns = its.seen_ns(),
                        .is_confirmed = its.is_confirmed(),
                        .vehicle_likeness = its.vehicle_likeness(),
                        .two_wheeler_likeness = its.two_wheeler_likeness(),
                        .hollowness = its.hollowness()});
  }
}

void Tracker::update(const SweepReturns& sweep, const EgoMotion& ego) {
  skyline_.fill(sweep.returns, sweep.mount_height_m);
  high_places_.fill(sweep.returns, sweep.origin_m);
  sight_lines_.fill(sweep.sight_lines);
  is_seen_.assign(objects_.size(), false);
  label(sweep);
  gather(sweep, ego);
  for (const Group& group : groups_) {
    if (group.owner != kNobody && group.points.size() >= kTracker.returns_seen) {
      sight(objects_[static_cast<std::size_t>(group.owner)], group);
      is_seen_[static_cast<std::size_t>(group.owner)] = true;
    }
  }
  associate();
  for (std::size_t index = 0; index < objects_.size(); ++index) {
    objects_[index].missed += is_seen_[index] ? 0 : 1;
  }
  forget(sweep.begin_ns + sweep.duration_ns, &sweep, &ego);
  begin_tracks();
  remove_doubles();
}

void Tracker::coast(std::int64_t time_ns) {
  for (TrackedObject& object : objects_) {
    ++object.missed;
  }
  forget(time_ns, nullptr, nullptr);
}

// In the directions of the object's box, as expected at that time, from its centre.
Eigen::Vector2d Tracker::box_place(const TrackedObject& object, std::int64_t time_ns,
                                   const Eigen::Vector2d& place_m) const {
  const Track& track = object.track;
  const double passed_s = static_cast<double>(time_ns - track.time_ns()) * 1e-9;
  const Eigen::Vector2d apart = place_m - track.center_m() - passed_s * track.velocity_mps();
  const Eigen::Vector2d ahead = direction(track.heading_rad() + passed_s * track.yaw_rate_radps());
  return {apart.dot(ahead), apart.dot(left_of(ahead))};
}

// Step 1: whose returns.
void Tracker::label(const SweepReturns& sweep) {
  const std::size_t count = sweep.returns.size();
  labels_.assign(count, kNobody);
  places_m_.resize(count);
  outside_m_.assign(count, std::numeric_limits<float>::infinity());
  for (std::size_t index = 0; index < objects_.size(); ++index) {
    const Track& track = objects_[index].track;
    if (track.speed_stddev_mps() > kTracker.known_speed_mps) {
      continue;
    }
    const double before_s = static_cast<double>(sweep.begin_ns - track.time_ns()) * 1e-9;
    const double middle_s = before_s + 0.5e-9 * static_cast<double>(sweep.duration_ns);
    // An object that is not a vehicle stands: it leaves returns not well within it to others.
    const bool stands = is_structure(objects_[index]);
    const double margin =
        stands ? 0.0
               : std::min(kTracker.margin_max_m, kTracker.margin_m + std::max(0.0, middle_s - 0.1) *
                                                                         track.speed_stddev_mps());
    const Eigen::Vector2f begin_m =
        (track.center_m() + before_s * track.velocity_mps() - sweep.origin_m).cast<float>();
    const Eigen::Vector2f velocity = track.velocity_mps().cast<float>();
    const Eigen::Vector2f ahead =
        direction(track.heading_rad() + middle_s * track.yaw_rate_radps()).cast<float>();
    const auto half_length = static_cast<float>(0.5 * track.length_m());
    const auto half_width = static_cast<float>(0.5 * track.width_m());
    // It may be longer than was seen so far.
    const auto rest =
        stands ? 0.0F
               : static_cast<float>(kTracker.margin_m + std::min(1.0, track.length_stddev_m()));
    const float behind = stands ? kTracker.behind_m : 0.0F;
    const float reach = half_length + half_width + rest + static_cast<float>(margin);
    for (std::size_t beam_return = 0; beam_return < count; ++beam_return) {
      const Eigen::Vector2f apart = sweep.returns[beam_return].place_m - begin_m -
                                    sweep.returns[beam_return].time_s * velocity;
      if (std::abs(apart.x()) > reach || std::abs(apart.y()) > reach) {
        continue;
      }
      const float along = std::abs(apart.x() * ahead.x() + apart.y() * ahead.y());
      const float across = std::abs(apart.y() * ahead.x() - apart.x() * ahead.y());
      const float its_outside = std::max(along - half_length, across - half_width);
      const bool is_in_rest = along < half_length + rest && across < half_width;
      if ((its_outside < static_cast<float>(margin) || is_in_rest) &&
          its_outside + behind < outside_m_[beam_return]) {
        outside_m_[beam_return] = its_outside + behind;
        labels_[beam_return] = static_cast<int>(index);
      }
    }
  }
  for (float& outside : outside_m_) {
    outside -= outside > 0.5F * kTracker.behind_m ? kTracker.behind_m : 0.0F;
  }
}

bool Tracker::is_structure(const TrackedObject& object) const {
  return object.vehicle_likeness < config_.structure_likeness &&
         object.two_wheeler_likeness < config_.structure_likeness;
}

// Step 2: groups of returns.
void Tracker::gather(const SweepReturns& sweep, const EgoMotion& ego) {
  const auto middle_s = static_cast<float>(0.5e-9 * static_cast<double>(sweep.duration_ns));
  const auto pose = ego.at(sweep.begin_ns + sweep.duration_ns / 2);
  const Eigen::Vector2f sensor_m = (pose->position_m - sweep.origin_m).cast<float>();
  for (std::size_t beam_return = 0; beam_return < sweep.returns.size(); ++beam_return) {
    places_m_[beam_return] = sweep.returns[beam_return].place_m - sensor_m;
    if (labels_[beam_return] != kNobody) {
      const Track& track = objects_[static_cast<std::size_t>(labels_[beam_return])].track;
      places_m_[beam_return] +=
          (middle_s - sweep.returns[beam_return].time_s) * track.velocity_mps().cast<float>();
    }
  }
  const std::vector<int>& clusters = clustering_.group(places_m_, sweep.spread_rad);

  struct Owners {
    int returns = 0;
    int owned = 0;
    int rest_group = kNobody;
    std::vector<int> who;
  };
  std::vector<Owners> owners(static_cast<std::size_t>(clustering_.groups()));
  for (std::size_t beam_return = 0; beam_return < clusters.size(); ++beam_return) {
    if (clusters[beam_return] < 0) {
      continue;
    }
    Owners& its = owners[static_cast<std::size_t>(clusters[beam_return])];
    ++its.returns;
    if (labels_[beam_return] != kNobody) {
      ++its.owned;
      if (outside_m_[beam_return] < kTracker.margin_m &&
          std::ranges::find(its.who, labels_[beam_return]) == its.who.end()) {
        its.who.push_back(labels_[beam_return]);
      }
    }
  }
  // Beyond the end of a box returns are the track's only if they hang together with it, or if they
  // are a group that lies there altogether.
  for (std::size_t beam_return = 0; beam_return < clusters.size(); ++beam_return) {
    if (clusters[beam_return] >= 0 && labels_[beam_return] != kNobody &&
        outside_m_[beam_return] >= kTracker.margin_m) {
      const Owners& its = owners[static_cast<std::size_t>(clusters[beam_return])];
      if (its.owned < its.returns &&
          std::ranges::find(its.who, labels_[beam_return]) == its.who.end()) {
        labels_[beam_return] = kNobody;
      }
    }
  }

  groups_.clear();
  groups_.resize(objects_.size());
  for (std::size_t index = 0; index < objects_.size(); ++index) {
    groups_[index].owner = static_cast<int>(index);
  }
  for (std::size_t beam_return = 0; beam_return < clusters.size(); ++beam_return) {
    if (clusters[beam_return] < 0) {
      continue;
    }
    Owners& its = owners[static_cast<std::size_t>(clusters[beam_return])];
    int owner = labels_[beam_return];
    if (owner == kNobody && its.owned > kTracker.owned_share * its.returns) {
      const auto time_ns =
          sweep.begin_ns + static_cast<std::int64_t>(1e9F * sweep.returns[beam_return].time_s);
      const Eigen::Vector2d place_m =
          sweep.origin_m + sweep.returns[beam_return].place_m.cast<double>();
      double nearest = std::numeric_limits<double>::infinity();
      for (const int candidate : its.who) {
        const TrackedObject& object = objects_[static_cast<std::size_t>(candidate)];
        const Eigen::Vector2d place = box_place(object, time_ns, place_m);
        const double outside = std::max(std::abs(place.x()) - 0.5 * object.track.length_m(),
                                        std::abs(place.y()) - 0.5 * object.track.width_m());
        const double reach = is_structure(object) ? kTracker.structure_reach_m : config_.reach_m;
        if (outside < reach && outside < nearest) {
          nearest = outside;
          owner = candidate;
        }
      }
    }
    if (owner == kNobody) {
      if (its.rest_group == kNobody) {
        its.rest_group = static_cast<int>(groups_.size());
        groups_.emplace_back();
      }
      owner = its.rest_group;  // The groups of tracks come first, in their order.
    }
    add_point(groups_[static_cast<std::size_t>(owner)], sweep, beam_return);
  }
  for (Group& group : groups_) {
    finish(group, sweep, ego);
  }
}

void Tracker::add_point(Group& group, const SweepReturns& sweep, std::size_t beam_return) {
  const LidarReturn& its = sweep.returns[beam_return];
  group.time_ns += static_cast<std::int64_t>(1e9F * its.time_s);  // Their sum, until `finish`.
  group.points.push_back({.place_m = sweep.origin_m + its.place_m.cast<double>(),
                          .time_s = its.time_s,
                          .height_m = its.height_m,
                          .azimuth_rad = its.azimuth_rad,
                          .range_m = its.range_m,
                          .ground_m = its.ground_m,
                          .is_of_top = its.is_of_top});
}

// All its points at one time: the mean of theirs.
void Tracker::finish(Group& group, const SweepReturns& sweep, const EgoMotion& ego) {
  if (group.points.empty()) {
    return;
  }
  const std::int64_t since_ns = group.time_ns / static_cast<std::int64_t>(group.points.size());
  group.time_ns = sweep.begin_ns + since_ns;
  if (group.owner != kNobody) {
    const Eigen::Vector2d velocity =
        objects_[static_cast<std::size_t>(group.owner)].track.velocity_mps();
    for (ObjectPoint& point : group.points) {
      point.place_m +=
          (1e-9 * static_cast<double>(since_ns) - static_cast<double>(point.time_s)) * velocity;
    }
  }
  const auto pose = ego.at(group.time_ns);
  group.view = {.points = group.points,
                .sensor_m = pose->position_m + sweep.mount_forward_m * direction(pose->heading_rad),
                .spread_rad = sweep.spread_rad,
                .sensor_heading_rad = pose->heading_rad};
}

// Step 3: unassigned groups and remaining tracks.
void Tracker::associate() {
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t group = 0; group < groups_.size(); ++group) {
    const Group& its = groups_[group];
    if (its.owner != kNobody || its.points.size() < kTracker.returns_seen) {
      continue;
    }
    for (std::size_t index = 0; index < objects_.size(); ++index) {
      const Track& track = objects_[index].track;
      if (is_seen_[index] ||
          (its.points[0].place_m - track.center_m()).norm() > kTracker.nearby_m) {
        continue;
      }
      Track expected = track;
      expected.predict(its.time_ns);
      const double distance2 = expected.distance2(its.view, skyline_);
      if (distance2 < kTracker.gate && can_reach(objects_[index], its)) {
        pairs.emplace_back(distance2, index, group);
      }
    }
  }
  std::ranges::sort(pairs);
  for (const auto& [distance2, index, group] : pairs) {
    if (!is_seen_[index] && groups_[group].owner == kNobody) {
      is_seen_[index] = true;
      groups_[group].owner = static_cast<int>(index);
      sight(objects_[index], groups_[group]);
    }
  }
}

// The uncertainty of what was long hidden spans other vehicles: one of them must not become it.
bool Tracker::can_reach(const TrackedObject& object, const Group& group) const {
  const double unseen_s = static_cast<double>(group.time_ns - object.seen_ns) * 1e-9;
  if (unseen_s < config_.hidden_short_s) {
    return true;
  }
  const double most_m = config_.hidden_speed_error_mps * unseen_s +
                        0.5 * config_.hidden_acceleration_mps2 * unseen_s * unseen_s;
  return std::ranges::any_of(group.points, [&](const ObjectPoint& point) {
    const Eigen::Vector2d place = box_place(object, group.time_ns, point.place_m);
    return std::hypot(std::max(0.0, std::abs(place.x()) - 0.5 * object.track.length_m()),
                      std::max(0.0, std::abs(place.y()) - 0.5 * object.track.width_m())) < most_m;
  });
}

void Tracker::sight(TrackedObject& object, const Group& group) {
  object.track.predict(group.time_ns);
  object.track.update(group.view, skyline_);
  if (object.track.length_m() > config_.low_length_max_m &&
      object.track.height_m() < kTracker.low_m) {
    object.track.cut(group.view.sensor_m);
  }
  object.seen_ns = group.time_ns;
  object.missed = 0;
  ++object.sightings;
  look_at(object, group);
  object.is_confirmed |= object.sightings >= static_cast<std::uint32_t>(config_.sightings_min);
}

void Tracker::look_at(TrackedObject& object, const Group& group) {
  object.vehicle_likeness *= kTracker.memory;
  object.two_wheeler_likeness *= kTracker.memory;
  Likeness likeness =
      likeness_of(shape_of(group.view, skyline_, high_places_, object.track.heading_rad()));
  if (likeness == Likeness::kVehicle && object.track.height_m() > kTracker.highest_m) {
    likeness = Likeness::kUnclear;  // It was seen to be higher.
  }
  const Track& track = object.track;
  const double before = object.vehicle_likeness;
  object.hollowness *= kTracker.memory;
  switch (likeness) {
    case Likeness::kVehicle:
      object.vehicle_likeness += 1.0;
      object.two_wheeler_likeness -= 1.0;
      break;
    case Likeness::kVehiclePart:
      object.vehicle_likeness += kTracker.part_weight;
      object.two_wheeler_likeness -= kTracker.part_weight;
      break;
    case Likeness::kTwoWheeler:
      // So does a car of which a part is hidden.
      object.vehicle_likeness -= 0.5;
      object.two_wheeler_likeness += 1.0;
      break;
    case Likeness::kNeither:
      object.vehicle_likeness -= 1.0;
      object.two_wheeler_likeness -= 1.0;
      break;
    case Likeness::kUnclear:
      break;
  }
  // A car is dense.
  if (object.vehicle_likeness > 0.0 && likeness != Likeness::kTwoWheeler &&
      likeness != Likeness::kNeither &&
      sight_lines_.is_seen_through(group.view,
                                   {.center_m = track.center_m(),
                                    .heading_rad = track.heading_rad(),
                                    .length_m = track.length_m(),
                                    .width_m = track.width_m()},
                                   {config_.track.length_m, config_.track.width_m})) {
    object.hollowness += object.vehicle_likeness - before + 1.0;
  }
}

void Tracker::begin_tracks() {
  // The larger first: what lies where its box is expected belongs to it.
  std::vector<std::pair<std::size_t, const Group*>> rest;
  for (std::size_t index = 0; index < groups_.size(); ++index) {
    const Group& group = groups_[index];
    if (group.owner == kNobody &&
        group.points.size() >= static_cast<std::size_t>(config_.returns_min)) {
      rest.emplace_back(index, &group);
    }
  }
  std::ranges::sort(rest, [](const auto& a, const auto& b) {
    return std::pair(b.second->points.size(), a.first) <
           std::pair(a.second->points.size(), b.first);
  });
  for (const auto& [index, its_group] : rest) {
    const Group& group = *its_group;
    Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
    float top_m = 0.0F;
    float bottom_m = std::numeric_limits<float>::infinity();
    for (const ObjectPoint& point : group.points) {
      center_m += point.place_m / static_cast<double>(group.points.size());
      top_m = std::max(top_m, point.height_m);
      bottom_m = std::min(bottom_m, point.height_m);
    }
    const bool is_known = std::ranges::any_of(objects_, [&](const TrackedObject& object) {
      const Eigen::Vector2d place = box_place(object, group.time_ns, center_m);
      return std::abs(place.x()) < 0.5 * object.track.length_m() + kTracker.margin_m &&
             std::abs(place.y()) < 0.5 * object.track.width_m() + kTracker.margin_m;
    });
    // A flat group is a roof, possibly of an object whose other parts are tracked.
    if (is_known || top_m < kTracker.top_m || top_m - bottom_m < kTracker.upright_m) {
      continue;
    }
    const double heading =
        first_heading(group.view, skyline_, center_m, group.view.sensor_heading_rad);
    const BoxView box = view_box(group.view, skyline_, center_m, heading);
    if (box.front.place_m - box.rear.place_m > config_.length_max_m ||
        box.left.place_m - box.right.place_m > config_.width_max_m) {
      continue;
    }
    TrackConfig track = config_.track;
    if (is_two_wheeler(group, heading)) {
      track.length_m = kTracker.two_wheeler_length_m;
      track.length_stddev_m = 0.3;
      track.width_m = kTracker.two_wheeler_width_m;
      track.width_stddev_m = 0.15;
    }
    TrackedObject object{.id = next_id_++, .track = Track(track, group.time_ns, center_m, heading)};
    sight(object, group);
    objects_.push_back(std::move(object));
  }
}

// It looks like one, and nothing hides more of it.
bool Tracker::is_two_wheeler(const Group& group, double heading_rad) const {
  if (group.points.size() < kTracker.returns_two_wheeler ||
      likeness_of(shape_of(group.view, skyline_, high_places_, heading_rad)) !=
          Likeness::kTwoWheeler) {
    return false;
  }
  const double sight_rad = group.points.front().azimuth_rad;
  const auto from_sight = [sight_rad](const ObjectPoint& a, const ObjectPoint& b) {
    return std::remainder(a.azimuth_rad - sight_rad, 2.0 * std::numbers::pi) <
           std::remainder(b.azimuth_rad - sight_rad, 2.0 * std::numbers::pi);
  };
  const auto [right, left] = std::ranges::minmax_element(group.points, from_sight);
  return !skyline_.is_hidden_beside(right->azimuth_rad, right->range_m, -1) &&
         !skyline_.is_hidden_beside(left->azimuth_rad, left->range_m, 1);
}

void Tracker::forget(std::int64_t time_ns, const SweepReturns* sweep, const EgoMotion* ego) {
  std::erase_if(objects_, [&](const TrackedObject& object) {
    const double unseen_s = static_cast<double>(time_ns - object.seen_ns) * 1e-9;
    if (object.track.length_m() > config_.length_max_m ||
        object.track.width_m() > config_.width_max_m) {
      return true;  // Two that were taken for one, or no vehicle.
    }
    if (object.missed == 0) {
      return false;
    }
    if (!object.is_confirmed) {
      return object.missed > 1;
    }
    if (sweep == nullptr) {
      return unseen_s > config_.hidden_max_s;
    }
    const auto pose = ego->at(time_ns);
    const double passed_s = static_cast<double>(time_ns - object.track.time_ns()) * 1e-9;
    const Eigen::Vector2d apart = object.track.center_m() + passed_s * object.track.velocity_mps() -
                                  pose->position_m -
                                  sweep->mount_forward_m * direction(pose->heading_rad);
    const double range = apart.norm();
    const double azimuth = std::atan2(apart.y(), apart.x()) - pose->heading_rad;
    const double half_width = std::atan2(0.5 * object.track.width_m(), range);
    const bool is_hidden =
        skyline_.hidden_share(azimuth, half_width, range - 0.5 * object.track.width_m()) > 0.5;
    return range > config_.clustering.range_max_m ||
           unseen_s > (is_hidden ? config_.hidden_max_s : config_.open_max_s);
  });
}

// Two tracks of one object: the one that was seen more often stays.
void Tracker::remove_doubles() {
  std::vector<bool> is_double(objects_.size(), false);
  for (std::size_t one = 0; one < objects_.size(); ++one) {
    for (std::size_t other = 0; other < objects_.size(); ++other) {
      const bool is_elder = std::pair(objects_[one].sightings, objects_[other].id) >
                            std::pair(objects_[other].sightings, objects_[one].id);
      if (one == other || !is_elder || is_double[one]) {
        continue;
      }
      const Track& younger = objects_[other].track;
      const Eigen::Vector2d place = box_place(objects_[one], younger.time_ns(), younger.center_m());
      const Track& elder = objects_[one].track;
      if (std::abs(place.x()) < 0.5 * elder.length_m() &&
          std::abs(place.y()) < 0.5 * elder.width_m()) {
        is_double[other] = true;
      }
    }
  }
  std::size_t index = 0;
  std::erase_if(objects_, [&](const TrackedObject&) { return is_double[index++]; });
}

}  // namespace ads
