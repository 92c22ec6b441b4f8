#include "scene_understanding.h"

#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "scene_understanding_tuning.h"

namespace ads {
namespace {}  // namespace

SceneUnderstanding::SceneUnderstanding(fastcycle::Context& context)
    : Component(context),
      ego_length_m_(context.param<double>("ego_length_m", {.fallback = 4.508,
                                                           .min = 0.1,
                                                           .max = 30.0,
                                                           .unit = "m",
                                                           .description = "Of the own vehicle"})),
      reach_s_(context.param<double>(
          "reach_s",
          {.fallback = 8.0,
           .min = 1.0,
           .max = 60.0,
           .unit = "s",
           .description = "Objects that the vehicle can reach within this time are relevant"})),
      reach_min_m_(context.param<double>(
          "reach_min_m",
          {.fallback = 50.0,
           .min = 5.0,
           .max = 1'000.0,
           .unit = "m",
           .description = "Objects within this distance are relevant at any speed"})),
      egos_(context.create_history<localization::Ego>("localization/ego", {.depth = 64})),
      scenes_(context.create_publisher<scene::Scene>("scene/scene")) {
  context.create_subscriber<hd_map::Tile>(
      "map/tile", [this](const hd_map::Tile& tile) { lanes_ = LaneMap(tile); });
  context.create_subscriber<hd_map::Route>(
      "map/route", [this](const hd_map::Route& route) { route_ = RouteFrame::of(route); });
  context.create_subscriber<connectivity::Hazard>(
      "connectivity/hazard", [this](const connectivity::Hazard& hazard) { take(hazard); });
  context.create_subscriber<perception::Objects>("perception/objects", {.depth = 1},
                                                 [this](const perception::Objects& objects) {
                                                   // An invalid sweep would make the road look
                                                   // empty: better to publish nothing.
                                                   if (objects.is_sweep_valid()) {
                                                     judge(objects);
                                                   }
                                                 });
}

void SceneUnderstanding::take(const connectivity::Hazard& hazard) {
  if (hazard.is_cancelled()) {
    hazards_.erase(hazard.id());
    return;
  }
  hazards_[hazard.id()] = hazard;
  if (hazards_.size() > kSceneUnderstanding.hazards_max) {
    hazards_.erase(std::prev(hazards_.end()));
  }
}

std::optional<EgoState> SceneUnderstanding::ego_at(std::int64_t time_ns) const {
  std::int64_t least_ns = kSceneUnderstanding.ego_age_max_ns + 1;
  fastcycle::Sample<localization::Ego> closest;
  for (std::size_t index = 0; index < egos_.size(); ++index) {
    auto ego = egos_[index];
    const std::int64_t away_ns = std::abs(ego->header().taken_ns() - time_ns);
    if (away_ns < least_ns && ego->quality() != localization::INITIALIZING) {
      least_ns = away_ns;
      closest = std::move(ego);
    }
  }
  if (!closest) {
    return std::nullopt;
  }
  const double later_s = static_cast<double>(time_ns - closest->header().taken_ns()) * 1e-9;
  return EgoState{.position_m = Eigen::Vector2d(closest->x_m(), closest->y_m()) +
                                later_s * closest->speed_mps() * direction(closest->heading_rad()),
                  .heading_rad = closest->heading_rad() + later_s * closest->yaw_rate_radps(),
                  .speed_mps = closest->speed_mps()};
}

void SceneUnderstanding::judge(const perception::Objects& objects) {
  auto scene = scenes_.loan();
  scene->mutable_header()->CopyFrom(objects.header());
  const auto ego = ego_at(objects.header().taken_ns());
  std::optional<RouteFrame> straight;
  std::optional<Situation> situation;
  if (ego) {
    const auto place = lanes_.match(ego->position_m, ego->heading_rad, ego->speed_mps, ego_lane_,
                                    route_ ? route_->lanes() : std::set<std::int64_t>());
    ego_lane_ = place ? place->lane : 0;
    scene->set_ego_lane(ego_lane_);
    scene->set_ego_offset_m(place ? place->offset_m : 0.0);
    if (!route_) {
      straight.emplace(*ego);
    }
    situation.emplace(lanes_, route_ ? *route_ : *straight, *ego, ego_lane_,
                      SituationOptions{.ego_length_m = ego_length_m_.get(),
                                       .reach_s = reach_s_.get(),
                                       .reach_min_m = reach_min_m_.get()});
  }
  std::map<std::uint64_t, std::int64_t> object_lanes;
  for (const perception::Object& object : objects.objects()) {
    auto& judged = *scene->add_objects();
    judged.mutable_object()->CopyFrom(object);
    const auto known = object_lanes_.find(object.id());
    const auto place =
        lanes_.match({object.x_m(), object.y_m()}, object.heading_rad(), object.speed_mps(),
                     known == object_lanes_.end() ? 0 : known->second);
    object_lanes[object.id()] = place ? place->lane : 0;
    if (situation) {
      situation->judge(object, place, judged);
    } else {
      // Where the ego is, is not known: anything may matter.
      judged.set_is_relevant(true);
      judged.set_gap_m(std::numeric_limits<double>::quiet_NaN());
    }
  }
  object_lanes_ = std::move(object_lanes);
  fill_hazards(situation, *scene);
  scenes_.publish(std::move(scene));
}

void SceneUnderstanding::fill_hazards(const std::optional<Situation>& situation,
                                      scene::Scene& scene) {
  const std::int64_t now_ns = now().time_since_epoch().count();
  std::erase_if(hazards_, [&](const auto& entry) {
    const std::int64_t until_ns = entry.second.valid_until_ns();
    return until_ns != 0 && until_ns <= now_ns;
  });
  for (const auto& [id, hazard] : hazards_) {
    if (!situation || situation->is_ahead(hazard)) {
      scene.add_hazards()->CopyFrom(hazard);
    }
  }
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::SceneUnderstanding)
