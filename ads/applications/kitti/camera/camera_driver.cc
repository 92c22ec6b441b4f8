#include "camera_driver.h"

#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "applications/kitti/camera/picture.h"
#include "common/files.h"

namespace kitti {
namespace {

constexpr const char* kFrame = "camera";
constexpr std::int64_t kSecond_ns = 1'000'000'000;

void set_time(std::int64_t time_ns, google::protobuf::Timestamp& out) {
  out.set_seconds(time_ns / kSecond_ns);
  out.set_nanos(static_cast<std::int32_t>(time_ns % kSecond_ns));
}

}  // namespace

CameraDriver::CameraDriver(fastcycle::Context& context)
    : Component(context),
      data_(context.param<fastcycle::Path>("data", {.description = "The drive's folder"})),
      images_(context.create_publisher<foxglove::CompressedImage>("camera/image")),
      calibrations_(context.create_publisher<foxglove::CameraCalibration>("camera/calibration")),
      transforms_(context.create_publisher<foxglove::FrameTransforms>("camera/transforms")),
      timer_(context.create_timer([this] { play(); })),
      source_(context.create_source()) {}

void CameraDriver::start() {
  calibration_ = Calibration::read(data_.get() / "calib.txt");
  // The drive begins with its first sweep.
  first_ = list_frames(data_.get() / "velodyne", ".bin.xz").front().number;
  frames_ = list_frames(data_.get() / "image_02", ".png");
  while (next_ < frames_.size() && frames_[next_].number < first_) {
    ++next_;
  }
  schedule();
}

void CameraDriver::stop() {
  report("pictures", static_cast<std::int64_t>(next_));
}

void CameraDriver::schedule() {
  if (next_ < frames_.size()) {
    timer_.arm_at(start_time() + offset_of(frames_[next_].number, first_) +
                  fastcycle::Duration(kFrame_ns / 2));
  } else {
    source_.finish();
  }
}

void CameraDriver::play() {
  const Frame& frame = frames_[next_++];
  const std::int64_t taken_ns = now().time_since_epoch().count();
  auto image = images_.loan();
  *image->mutable_data() = ads::read_file(frame.file);
  const PictureSize size = size_of_png(image->data(), frame.file.string());
  width_ = static_cast<std::uint32_t>(size.width);
  height_ = static_cast<std::uint32_t>(size.height);
  set_time(taken_ns, *image->mutable_timestamp());
  image->set_format("png");
  image->set_frame_id(kFrame);
  publish_calibration(taken_ns);
  publish_transform(taken_ns);
  images_.publish(std::move(image));
  schedule();
}

// The frame of the camera is that of the picture's own centre of projection: P2 without its last
// column.
void CameraDriver::publish_calibration(std::int64_t taken_ns) {
  auto out = calibrations_.loan();
  set_time(taken_ns, *out->mutable_timestamp());
  out->set_frame_id(kFrame);
  out->set_width(width_);
  out->set_height(height_);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      out->add_k(calibration_.projection(row, column));
      out->add_r(row == column ? 1.0 : 0.0);
      out->add_p(calibration_.projection(row, column));
    }
    out->add_p(0.0);
  }
  calibrations_.publish(std::move(out));
}

void CameraDriver::publish_transform(std::int64_t taken_ns) {
  const Eigen::Matrix3d to_camera =
      calibration_.rectification * calibration_.lidar_to_camera.leftCols<3>();
  const Eigen::Vector3d offset_m =
      calibration_.rectification * calibration_.lidar_to_camera.col(3) +
      calibration_.projection.leftCols<3>().inverse() * calibration_.projection.col(3);
  Eigen::Quaterniond rotation = Eigen::Quaterniond(to_camera.transpose()).normalized();
  if (rotation.w() < 0.0) {
    rotation.coeffs() = -rotation.coeffs();  // The same turn.
  }
  const Eigen::Vector3d place_m = -(to_camera.transpose() * offset_m);
  auto out = transforms_.loan();
  foxglove::FrameTransform& transform = *out->add_transforms();
  set_time(taken_ns, *transform.mutable_timestamp());
  transform.set_parent_frame_id("lidar");
  transform.set_child_frame_id(kFrame);
  transform.mutable_translation()->set_x(place_m.x());
  transform.mutable_translation()->set_y(place_m.y());
  transform.mutable_translation()->set_z(place_m.z());
  transform.mutable_rotation()->set_x(rotation.x());
  transform.mutable_rotation()->set_y(rotation.y());
  transform.mutable_rotation()->set_z(rotation.z());
  transform.mutable_rotation()->set_w(rotation.w());
  transforms_.publish(std::move(out));
}

}  // namespace kitti

FASTCYCLE_COMPONENT(kitti::CameraDriver)
