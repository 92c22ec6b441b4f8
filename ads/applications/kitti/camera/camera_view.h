#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include <fastcycle/fastcycle.h>

#include "applications/kitti/camera/picture.h"
#include "applications/kitti/drive/calibration.h"
#include "foxglove/image.pb.h"
#include "foxglove/point_cloud.pb.h"
#include "lidar/sweep.pb.h"
#include "localization/ego.pb.h"
#include "perception/objects.pb.h"

namespace kitti {

/// Projects the lidar's points and perception's boxes into the camera's pictures.
///
/// In:   `camera/image`, `lidar/points`, `perception/objects`, `localization/ego` (history)
/// Out:  `camera/points`: the returns that are in the picture, with its colours; `camera/boxes`:
/// the
///       picture with the boxes drawn into it; a PNG of the last of them, at the end
class CameraView final : public fastcycle::Component {
 public:
  explicit CameraView(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  void on_image(const fastcycle::Sample<foxglove::CompressedImage>& image);
  void on_sweep(const lidar::Sweep& sweep);
  void on_objects(const perception::Objects& objects);
  [[nodiscard]] bool find_picture(const lidar::Sweep& sweep);
  void color_points(const lidar::Sweep& sweep);
  void draw(const perception::Object& object, const localization::Ego& ego, double before_s,
            Picture& picture) const;
  void draw_edge(const Eigen::Vector3d& from_m, const Eigen::Vector3d& to_m, const Rgb& color,
                 Picture& picture) const;

  fastcycle::Param<fastcycle::Path> data_;
  fastcycle::Param<fastcycle::Path> picture_file_;
  fastcycle::Param<double> mount_forward_m_;
  fastcycle::Param<double> mount_height_m_;
  fastcycle::Publisher<foxglove::PointCloud> clouds_;
  fastcycle::Publisher<foxglove::RawImage> drawn_;
  fastcycle::History<localization::Ego> ego_;

  Calibration calibration_;
  std::deque<fastcycle::Sample<foxglove::CompressedImage>> images_;
  // That of the last sweep, none if there was none.
  std::optional<Picture> picture_;
  std::int64_t picture_ns_ = 0;
  std::int64_t sweep_end_ns_ = 0;
  Picture last_drawn_;

  std::int64_t pictures_ = 0;
  std::int64_t sweeps_without_picture_ = 0;
  std::int64_t points_ = 0;
  std::int64_t boxes_ = 0;
};

}  // namespace kitti
