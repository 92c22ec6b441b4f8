#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include <fastcycle/fastcycle.h>

#include "connectivity/hazard.pb.h"
#include "hd_map/map.pb.h"
#include "lane_map.h"
#include "localization/ego.pb.h"
#include "perception/objects.pb.h"
#include "scene/scene.pb.h"
#include "situation.h"

namespace ads {

/// Relates the surrounding objects to the vehicle's route.
///
/// In:   `perception/objects`, `map/tile`, `map/route`, `localization/ego` (history),
///       `connectivity/hazard`
/// Out:  `scene/scene`, for each `perception/objects`
class SceneUnderstanding final : public fastcycle::Component {
 public:
  explicit SceneUnderstanding(fastcycle::Context& context);

 private:
  void take(const connectivity::Hazard& hazard);
  void judge(const perception::Objects& objects);
  // The ego's state at that time: the closest known one, extrapolated straight.
  [[nodiscard]] std::optional<EgoState> ego_at(std::int64_t time_ns) const;
  void fill_hazards(const std::optional<Situation>& situation, scene::Scene& scene);

  fastcycle::Param<double> ego_length_m_;
  fastcycle::Param<double> reach_s_;
  fastcycle::Param<double> reach_min_m_;
  fastcycle::History<localization::Ego> egos_;
  fastcycle::Publisher<scene::Scene> scenes_;

  LaneMap lanes_;
  std::optional<RouteFrame> route_;
  std::int64_t ego_lane_ = 0;
  std::map<std::uint64_t, std::int64_t> object_lanes_;  // By the object's id.
  std::map<std::uint64_t, connectivity::Hazard> hazards_;
};

}  // namespace ads
