#include "traffic.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ads {
namespace {

// The Intelligent Driver Model, with the values that its authors give for cars on a highway, but
// for the time gap: that of the recorded drivers.
constexpr double kTimeGap_s = 1.0;
constexpr double kStandingGap_m = 2.0;
constexpr double kAcceleration_mps2 = 1.5;
constexpr double kBraking_mps2 = 2.0;
constexpr double kHardestBraking_mps2 = 8.0;

// A car that would have to brake harder than this, to stay behind by `kCloseGap_m`, would hit what
// is ahead.
constexpr double kReactionBraking_mps2 = 1.5;
constexpr double kCloseGap_m = 1.0;
// Objects farther beside the way are passed.
constexpr double kSideGap_m = 0.2;
constexpr double kTrembling_m = 0.5;
constexpr double kLookahead_m = 100.0;
// One drives behind what points in about the same direction.
constexpr double kSameDirection_rad = 1.05;

// Whether steps are missing between the states, and it cannot have moved from one to the other: a
// simulation took it away and put it elsewhere.
bool is_jump(const ScenarioState& before, const ScenarioState& after, double step_s) {
  constexpr double kFactor = 2.0;
  constexpr double kMargin_m = 2.0;
  const auto steps = after.step - before.step;
  const double way_m =
      std::max(before.speed_mps, after.speed_mps) * static_cast<double>(steps) * step_s;
  return steps > 1 && (after.position_m - before.position_m).norm() > kFactor * way_m + kMargin_m;
}

double height_of(const Obstacle& obstacle) {
  if (obstacle.type == "pedestrian") {
    return 1.75;
  }
  if (obstacle.type == "bicycle" || obstacle.type == "motorcycle") {
    return 1.7;
  }
  // Recordings call trucks cars, too.
  if (obstacle.type == "truck" || obstacle.type == "bus" || obstacle.length_m > 7.0) {
    return 3.5;
  }
  return 1.5;
}

double model_acceleration(double speed_mps, double wish_mps, double gap_m, double leader_mps) {
  const double free = 1.0 - std::pow(speed_mps / wish_mps, 4.0);
  const double wanted_m =
      kStandingGap_m + std::max(0.0, speed_mps * kTimeGap_s +
                                         speed_mps * (speed_mps - leader_mps) /
                                             (2.0 * std::sqrt(kAcceleration_mps2 * kBraking_mps2)));
  const double near = wanted_m / std::max(gap_m, 0.1);
  return std::max(-kHardestBraking_mps2, kAcceleration_mps2 * (free - near * near));
}

}  // namespace

Recording::Recording(const Obstacle& obstacle, double step_s, double start_s)
    : is_static_(obstacle.is_static),
      is_there_before_(static_cast<double>(obstacle.states.front().step) * step_s <= start_s),
      states_(obstacle.states) {
  // The recorded position of a standing object jitters: that is not a way, and its last piece has
  // an arbitrary direction.
  std::vector<Eigen::Vector2d> points;
  double length_m = 0.0;
  for (const ScenarioState& state : states_) {
    times_s_.push_back(static_cast<double>(state.step) * step_s);
    const double moved_m = points.empty() ? 0.0 : (state.position_m - points.back()).norm();
    progress_m_.push_back(
        std::max(progress_m_.empty() ? 0.0 : progress_m_.back(), length_m + moved_m));
    if (points.empty() || moved_m >= kTrembling_m) {
      length_m += moved_m;
      points.push_back(state.position_m);
    }
    speed_max_mps_ = std::max(speed_max_mps_, state.speed_mps);
  }
  for (std::size_t i = 0; i + 1 < states_.size(); ++i) {
    jumps_.push_back(is_jump(states_[i], states_[i + 1], step_s));
  }
  if (length_m > 1.0) {
    way_.emplace(points);
  }
}

bool Recording::is_present(double time_s) const {
  // Times are sums of decimal fractions: half a microsecond is no time.
  constexpr double kSameTime = 5e-7;
  if (!is_static_ && states_.size() > 1) {
    const std::size_t index = index_at(times_s_, time_s);
    if (jumps_[index] && time_s > times_s_[index] + kSameTime &&
        time_s < times_s_[index + 1] - kSameTime) {
      return false;
    }
  }
  return (is_there_before_ || time_s >= times_s_.front() - kSameTime) &&
         (is_static_ || time_s <= times_s_.back() + kSameTime);
}

