#include "camera.h"

#include <utility>

#include "common/files.h"

namespace ads {
namespace {

constexpr double kSilence_s = 1.0;
constexpr std::int64_t kSecond_ns = 1'000'000'000;

void set_time(fastcycle::Time time, foxglove::RawImage& image) {
  const std::int64_t time_ns = time.time_since_epoch().count();
  image.mutable_timestamp()->set_seconds(time_ns / kSecond_ns);
  image.mutable_timestamp()->set_nanos(static_cast<std::int32_t>(time_ns % kSecond_ns));
}

const char* encoding_of(PixelFormat format) {
  switch (format) {
    case PixelFormat::kYuyv:
      return "yuyv";
    case PixelFormat::kRgb:
      return "rgb8";
    case PixelFormat::kGrey:
      return "mono8";
  }
  return "yuyv";
}

V4l2Config read_config(fastcycle::Context& context) {
  const auto pixels = [&context](std::string_view name, int fallback) {
    return static_cast<std::uint32_t>(
        context.param<int>(name, {.fallback = fallback, .min = 1, .max = 16'384}).get());
  };
  V4l2Config config;
  config.path =
      context.param<std::string>("device", {.fallback = "/dev/video0", .description = "The camera"})
          .get();
  config.width = pixels("width", 640);
  config.height = pixels("height", 480);
  config.format = context
                      .param<PixelFormat>("format", {.fallback = PixelFormat::kYuyv,
                                                     .names = {{"yuyv", PixelFormat::kYuyv},
                                                               {"rgb", PixelFormat::kRgb},
                                                               {"grey", PixelFormat::kGrey}},
                                                     .description = "Pixel format of the camera"})
                      .get();
  return config;
}

}  // namespace

Camera::Camera(fastcycle::Context& context)
    : DeviceComponent(context, kSilence_s),
      folder_(context.param<fastcycle::Path>(
          "folder",
          {.fallback = fastcycle::Path(),
           .description = "Folder with images to play instead of a camera; empty: none"})),
      config_(read_config(context)),
      frame_(context.param<std::string>("frame", {.fallback = "camera"})) {
  if (folder_.get().empty()) {
    received_.emplace(context.create_external_publisher<foxglove::RawImage>("camera/image"));
    create_device_thread(context, "camera", [this]() -> Device& { return *device_; });
  } else {
    played_.emplace(context.create_publisher<foxglove::RawImage>("camera/image"));
    timer_.emplace(context.create_timer([this] { play(); }));
    source_.emplace(context.create_source());
  }
}

void Camera::start() {
  if (received_) {
    device_.emplace(config_, [this](const V4l2Frame& frame) { receive(frame); });
    return;
  }
  files_ = list_images(folder_.get());
  schedule();
}

void Camera::receive(const V4l2Frame& frame) {
  const fastcycle::Time taken = received_->now() - fastcycle::Duration(frame.age_ns);
  auto image = received_->loan_uncleared();
  set_time(taken, *image);
  image->set_frame_id(frame_.get());
  image->set_width(frame.width);
  image->set_height(frame.height);
  image->set_encoding(encoding_of(config_.format));
  image->set_step(frame.row_bytes);
  image->mutable_data()->assign(reinterpret_cast<const char*>(frame.data.data()),
                                frame.data.size());
  received_->publish(std::move(image), taken);
  ++pictures_;
}

void Camera::play() {
  const ImageFile& file = files_[next_++];
  Image read = read_netpbm(read_file(file.path), file.path.string());
  auto image = played_->loan();
  set_time(now(), *image);
  image->set_frame_id(frame_.get());
  image->set_width(read.width);
  image->set_height(read.height);
  image->set_encoding(read.encoding);
  image->set_step(read.row_bytes);
  *image->mutable_data() = std::move(read.data);
  played_->publish(std::move(image), {.taken_at = now()});
  ++pictures_;
  schedule();
}

void Camera::schedule() {
  if (next_ < files_.size()) {
    timer_->arm_at(start_time() +
                   fastcycle::Duration(files_[next_].time_ns - files_.front().time_ns));
  } else {
    source_->finish();
  }
}

void Camera::stop() {
  report("pictures", pictures_.load());
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Camera)
