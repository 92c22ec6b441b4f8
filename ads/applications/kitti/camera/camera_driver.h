#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "applications/kitti/drive/calibration.h"
#include "applications/kitti/drive/frames.h"
#include "foxglove/image.pb.h"
#include "foxglove/pose.pb.h"

namespace kitti {

/// Publishes the recorded pictures of a drive, each at the time it was taken: when the lidar faced
/// forward, in the middle of its turn.
///
/// Out:  `camera/image`, one message for each file, the PNG unchanged; `camera/calibration` and
///       `camera/transforms` (the camera's pose in the frame "lidar"), before each
class CameraDriver final : public fastcycle::Component {
 public:
  explicit CameraDriver(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  void schedule();
  void play();
  void publish_calibration(std::int64_t taken_ns);
  void publish_transform(std::int64_t taken_ns);

  fastcycle::Param<fastcycle::Path> data_;
  fastcycle::Publisher<foxglove::CompressedImage> images_;
  fastcycle::Publisher<foxglove::CameraCalibration> calibrations_;
  fastcycle::Publisher<foxglove::FrameTransforms> transforms_;
  fastcycle::Timer timer_;
  fastcycle::Source source_;

  Calibration calibration_;
  std::vector<Frame> frames_;
  std::int64_t first_ = 0;
  std::size_t next_ = 0;
  std::uint32_t width_ = 0;
  std::uint32_t height_ = 0;
};

}  // namespace kitti