Recording::Pose Recording::at(double time_s) const {
  if (time_s < times_s_.front() || states_.size() == 1) {
    const ScenarioState& first = states_.front();
    const double before_s = std::min(0.0, time_s - times_s_.front());
    const double speed_mps = is_static_ ? 0.0 : first.speed_mps;
    return {.position_m = first.position_m + speed_mps * before_s * direction(first.heading_rad),
            .heading_rad = first.heading_rad,
            .speed_mps = speed_mps};
  }
  const std::size_t index = index_at(times_s_, time_s);
  const double share = (time_s - times_s_[index]) / (times_s_[index + 1] - times_s_[index]);
  return between(index, std::clamp(share, 0.0, 1.0));
}

double Recording::progress_m(double time_s) const {
  if (time_s <= times_s_.front() || states_.size() == 1) {
    return states_.front().speed_mps * std::min(0.0, time_s - times_s_.front());
  }
  const std::size_t index = index_at(times_s_, time_s);
  const double share = (time_s - times_s_[index]) / (times_s_[index + 1] - times_s_[index]);
  return progress_m_[index] +
         std::clamp(share, 0.0, 1.0) * (progress_m_[index + 1] - progress_m_[index]);
}

Recording::Pose Recording::at_progress(double progress_m) const {
  if (states_.size() == 1 || progress_m <= 0.0 || progress_m >= progress_m_.back()) {
    const std::size_t end = progress_m <= 0.0 ? 0 : states_.size() - 1;
    const ScenarioState& state = states_[end];
    return {.position_m =
                state.position_m + (progress_m - progress_m_[end]) * direction(state.heading_rad),
            .heading_rad = state.heading_rad,
            .speed_mps = state.speed_mps};
  }
  const std::size_t index = index_at(progress_m_, progress_m);
  return between(index,
                 (progress_m - progress_m_[index]) / (progress_m_[index + 1] - progress_m_[index]));
}

Recording::Pose Recording::between(std::size_t index, double share) const {
  const ScenarioState& before = states_[index];
  const ScenarioState& after = states_[index + 1];
  const double turn_rad = normalize_angle(after.heading_rad - before.heading_rad);
  return {.position_m = before.position_m + share * (after.position_m - before.position_m),
          .heading_rad = normalize_angle(before.heading_rad + share * turn_rad),
          .speed_mps = before.speed_mps + share * (after.speed_mps - before.speed_mps),
          .yaw_rate_radps = turn_rad / (times_s_[index + 1] - times_s_[index])};
}

// The last index whose value is at most `value`, with one more after it.
std::size_t Recording::index_at(const std::vector<double>& values, double value) const {
  const auto after = std::ranges::upper_bound(values, value);
  return std::clamp<std::size_t>(static_cast<std::size_t>(after - values.begin()), 1,
                                 values.size() - 1) -
         1;
}

Traffic::Traffic(const Scenario& scenario, double start_s, TrafficMode mode)
    : start_s_(start_s), mode_(mode), time_s_(start_s), end_s_(start_s) {
  for (const Obstacle& obstacle : scenario.obstacles) {
    vehicles_.push_back(
        {.body = {.id = obstacle.id,
                  .box = {.length_m = obstacle.length_m, .width_m = obstacle.width_m},
                  .height_m = height_of(obstacle)},
         .is_static = obstacle.is_static,
         .recording = Recording(obstacle, scenario.step_s, start_s)});
    if (!obstacle.is_static) {
      end_s_ = std::max(end_s_, static_cast<double>(obstacle.states.back().step) * scenario.step_s);
    }
  }
}

void Traffic::move_to(double time_s, const Box& ego, double ego_speed_mps) {
  const double seconds = time_s - time_s_;
  for (Vehicle& vehicle : vehicles_) {
    if (!vehicle.recording.is_present(time_s)) {
      continue;
    }
    if (mode_ == TrafficMode::kReactive && time_s > start_s_ && !vehicle.following) {
      react(vehicle, time_s_, ego, ego_speed_mps);
    }
    if (vehicle.following) {
      follow(vehicle, seconds, ego, ego_speed_mps);
    }
  }
  // All leaders were evaluated at the previous positions: now the vehicles move.
  time_s_ = time_s;
  bodies_.clear();
  for (Vehicle& vehicle : vehicles_) {
    if (!vehicle.recording.is_present(time_s)) {
      vehicle.following.reset();
      continue;
    }
    Recording::Pose pose = vehicle.following
                               ? vehicle.recording.at_progress(vehicle.following->progress_m)
                               : vehicle.recording.at(time_s);
    if (vehicle.following) {
      // It turns as its way does, at its own speed.
      pose.yaw_rate_radps *=
          pose.speed_mps > 0.1 ? vehicle.following->speed_mps / pose.speed_mps : 0.0;
      pose.speed_mps = vehicle.following->speed_mps;
    }
    vehicle.body.box.center_m = pose.position_m;
    vehicle.body.box.heading_rad = pose.heading_rad;
    vehicle.body.speed_mps = pose.speed_mps;
    vehicle.body.yaw_rate_radps = pose.yaw_rate_radps;
    bodies_.push_back(vehicle.body);
  }
}

