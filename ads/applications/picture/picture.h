#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <fastcycle/fastcycle.h>

#include "drive_picture.h"
#include "hd_map/map.pb.h"
#include "localization/ego.pb.h"
#include "mission/goal.pb.h"
#include "perception/objects.pb.h"
#include "planning/plan.pb.h"
#include "supervision/state.pb.h"

namespace ads {

/// Draws the drive when it has ended.
///
/// In:   `localization/ego`, `perception/objects`, `planning/checked_plan`, `supervision/state`,
///       `mission/goal`, `map/tile`
/// Out:  the file `file`, at the end
class Picture final : public fastcycle::Component {
 public:
  explicit Picture(fastcycle::Context& context);
  void stop() override;

 private:
  // Enough for ten minutes at 10 Hz; the rest of a longer drive is not drawn.
  static constexpr std::size_t kMomentsMax = 6'000;
  static constexpr std::size_t kEventsMax = 1'000;

  /// Since autonomous driving was requested, once that is known.
  [[nodiscard]] double seconds() const;
  void on_ego(const localization::Ego& ego);
  void on_objects(const perception::Objects& objects);
  void on_plan(const planning::Plan& plan);
  void on_state(const supervision::State& state);
  void on_goal(const mission::Goal& goal);
  void on_tile(const hd_map::Tile& tile);

  fastcycle::Param<fastcycle::Path> file_;
  fastcycle::Param<std::string> title_;
  fastcycle::Param<double> ego_length_m_;
  fastcycle::Param<double> ego_width_m_;

  DrivePicture picture_;
  std::map<std::int64_t, DrivePicture::Lane> lanes_;
  std::optional<localization::Ego> ego_;
  std::optional<fastcycle::Time> engage_at_;
  supervision::State state_;
  std::vector<Eigen::Vector2d> plan_path_;
};

}  // namespace ads
