#include "predictor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/scalar.h"
#include "prediction_tuning.h"

namespace ads {
namespace {

double blend(double share) {
  const double x = std::clamp(share, 0.0, 1.0);
  return x * x * x * (10.0 + x * (-15.0 + 6.0 * x));
}

double blend_slope(double share) {
  const double x = std::clamp(share, 0.0, 1.0);
  return 30.0 * squared(x * (1.0 - x));
}

void sort_by_probability(prediction::PredictedObject& predicted) {
  // A few; equal ones stay in their order.
  auto& list = *predicted.mutable_hypotheses();
  for (int end = 1; end < list.size(); ++end) {
    for (int at = end; at > 0 && list[at].probability() > list[at - 1].probability(); --at) {
      list.SwapElements(at, at - 1);
    }
  }
}

}  // namespace

std::size_t Predictor::steps() const {
  return static_cast<std::size_t>(std::lround(options_.horizon_s / options_.step_s));
}

void Predictor::predict(const scene::Scene& scene, prediction::Predictions& predictions) const {
  predictions.set_horizon_s(options_.horizon_s);
  predictions.set_step_s(options_.step_s);
  std::vector<Track> tracks;
  for (const scene::SceneObject& object : scene.objects()) {
    tracks.push_back(begin(object));
  }
  find_leaders(tracks);
  drive(tracks);
  for (const Track& track : tracks) {
    auto& predicted = *predictions.add_objects();
    predicted.mutable_object()->CopyFrom(*track.source);
    add_hypotheses(track, predicted);
  }
  for (const connectivity::Hazard& hazard : scene.hazards()) {
    predictions.add_hazards()->CopyFrom(hazard);
  }
}

Predictor::Track Predictor::begin(const scene::SceneObject& object) const {
  Track track{.source = &object, .along_m = object.along_m()};
  if (lanes_.has(object.lane())) {
    const double speed_mps = std::max(0.0, object.object().speed_mps());
    const double reach_m = speed_mps * options_.horizon_s +
                           0.5 * kPredictor.speeding_up_mps2 * squared(options_.horizon_s);
    track.paths = lanes_.from(object.lane(), track.along_m + reach_m + kPredictor.leader_ahead_m);
  }
  return track;
}

void Predictor::find_leaders(std::vector<Track>& tracks) const {
  for (Track& track : tracks) {
    if (track.paths.empty()) {
      continue;
    }
    const perception::Object& own = track.source->object();
    double least_m = kPredictor.leader_ahead_m;
    for (std::size_t index = 0; index < tracks.size(); ++index) {
      const Track& other = tracks[index];
      const auto begin_m = track.paths.front().begin_of(other.source->lane());
      if (&other == &track || !begin_m) {
        continue;
      }
      const double ahead_m = *begin_m + other.along_m - track.along_m;
      if (ahead_m > 0.0 && ahead_m < least_m) {
        least_m = ahead_m;
        track.leader = index;
        track.gap_m = ahead_m - (own.length_m() + other.source->object().length_m()) / 2.0;
      }
    }
  }
}

void Predictor::drive(std::vector<Track>& tracks) const {
  for (Track& track : tracks) {
    track.way_m.assign(1, 0.0);
    track.speed_mps.assign(1, std::max(0.0, track.source->object().speed_mps()));
  }
  std::vector<double> accelerations(tracks.size());
  for (std::size_t step = 0; step < steps(); ++step) {
    for (std::size_t index = 0; index < tracks.size(); ++index) {
      accelerations[index] = acceleration(tracks[index], tracks, step);
    }
    for (std::size_t index = 0; index < tracks.size(); ++index) {
      Track& track = tracks[index];
      const double before_mps = track.speed_mps.back();
      const double after_mps = std::max(0.0, before_mps + accelerations[index] * options_.step_s);
      track.way_m.push_back(track.way_m.back() + (before_mps + after_mps) / 2.0 * options_.step_s);
      track.speed_mps.push_back(after_mps);
    }
  }
}

double Predictor::acceleration(const Track& track, const std::vector<Track>& tracks,
                               std::size_t step) const {
  const double time_s = static_cast<double>(step) * options_.step_s;
  const double speed_mps = track.speed_mps[step];
  double free_mps2 =
      std::clamp(track.source->object().acceleration_mps2(), -kPredictor.acceleration_max_mps2,
                 kPredictor.acceleration_max_mps2) *
      std::exp(-time_s / kPredictor.acceleration_decay_s);
  const double speeding_up_mps2 =
      std::clamp(track.source->object().acceleration_mps2(), 0.0, kPredictor.speeding_up_mps2);
  free_mps2 = std::max(free_mps2,
                       speeding_up_mps2 *
                           std::max(0.0, 1.0 - squared(speed_mps / kPredictor.speeding_up_to_mps)) *
                           std::exp(-time_s / kPredictor.speeding_up_decay_s));
  if (track.speed_mps.front() < kPredictor.standing_mps) {
    free_mps2 = speed_mps < kPredictor.start_mps ? kPredictor.start_mps2 : 0.0;
  }
  if (!track.leader) {
    return free_mps2;
  }
  const Track& leader = tracks[*track.leader];
  const double closing_mps = speed_mps - leader.speed_mps[step];
  if (closing_mps <= 0.0) {
    return free_mps2;
  }
  // As gently as is enough to keep the distance, if the leader goes on as it drives then.
  const double gap_m = track.gap_m + leader.way_m[step] - track.way_m[step];
  const double left_m = std::max(kPredictor.gap_min_m, gap_m - options_.distance_min_m);
  return std::max(-kPredictor.braking_mps2,
                  std::min(free_mps2, -squared(closing_mps) / (2.0 * left_m)));
}

void Predictor::add_hypotheses(const Track& track, prediction::PredictedObject& predicted) const {
  const perception::Object& object = track.source->object();
  const bool stands = std::abs(object.speed_mps()) < kPredictor.standing_mps;
  double left = 1.0;
  if (stands) {
    auto& standing = *predicted.add_hypotheses();
    standing.set_probability(track.paths.empty() ? 1.0 : kPredictor.standing_probability);
    left -= standing.probability();
    stand(object, standing);
  }
  if (track.paths.empty()) {
    if (!stands) {
      auto& turning = *predicted.add_hypotheses();
      turning.set_probability(1.0);
      turn(object, turning);
    }
    return;
  }
  const LanePath& path = track.paths.front();
  const double slant_rad =
      normalize_angle(object.heading_rad() - path.line.heading_at(track.along_m));
  if (!stands) {
    auto& turning = *predicted.add_hypotheses();
    turning.set_probability(kPredictor.turn_probability);
    left -= kPredictor.turn_probability;
    turn(object, turning);
    left = add_changes(track, slant_rad, left, predicted);
  }
  add_following(track, slant_rad, left, predicted);
  sort_by_probability(predicted);
}

void Predictor::add_following(const Track& track, double slant_rad, double probability,
                              prediction::PredictedObject& predicted) const {
  struct Way {
    LanePath path;
    double weight;
    double along_m;
    double offset_m;
    double slant_rad;
  };
  std::vector<Way> ways;
  for (const LanePath& path : track.paths) {
    ways.push_back({path, 1.0, track.along_m, track.source->offset_m(), slant_rad});
  }
  const perception::Object& object = track.source->object();
  for (const std::int64_t fork : lanes_.forks_of(track.source->lane())) {
    const Polyline line = lanes_.from(fork, 0.0).front().line;
    const Polyline::Projection place = line.project({object.x_m(), object.y_m()});
    const double other_rad = normalize_angle(object.heading_rad() - line.heading_at(place.along_m));
    if (std::abs(place.offset_m) > kPredictor.fork_offset_m ||
        std::abs(other_rad) > kPredictor.fork_slant_rad) {
      continue;
    }
    for (const LanePath& path : lanes_.from(
             fork, std::max(0.0, place.along_m) + track.way_m.back() + kPredictor.leader_ahead_m)) {
      ways.push_back({path, kPredictor.fork_weight, place.along_m, place.offset_m, other_rad});
    }
  }
  double sum = 0.0;
  for (const Way& way : ways) {
    sum += way.weight;
  }
  for (const Way& way : ways) {
    auto& following = *predicted.add_hypotheses();
    following.set_kind(prediction::LANE_FOLLOWING);
    following.set_probability(probability * way.weight / sum);
    follow(track, way.path, way.along_m,
           {.begin_m = way.offset_m, .speed_mps = object.speed_mps() * std::sin(way.slant_rad)},
           following);
  }
}

double Predictor::add_changes(const Track& track, double slant_rad, double probability,
                              prediction::PredictedObject& predicted) const {
  const perception::Object& object = track.source->object();
  const double across_mps = object.speed_mps() * std::sin(slant_rad);
  const double offset_m = track.source->offset_m() + kPredictor.change_ahead_s * across_mps;
  const bool is_left = offset_m > 0.0;
  const std::int64_t other = lanes_.beside(track.source->lane(), is_left);
  const double share =
      std::min(kPredictor.change_probability_max,
               1.0 / (1.0 + std::exp((kPredictor.change_offset_m - std::abs(offset_m)) /
                                     kPredictor.change_width_m)));
  if (other == 0 || share < kPredictor.change_probability_min) {
    return probability;
  }
  const double speed_mps = std::max(kPredictor.change_speed_mps, std::abs(across_mps));
  const Eigen::Vector2d position(object.x_m(), object.y_m());
  const Polyline::Projection place = lanes_.from(other, 0.0).front().line.project(position);
  const auto paths = lanes_.from(
      other, std::max(0.0, place.along_m) + track.way_m.back() + kPredictor.leader_ahead_m);
  for (const LanePath& path : paths) {
    auto& change = *predicted.add_hypotheses();
    change.set_kind(is_left ? prediction::LANE_CHANGE_LEFT : prediction::LANE_CHANGE_RIGHT);
    change.set_probability(probability * share / static_cast<double>(paths.size()));
    follow(track, path, place.along_m,
           {.begin_m = place.offset_m,
            .target_m = 0.0,
            .duration_s = std::clamp(std::abs(place.offset_m) / speed_mps, 1.5, 6.0)},
           change);
  }
  return probability * (1.0 - share);
}

void Predictor::follow(const Track& track, const LanePath& path, double along_m,
                       const Across& across, prediction::Hypothesis& hypothesis) const {
  const perception::Object& object = track.source->object();
  for (std::size_t step = 0; step <= steps(); ++step) {
    const double time_s = static_cast<double>(step) * options_.step_s;
    const double at_m = along_m + track.way_m[step];
    const double speed_mps = track.speed_mps[step];
    double offset_m = 0.0;
    double across_mps = 0.0;
    if (across.target_m) {
      const double share = time_s / across.duration_s;
      const double change_m = *across.target_m - across.begin_m;
      offset_m = across.begin_m + change_m * blend(share);
      across_mps = change_m * blend_slope(share) / across.duration_s;
    } else {
      const double rest = std::exp(-time_s / kPredictor.across_decay_s);
      offset_m = across.begin_m + across.speed_mps * kPredictor.across_decay_s * (1.0 - rest);
      across_mps = across.speed_mps * rest;
    }
    Eigen::Vector2d position = path.line.point_at(at_m, offset_m);
    if (!across.target_m) {
      // Lanes are mapped to decimetres, and no vehicle drives exactly along one: at first a
      // straight prediction is better.
      const double bend_rad =
          normalize_angle(path.line.heading_at(at_m) - path.line.heading_at(along_m));
      const double share =
          std::exp(-time_s / kPredictor.straight_s - squared(bend_rad / kPredictor.straight_rad));
      const Eigen::Vector2d straight = Eigen::Vector2d(object.x_m(), object.y_m()) +
                                       track.way_m[step] * direction(object.heading_rad());
      position = share * straight + (1.0 - share) * position;
    }
    prediction::Point& point = *hypothesis.add_points();
    point.set_time_s(time_s);
    point.set_x_m(position.x());
    point.set_y_m(position.y());
    const double slant_rad =
        speed_mps > kPredictor.standing_mps ? std::atan2(across_mps, speed_mps) : 0.0;
    point.set_heading_rad(normalize_angle(path.line.heading_at(at_m) + slant_rad));
    point.set_speed_mps(speed_mps);
    fill_stddevs(track.source->object(), time_s, true, point);
  }
}

void Predictor::turn(const perception::Object& object, prediction::Hypothesis& hypothesis) const {
  hypothesis.set_kind(prediction::CONSTANT_TURN);
  const double rate_radps = std::clamp(object.yaw_rate_radps(), -kPredictor.yaw_rate_max_radps,
                                       kPredictor.yaw_rate_max_radps);
  const double braking_mps2 = object.acceleration_mps2() < -kPredictor.brakes_on_mps2
                                  ? std::max(object.acceleration_mps2(), -kPredictor.braking_mps2)
                                  : 0.0;
  double speed_mps = object.speed_mps();
  Eigen::Vector2d position(object.x_m(), object.y_m());
  for (std::size_t step = 0; step <= steps(); ++step) {
    const double time_s = static_cast<double>(step) * options_.step_s;
    const double heading_rad = object.heading_rad() + rate_radps * time_s;
    prediction::Point& point = *hypothesis.add_points();
    point.set_time_s(time_s);
    point.set_x_m(position.x());
    point.set_y_m(position.y());
    point.set_heading_rad(normalize_angle(heading_rad));
    point.set_speed_mps(speed_mps);
    fill_stddevs(object, time_s, false, point);
    const double before_mps = speed_mps;
    if (braking_mps2 < 0.0) {
      speed_mps = std::max(0.0, before_mps + braking_mps2 *
                                                 std::exp(-time_s / kPredictor.brakes_on_decay_s) *
                                                 options_.step_s);
    }
    // Half a step on is the mean direction of the step.
    position += (before_mps + speed_mps) / 2.0 * options_.step_s *
                direction(heading_rad + rate_radps * options_.step_s / 2.0);
  }
}

void Predictor::stand(const perception::Object& object, prediction::Hypothesis& hypothesis) const {
  hypothesis.set_kind(prediction::STANDING);
  for (std::size_t step = 0; step <= steps(); ++step) {
    prediction::Point& point = *hypothesis.add_points();
    point.set_time_s(static_cast<double>(step) * options_.step_s);
    point.set_x_m(object.x_m());
    point.set_y_m(object.y_m());
    point.set_heading_rad(object.heading_rad());
    point.set_along_stddev_m(object.position_stddev_m());
    point.set_across_stddev_m(object.position_stddev_m());
  }
}

void Predictor::fill_stddevs(const perception::Object& object, double time_s, bool is_on_lane,
                             prediction::Point& point) const {
  const double speed_stddev = std::hypot(object.speed_stddev_mps(), options_.along_stddev_mps);
  point.set_along_stddev_m(std::hypot(object.position_stddev_m(), speed_stddev * time_s,
                                      0.5 * options_.along_stddev_mps2 * squared(time_s)));
  const double drift_m = options_.across_stddev_mps * time_s;
  const double heading_m = object.heading_stddev_rad() * std::abs(object.speed_mps()) * time_s;
  const double across_m =
      is_on_lane ? std::min(options_.across_stddev_max_m, std::hypot(drift_m, heading_m))
                 : std::hypot(drift_m, heading_m, 0.5 * drift_m * time_s);
  point.set_across_stddev_m(std::hypot(object.position_stddev_m(), across_m));
}

}  // namespace ads