std::size_t Traffic::reacting() const {
  return static_cast<std::size_t>(std::ranges::count_if(
      vehicles_, [](const Vehicle& vehicle) { return vehicle.following.has_value(); }));
}

// Has `vehicle` leave its recording, if it would run into the ego vehicle or one that follows it.
void Traffic::react(Vehicle& vehicle, double time_s, const Box& ego, double ego_speed_mps) const {
  if (vehicle.is_static || !vehicle.recording.way() || !vehicle.recording.is_present(time_s)) {
    return;
  }
  const double progress_m = vehicle.recording.progress_m(time_s);
  const auto leader = leader_of(vehicle, progress_m, ego, ego_speed_mps);
  if (!leader) {
    return;
  }
  const double speed_mps = vehicle.recording.at(time_s).speed_mps;
  const double closing_mps = speed_mps - leader->speed_mps;
  const double room_m = std::max(leader->gap_m - kCloseGap_m, 0.01);
  if (closing_mps > 0.0 && closing_mps * closing_mps / (2.0 * room_m) > kReactionBraking_mps2) {
    vehicle.following = {.progress_m = progress_m, .speed_mps = speed_mps};
  }
}

void Traffic::follow(Vehicle& vehicle, double seconds, const Box& ego, double ego_speed_mps) const {
  Following& following = *vehicle.following;
  const auto leader = leader_of(vehicle, following.progress_m, ego, ego_speed_mps);
  const double acceleration =
      model_acceleration(following.speed_mps, std::max(vehicle.recording.speed_max_mps(), 1.0),
                         leader ? leader->gap_m : std::numeric_limits<double>::infinity(),
                         leader ? leader->speed_mps : following.speed_mps);
  const double speed_mps = std::max(0.0, following.speed_mps + acceleration * seconds);
  following.progress_m += (following.speed_mps + speed_mps) / 2.0 * seconds;
  following.speed_mps = speed_mps;
}

std::optional<Traffic::Leader> Traffic::leader_of(const Vehicle& vehicle, double progress_m,
                                                  const Box& ego, double ego_speed_mps) const {
  const Polyline& way = *vehicle.recording.way();
  const Box& own = vehicle.body.box;
  std::optional<Leader> nearest;
  const auto look_at = [&](const Box& other, double speed_mps) {
    const Eigen::Vector2d away_m = other.center_m - own.center_m;
    if (away_m.norm() > kLookahead_m || away_m.dot(direction(own.heading_rad)) < 0.0) {
      return;
    }
    const Polyline::Projection place = way.project(other.center_m);
    const double turned_rad = normalize_angle(other.heading_rad - way.heading_at(place.along_m));
    // Of the other box, as the way sees it.
    const double across = std::abs(std::sin(turned_rad));
    const double along = std::abs(std::cos(turned_rad));
    const double half_length_m = (along * other.length_m + across * other.width_m) / 2.0;
    const double half_width_m = (across * other.length_m + along * other.width_m) / 2.0;
    const double rear_m = place.along_m - half_length_m;
    if (place.along_m <= progress_m || rear_m > way.length_m() + own.length_m ||
        std::abs(place.offset_m) > half_width_m + own.width_m / 2.0 + kSideGap_m) {
      return;
    }
    // A car that follows its recording only considers what it would hit from behind.
    if (!vehicle.following && std::abs(turned_rad) > kSameDirection_rad) {
      return;
    }
    const Leader leader{.gap_m = rear_m - progress_m - own.length_m / 2.0,
                        .speed_mps = std::max(0.0, speed_mps * std::cos(turned_rad))};
    if (!nearest || leader.gap_m < nearest->gap_m) {
      nearest = leader;
    }
  };
  look_at(ego, ego_speed_mps);
  for (const Vehicle& other : vehicles_) {
    if (&other != &vehicle && other.recording.is_present(time_s_) &&
        (vehicle.following || other.following)) {
      look_at(other.body.box, other.body.speed_mps);
    }
  }
  return nearest;
}

}  // namespace ads
