#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <fastcycle/fastcycle.h>

#include "lidar/sweep.pb.h"
#include "localization/ego.pb.h"
#include "perception/borders.pb.h"
#include "perception/objects.pb.h"
#include "perception/tracker_state.pb.h"
#include "recognizer.h"

namespace ads {

/// Detects and tracks moving and standing objects around the vehicle.
///
/// In:   `lidar/points`, `localization/ego` (history)
/// Out:  `perception/objects`, for each sweep; `perception/borders`, if enabled
/// Keeps: `tracker`, its complete state
class Perception : public fastcycle::Component {
 public:
  explicit Perception(fastcycle::Context& context);
  void stop() override;

 private:
  void save(perception::TrackerState& state) const;
  void load(const perception::TrackerState& state);
  void on_sweep(const lidar::Sweep& sweep);
  [[nodiscard]] bool take_ego();
  void publish(std::int64_t time_ns, const SweepResult& result);
  void publish_borders(std::int64_t time_ns, double mount_forward_m);

  fastcycle::Param<double> sweep_age_max_s_;
  fastcycle::Param<double> likeness_min_;
  Recognizer recognizer_;
  fastcycle::History<localization::Ego> ego_;
  fastcycle::Publisher<perception::Objects> objects_;
  std::optional<fastcycle::Publisher<perception::Borders>> borders_;
  fastcycle::State<perception::TrackerState> state_;

  EgoMotion motion_;
  std::int64_t sweep_count_ = 0;
  std::int64_t invalid_count_ = 0;
  std::int64_t confirmed_max_ = 0;
  std::int64_t borders_left_ = 0;
  std::int64_t borders_right_ = 0;
};

}  // namespace ads
