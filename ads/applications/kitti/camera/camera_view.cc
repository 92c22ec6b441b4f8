#include "camera_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "common/files.h"
#include "common/params.h"
#include "common/plane.h"

namespace kitti {
namespace {

constexpr std::size_t kImagesMax = 4;
constexpr std::size_t kPointBytes = 16;
constexpr double kDepthMin_m = 0.5;
// Of each kind of object, by its number.
constexpr std::array<Rgb, 5> kColors = {
    Rgb{190, 190, 190}, {255, 150, 20}, {230, 80, 30}, {200, 60, 220}, {255, 40, 120}};

std::int64_t nanoseconds(const google::protobuf::Timestamp& timestamp) {
  return timestamp.seconds() * 1'000'000'000 + timestamp.nanos();
}

void add_field(const char* name, std::uint32_t offset,
               foxglove::PackedElementField::NumericType type, foxglove::PointCloud& cloud) {
  foxglove::PackedElementField& field = *cloud.add_fields();
  field.set_name(name);
  field.set_offset(offset);
  field.set_type(type);
}

}  // namespace

CameraView::CameraView(fastcycle::Context& context)
    : Component(context),
      data_(context.param<fastcycle::Path>(
          "data", {.description = "The drive's folder, for its calibration"})),
      picture_file_(context.param<fastcycle::Path>(
          "picture", {.fallback = fastcycle::Path("camera.png"),
                      .description = "File for the last image with its boxes"})),
      mount_forward_m_(ads::number_param(context, "mount_forward_m", -0.6, -10.0, 10.0, "m",
                                         "Of the lidar before the vehicle's centre")),
      mount_height_m_(ads::number_param(context, "mount_height_m", 1.73, -10.0, 10.0, "m",
                                        "Of the lidar above the ground")),
      clouds_(context.create_publisher<foxglove::PointCloud>("camera/points")),
      drawn_(context.create_publisher<foxglove::RawImage>("camera/boxes")),
      ego_(context.create_history<localization::Ego>("localization/ego", {.depth = 4})) {
  context.create_subscriber<foxglove::CompressedImage>(
      "camera/image",
      [this](const fastcycle::Sample<foxglove::CompressedImage>& image) { on_image(image); });
  context.create_subscriber<lidar::Sweep>("lidar/points",
                                          [this](const lidar::Sweep& sweep) { on_sweep(sweep); });
  context.create_subscriber<perception::Objects>(
      "perception/objects", [this](const perception::Objects& objects) { on_objects(objects); });
}

void CameraView::start() {
  calibration_ = Calibration::read(data_.get() / "calib.txt");
}

void CameraView::stop() {
  report("pictures", pictures_);
  report("sweeps_without_picture", sweeps_without_picture_);
  report("points_colored", points_);
  report("boxes_drawn", boxes_);
  if (last_drawn_.rgb.empty()) {
    return;
  }
  ads::write_file(picture_file_.get(), encode_png(last_drawn_));
}

void CameraView::on_image(const fastcycle::Sample<foxglove::CompressedImage>& image) {
  images_.push_back(image);
  if (images_.size() > kImagesMax) {
    images_.pop_front();
  }
}

void CameraView::on_sweep(const lidar::Sweep& sweep) {
  sweep_end_ns_ = sweep.header().taken_ns() + sweep.duration_ns();
  if (find_picture(sweep)) {
    color_points(sweep);
  } else {
    ++sweeps_without_picture_;
  }
}

/// The picture that was taken during the turn.
bool CameraView::find_picture(const lidar::Sweep& sweep) {
  picture_.reset();
  for (const auto& image : images_) {
    const std::int64_t time_ns = nanoseconds(image->timestamp());
    if (time_ns < sweep.header().taken_ns() || time_ns > sweep_end_ns_) {
      continue;
    }
    try {
      picture_ = decode_png(image->data(), "camera/image");
    } catch (const std::runtime_error& error) {
      health(fastcycle::Health::kDegraded, error.what());
      return false;
    }
    picture_ns_ = time_ns;
    ++pictures_;
    return true;
  }
  return false;
}

// Lidar and camera look ahead at the same time, so nothing has moved meanwhile where both look.
void CameraView::color_points(const lidar::Sweep& sweep) {
  using foxglove::PackedElementField;
  auto cloud = clouds_.loan();
  *cloud->mutable_timestamp() = google::protobuf::Timestamp();
  cloud->mutable_timestamp()->set_seconds(picture_ns_ / 1'000'000'000);
  cloud->mutable_timestamp()->set_nanos(static_cast<std::int32_t>(picture_ns_ % 1'000'000'000));
  cloud->set_frame_id(sweep.header().frame());
  cloud->mutable_pose()->mutable_position();
  cloud->mutable_pose()->mutable_orientation()->set_w(1.0);
  cloud->set_point_stride(kPointBytes);
  add_field("x", 0, PackedElementField::FLOAT32, *cloud);
  add_field("y", 4, PackedElementField::FLOAT32, *cloud);
  add_field("z", 8, PackedElementField::FLOAT32, *cloud);
  add_field("red", 12, PackedElementField::UINT8, *cloud);
  add_field("green", 13, PackedElementField::UINT8, *cloud);
  add_field("blue", 14, PackedElementField::UINT8, *cloud);
  add_field("alpha", 15, PackedElementField::UINT8, *cloud);

  const std::string& points = sweep.points();
  std::string& data = *cloud->mutable_data();
  for (std::size_t at = 0; at + kPointBytes <= points.size(); at += kPointBytes) {
    Eigen::Vector3f place_m;
    std::memcpy(place_m.data(), points.data() + at, 12);
    if (!place_m.allFinite() || place_m.isZero(0.0F)) {
      continue;
    }
    const auto pixel = calibration_.pixel_of(place_m.cast<double>());
    if (!pixel || pixel->x() < 0.0 || pixel->y() < 0.0 || pixel->x() >= picture_->width ||
        pixel->y() >= picture_->height) {
      continue;
    }
    const Rgb color = picture_->at(static_cast<int>(pixel->x()), static_cast<int>(pixel->y()));
    std::array<char, kPointBytes> out{};
    std::memcpy(out.data(), place_m.data(), 12);
    std::memcpy(out.data() + 12, color.data(), color.size());
    out[15] = static_cast<char>(0xFF);
    data.append(out.data(), out.size());
    ++points_;
  }
  clouds_.publish(std::move(cloud));
}

void CameraView::on_objects(const perception::Objects& objects) {
  const std::int64_t end_ns = objects.header().taken_ns();
  if (!picture_ || end_ns != sweep_end_ns_ || ego_.size() == 0) {
    return;
  }
  auto ego = ego_[ego_.size() - 1];
  for (std::size_t index = ego_.size(); index > 0 && ego->header().taken_ns() > end_ns; --index) {
    ego = ego_[index - 1];
  }
  last_drawn_ = *picture_;
  for (const perception::Object& object : objects.objects()) {
    draw(object, *ego, static_cast<double>(end_ns - picture_ns_) * 1e-9, last_drawn_);
  }
  boxes_ += objects.objects_size();
  auto out = drawn_.loan();
  out->mutable_timestamp()->set_seconds(picture_ns_ / 1'000'000'000);
  out->mutable_timestamp()->set_nanos(static_cast<std::int32_t>(picture_ns_ % 1'000'000'000));
  out->set_frame_id("camera");
  out->set_width(static_cast<std::uint32_t>(last_drawn_.width));
  out->set_height(static_cast<std::uint32_t>(last_drawn_.height));
  out->set_encoding("rgb8");
  out->set_step(static_cast<std::uint32_t>(3 * last_drawn_.width));
  out->mutable_data()->assign(last_drawn_.rgb.begin(), last_drawn_.rgb.end());
  drawn_.publish(std::move(out));
}

/// An object that holds for the end of the sweep, where it was when the picture was taken.
void CameraView::draw(const perception::Object& object, const localization::Ego& ego,
                      double before_s, Picture& picture) const {
  const double ego_before_s =
      before_s + static_cast<double>(ego.header().taken_ns() - sweep_end_ns_) * 1e-9;
  const double heading = ego.heading_rad() - ego_before_s * ego.yaw_rate_radps();
  const Eigen::Vector2d sensor_m =
      Eigen::Vector2d(ego.x_m(), ego.y_m()) -
      ego_before_s * ego.speed_mps() * ads::direction(0.5 * (heading + ego.heading_rad())) +
      mount_forward_m_.get() * ads::direction(heading);
  const Eigen::Vector2d center_m =
      Eigen::Vector2d(object.x_m(), object.y_m()) -
      before_s * object.speed_mps() * ads::direction(object.heading_rad());
  const Eigen::Rotation2Dd to_sensor(-heading);
  const Eigen::Vector2d ahead = 0.5 * object.length_m() * ads::direction(object.heading_rad());
  const Eigen::Vector2d aside =
      0.5 * object.width_m() * ads::direction(object.heading_rad() + M_PI / 2.0);

  std::array<Eigen::Vector3d, 8> corners_m;
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const double along = corner == 0 || corner == 3 ? 1.0 : -1.0;
    const double across = corner < 2 ? 1.0 : -1.0;
    const Eigen::Vector2d place_m =
        to_sensor * (center_m + along * ahead + across * aside - sensor_m);
    corners_m.at(corner) = {place_m.x(), place_m.y(), -mount_height_m_.get()};
    corners_m.at(corner + 4) = {place_m.x(), place_m.y(),
                                object.height_m() - mount_height_m_.get()};
  }
  const auto kind = static_cast<std::size_t>(object.object_class());
  Rgb color = kColors.at(kind < kColors.size() ? kind : 0);
  if (object.unseen_s() > 0.0) {
    std::ranges::transform(color, color.begin(),
                           [](std::uint8_t part) { return static_cast<std::uint8_t>(part / 2); });
  }
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const std::size_t next = (corner + 1) % 4;
    draw_edge(corners_m.at(corner), corners_m.at(next), color, picture);
    draw_edge(corners_m.at(corner + 4), corners_m.at(next + 4), color, picture);
    draw_edge(corners_m.at(corner), corners_m.at(corner + 4), color, picture);
  }
}

/// Draws the part of an edge that lies before the camera.
void CameraView::draw_edge(const Eigen::Vector3d& from_m, const Eigen::Vector3d& to_m,
                           const Rgb& color, Picture& picture) const {
  const auto depth_of = [this](const Eigen::Vector3d& place_m) {
    return (calibration_.rectification * (calibration_.lidar_to_camera * place_m.homogeneous()))
        .z();
  };
  Eigen::Vector3d near_m = from_m;
  Eigen::Vector3d far_m = to_m;
  if (depth_of(near_m) > depth_of(far_m)) {
    std::swap(near_m, far_m);
  }
  const double near_depth_m = depth_of(near_m);
  const double far_depth_m = depth_of(far_m);
  if (!(far_depth_m > kDepthMin_m)) {
    return;
  }
  if (near_depth_m < kDepthMin_m) {
    near_m += (kDepthMin_m - near_depth_m) / (far_depth_m - near_depth_m) * (far_m - near_m);
  }
  const auto from = calibration_.pixel_of(near_m);
  const auto to = calibration_.pixel_of(far_m);
  if (from && to) {
    draw_line(picture, *from, *to, color);
  }
}

}  // namespace kitti

FASTCYCLE_COMPONENT(kitti::CameraView)
