#include "scoring.h"

#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "applications/kitti/drive/calibration.h"
#include "applications/kitti/drive/frames.h"
#include "common/files.h"
#include "common/params.h"
#include "common/plane.h"

namespace kitti {
namespace {

Kind kind_of(perception::ObjectClass object_class) {
  switch (object_class) {
    case perception::CAR:
    case perception::TRUCK:
      return Kind::kVehicle;
    case perception::TWO_WHEELER:
      return Kind::kCyclist;
    default:
      return Kind::kOther;
  }
}

// Where the lidar looked ahead, as the camera did: in the middle of the turn.
struct Sensor {
  Eigen::Vector2d place_m;
  double heading_rad;
};

Sensor sensor_at(const localization::Ego& ego, double before_s, double mount_forward_m) {
  const double heading = ego.heading_rad() - before_s * ego.yaw_rate_radps();
  const Eigen::Vector2d center_m =
      Eigen::Vector2d(ego.x_m(), ego.y_m()) -
      before_s * ego.speed_mps() * ads::direction(0.5 * (heading + ego.heading_rad()));
  return {.place_m = center_m + mount_forward_m * ads::direction(heading), .heading_rad = heading};
}

std::string_view word_of(Verdict verdict) {
  return verdict == Verdict::kRight ? "right" : verdict == Verdict::kFalse ? "false" : "neither";
}

}  // namespace

Scoring::Scoring(fastcycle::Context& context)
    : Component(context),
      data_(context.param<fastcycle::Path>("data", {.description = "The drive's folder"})),
      mount_forward_m_(ads::number_param(context, "mount_forward_m", -0.6, -10.0, 10.0, "m",
                                         "Of the lidar before the vehicle's centre")),
      mount_height_m_(ads::number_param(context, "mount_height_m", 1.73, -10.0, 10.0, "m",
                                        "Of the lidar above the ground")),
      details_(context.param<std::string>(
          "details",
          {.fallback = "", .description = "A file for the verdict on each box; none if empty"})),
      ego_(context.create_history<localization::Ego>("localization/ego", {.depth = 4})) {
  context.create_subscriber<perception::Objects>(
      "perception/objects", [this](const perception::Objects& objects) { on_objects(objects); });
}

void Scoring::start() {
  const Calibration calibration = Calibration::read(data_.get() / "calib.txt");
  const auto file = data_.get() / "label_02.txt";
  frames_ = parse_labels(ads::read_file(file), calibration, file.string());
  first_ = list_frames(data_.get() / "velodyne", ".bin.xz").front().number;
  vehicles_.emplace(ScoreConfig{}, calibration, Kind::kVehicle);
  cyclists_.emplace(ScoreConfig{}, calibration, Kind::kCyclist);
  if (!details_.get().empty()) {
    details_file_.open(details_.get());
  }
}

void Scoring::stop() {
  report_score("vehicles", *vehicles_);
  report_score("cyclists", *cyclists_);
  report("frames_without_labels", unlabelled_);
}

void Scoring::report_score(const std::string& kind, const Score& score) {
  report(kind + "_labels", score.labels());
  report(kind + "_precision", score.precision());
  report(kind + "_recall", score.recall());
  report(kind + "_false_boxes_per_frame", score.false_boxes_per_frame());
  report(kind + "_mota", score.mota());
  report(kind + "_id_switches", score.id_switches());
  report(kind + "_distance_mean_m", score.distance_mean_m());
}

// Objects hold for the end of a sweep, labels for the moment at which it looked ahead.
void Scoring::on_objects(const perception::Objects& objects) {
  const std::int64_t end_ns = objects.header().taken_ns();
  const std::int64_t since_ns = end_ns - start_time().time_since_epoch().count();
  const std::int64_t number = first_ + (since_ns + kFrame_ns / 2) / kFrame_ns - 1;
  const auto frame = frames_.find(number);
  if (ego_.size() == 0 || frame == frames_.end()) {
    ++unlabelled_;
    return;
  }
  auto ego = ego_[ego_.size() - 1];
  for (std::size_t index = ego_.size(); index > 0 && ego->header().taken_ns() > end_ns; --index) {
    ego = ego_[index - 1];
  }
  const double before_s =
      static_cast<double>(ego->header().taken_ns() - end_ns + kFrame_ns / 2) * 1e-9;
  const Sensor sensor = sensor_at(*ego, before_s, mount_forward_m_.get());
  const Eigen::Rotation2Dd turn(-sensor.heading_rad);
  std::vector<FoundBox> boxes;
  for (const perception::Object& object : objects.objects()) {
    const Eigen::Vector2d then_m =
        Eigen::Vector2d(object.x_m(), object.y_m()) -
        0.5e-9 * kFrame_ns * object.speed_mps() * ads::direction(object.heading_rad());
    const Eigen::Vector2d place_m = turn * (then_m - sensor.place_m);
    boxes.push_back(
        {.id = object.id(),
         .kind = kind_of(object.object_class()),
         .center_m = {place_m.x(), place_m.y(), 0.5 * object.height_m() - mount_height_m_.get()}});
  }
  for (auto* score : {&*vehicles_, &*cyclists_}) {
    const auto verdicts = score->add(frame->second, boxes);
    if (!details_file_.is_open()) {
      continue;
    }
    for (std::size_t index = 0; index < boxes.size(); ++index) {
      const perception::Object& object = objects.objects(static_cast<int>(index));
      details_file_ << fmt::format(
          "{} {} {} class {} at {:.1f} {:.1f} size {:.1f} {:.1f} {:.1f} heading {:.2f} speed "
          "{:.1f} "
          "seen {} unseen {:.1f}\n",
          number, word_of(verdicts[index]), object.id(),
          perception::ObjectClass_Name(object.object_class()), boxes[index].center_m.x(),
          boxes[index].center_m.y(), object.length_m(), object.width_m(), object.height_m(),
          ads::normalize_angle(object.heading_rad() - sensor.heading_rad), object.speed_mps(),
          object.sightings(), object.unseen_s());
    }
    for (std::size_t index = 0; index < score->missed().size(); ++index) {
      const Label& label = frame->second.labels[index];
      if (score->missed()[index]) {
        details_file_ << fmt::format("{} missed {} at {:.1f} {:.1f} size {:.1f} {:.1f} {:.1f}\n",
                                     number, label.track, label.center_m.x(), label.center_m.y(),
                                     label.length_m, label.width_m, label.height_m);
      }
    }
  }
}

}  // namespace kitti

FASTCYCLE_COMPONENT(kitti::Scoring)
