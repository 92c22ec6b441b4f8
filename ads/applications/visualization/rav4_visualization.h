#pragma once

#include <optional>
#include <string>

#include <fastcycle/fastcycle.h>

#include "common/geodesy.h"
#include "drawing.h"
#include "gnss/fix.pb.h"
#include "localization/pose.pb.h"
#include "radar/tracks.pb.h"

namespace ads {

/// Publishes the `rav4` drive in messages that other tools display directly.
///
/// In:   `gnss/fix`, `localization/pose`, `radar/tracks`
/// Out:  `visualization/...`: `fix`, `estimate`, `transforms`, `pose`, `vehicle`, `radar`
class Rav4Visualization final : public fastcycle::Component {
 public:
  explicit Rav4Visualization(fastcycle::Context& context);

 private:
  void on_fix(const gnss::Fix& fix);
  void on_pose(const localization::Pose& pose);
  void on_tracks(const radar::Tracks& tracks);

  fastcycle::Param<double> length_m_;
  fastcycle::Param<double> width_m_;
  fastcycle::Param<double> height_m_;
  fastcycle::Param<double> radar_forward_m_;
  fastcycle::Publisher<foxglove::LocationFix> fixes_;
  fastcycle::Publisher<foxglove::LocationFix> estimates_;
  fastcycle::Publisher<foxglove::FrameTransforms> transforms_;
  fastcycle::Publisher<foxglove::PoseInFrame> poses_;
  fastcycle::Publisher<foxglove::SceneUpdate> vehicles_;
  fastcycle::Publisher<foxglove::SceneUpdate> radars_;

  std::optional<LocalFrame> plane_;
};

}  // namespace ads
