#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "common/geodesy.h"
#include "drawing.h"
#include "gnss/position.pb.h"
#include "localization/ego.pb.h"

namespace ads {

/// Publishes the outputs of the ADS modules in messages that other tools display directly.
///
/// In:   `lidar/points`, `perception/objects`, `map/tile`, `map/route`, `planning/plan`,
///       `localization/ego`, `gnss/position`
/// Out:  `visualization/...`: `points`, `objects`, `lanes`, `route`, `plan`, `minimal_risk`,
///       `transforms`, `pose`, `vehicle`, `fix`; without those listed in `except`
class Visualization final : public fastcycle::Component {
 public:
  explicit Visualization(fastcycle::Context& context);

 private:
  [[nodiscard]] bool has(std::string_view output) const;
  void on_sweep(const lidar::Sweep& sweep);
  void on_plan(const planning::Plan& plan);
  void on_ego(const localization::Ego& ego);
  void on_position(const gnss::Position& position);
  void publish_vehicle(std::int64_t time_ns);

  fastcycle::Param<std::vector<std::string>> except_;
  fastcycle::Param<std::string> vehicle_frame_;
  fastcycle::Param<int> points_every_;
  fastcycle::Param<double> length_m_;
  fastcycle::Param<double> width_m_;
  fastcycle::Param<double> height_m_;
  fastcycle::Param<std::vector<double>> origin_deg_;

  fastcycle::Publisher<foxglove::PointCloud> clouds_;
  fastcycle::Publisher<foxglove::SceneUpdate> objects_;
  fastcycle::Publisher<foxglove::SceneUpdate> lanes_;
  fastcycle::Publisher<foxglove::SceneUpdate> routes_;
  fastcycle::Publisher<foxglove::PosesInFrame> plans_;
  fastcycle::Publisher<foxglove::PosesInFrame> minimal_risks_;
  fastcycle::Publisher<foxglove::FrameTransforms> transforms_;
  fastcycle::Publisher<foxglove::PoseInFrame> poses_;
  fastcycle::Publisher<foxglove::SceneUpdate> vehicles_;
  fastcycle::Publisher<foxglove::LocationFix> fixes_;

  std::optional<LocalFrame> plane_;
  PlaneMotion motion_;
  bool has_vehicle_ = false;
};

}  // namespace ads
