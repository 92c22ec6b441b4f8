#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "devices/device_component.h"
#include "foxglove/image.pb.h"
#include "image_folder.h"
#include "v4l2.h"

namespace ads {

/// Publishes the pictures of a camera, or plays back those of a folder at their times.
///
/// Out:  `camera/image`
class Camera final : public DeviceComponent {
 public:
  explicit Camera(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  void receive(const V4l2Frame& frame);
  void play();
  void schedule();

  fastcycle::Param<fastcycle::Path> folder_;
  V4l2Config config_;
  fastcycle::Param<std::string> frame_;

  // Of a camera.
  std::optional<fastcycle::ExternalPublisher<foxglove::RawImage>> received_;
  std::optional<V4l2Device> device_;
  std::atomic<std::int64_t> pictures_ = 0;

  // Of a folder.
  std::optional<fastcycle::Publisher<foxglove::RawImage>> played_;
  std::optional<fastcycle::Timer> timer_;
  std::optional<fastcycle::Source> source_;
  std::vector<ImageFile> files_;
  std::size_t next_ = 0;
};

}  // namespace ads
