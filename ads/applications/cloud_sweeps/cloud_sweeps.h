#pragma once

#include <cstdint>

#include <fastcycle/fastcycle.h>

#include "cloud_reader.h"
#include "foxglove/point_cloud.pb.h"
#include "lidar/sweep.pb.h"

namespace ads {

/// Converts the point clouds of another system's lidar, for example from a ROS 2 bag, to sweeps.
///
/// In:   `points`
/// Out:  `lidar/points`, one for each readable cloud
class CloudSweeps final : public fastcycle::Component {
 public:
  explicit CloudSweeps(fastcycle::Context& context);

  void stop() override;

 private:
  void on_cloud(const foxglove::PointCloud& cloud);

  CloudConfig config_;
  double mount_forward_m_;
  double mount_height_m_;
  fastcycle::Publisher<lidar::Sweep> sweeps_;
  bool has_warned_ = false;
  std::int64_t cloud_count_ = 0;
  std::int64_t unusable_count_ = 0;
};

}  // namespace ads
