#include "scoring.h"

#include <array>
#include <chrono>
#include <cmath>
#include <utility>

#include "applications/rav4/drive/drive_clock.h"
#include "applications/rav4/drive/playback.h"
#include "reference.h"

namespace rav4 {

Scoring::Scoring(fastcycle::Context& context)
    : Component(context),
      data_(context.param<fastcycle::Path>(
          "data", {.description = "The drive's folder, in the layout of comma2k19"})),
      references_(context.create_publisher<scoring::Reference>("scoring/reference")),
      errors_(context.create_publisher<scoring::PositionError>("scoring/error")) {
  context.create_subscriber<gnss::Fix>("gnss/fix", [this](const gnss::Fix& fix) { on_fix(fix); });
  context.create_subscriber<localization::Pose>(
      "localization/pose", [this](const localization::Pose& pose) { on_pose(pose); });
  context.create_subscriber<vehicle::Steering>(
      "vehicle/steering", [this](const vehicle::Steering& steering) { on_steering(steering); });
  context.create_subscriber<vehicle::WheelSpeeds>(
      "vehicle/wheel_speeds",
      [this](const vehicle::WheelSpeeds& speeds) { on_wheel_speeds(speeds); });
}

void Scoring::start() {
  const DriveClock clock = DriveClock::read(data_.get());
  const auto can = data_.get() / "processed_log" / "CAN";
  score_.emplace(Reference::read(clock, data_.get()));
  wheel_check_ = DecodeCheck::read(clock, can / "wheel_speed", 4);
  steering_check_ = DecodeCheck::read(clock, can / "steering_angle", 1);
}

void Scoring::stop() {
  score_->finish();
  report("fixes", fixes_);
  report_errors("raw_fix_error", score_->fix_errors());
  report_errors("position_error", score_->estimate_errors());
  if (score_->fix_errors().count > 0 && score_->estimate_errors().count > 0) {
    report("position_error_ratio",
           score_->estimate_errors().mean_m() / score_->fix_errors().mean_m());
  }
  report_check("wheel_speed", "mps", *wheel_check_);
  report_check("steering", "deg", *steering_check_);
}

void Scoring::report_errors(const std::string& name, const ErrorSum& errors) {
  if (errors.count > 0) {
    report(name + "_mean_m", errors.mean_m());
    report(name + "_max_m", errors.max_m);
  }
}

void Scoring::report_check(const std::string& name, const std::string& unit,
                           const DecodeCheck& check) {
  report(name + "_messages_compared", check.compared());
  report(name + "_messages_unmatched", check.unmatched());
  if (check.compared() > 0) {
    report(name + "_decode_max_error_" + unit, check.max_error());
  }
}

void Scoring::on_fix(const gnss::Fix& fix) {
  ++fixes_;
  if (!std::isfinite(fix.latitude_deg()) || !std::isfinite(fix.longitude_deg()) ||
      !std::isfinite(fix.altitude_m())) {
    return;
  }
  const bool is_first = !score_->plane();
  const auto comparison = score_->on_fix(offset_of(fix), {.latitude_deg = fix.latitude_deg(),
                                                          .longitude_deg = fix.longitude_deg(),
                                                          .altitude_m = fix.altitude_m()});
  if (is_first) {
    publish_reference();
  }
  if (comparison) {
    publish_error(scoring::RAW_FIX, *comparison);
  }
}

void Scoring::on_pose(const localization::Pose& pose) {
  if (!score_->plane()) {
    return;
  }
  const ads::LocalFrame& plane = plane_of(pose);
  const Eigen::Vector3d place = plane.ecef_from_enu({pose.east_m(), pose.north_m(), 0.0});
  const Motion motion{.offset = offset_of(pose),
                      .position_m = score_->plane()->enu_from_ecef(place).head<2>(),
                      .velocity_mps = {pose.east_mps(), pose.north_mps()}};
  for (const Comparison& comparison : score_->on_motion(motion)) {
    publish_error(scoring::ESTIMATE, comparison);
  }
}

const ads::LocalFrame& Scoring::plane_of(const localization::Pose& pose) {
  const ads::GeodeticPosition origin{.latitude_deg = pose.origin_latitude_deg(),
                                     .longitude_deg = pose.origin_longitude_deg(),
                                     .altitude_m = pose.origin_altitude_m()};
  if (!pose_plane_ || pose_plane_->origin() != origin) {
    pose_plane_.emplace(origin);
  }
  return *pose_plane_;
}

void Scoring::on_steering(const vehicle::Steering& steering) {
  const double angle_deg = steering.wheel_angle_deg();
  steering_check_->compare(offset_of(steering), {&angle_deg, 1});
}

void Scoring::on_wheel_speeds(const vehicle::WheelSpeeds& speeds) {
  const std::array<double, 4> values{speeds.front_left_mps(), speeds.front_right_mps(),
                                     speeds.rear_left_mps(), speeds.rear_right_mps()};
  wheel_check_->compare(offset_of(speeds), values);
}

void Scoring::publish_reference() {
  const ads::LocalFrame& plane = *score_->plane();
  auto reference = references_.loan();
  reference->mutable_header()->set_taken_ns(nanoseconds_of(now()));
  reference->mutable_header()->set_frame("local_enu");
  reference->set_origin_latitude_deg(plane.origin().latitude_deg);
  reference->set_origin_longitude_deg(plane.origin().longitude_deg);
  reference->set_origin_altitude_m(plane.origin().altitude_m);
  for (const Reference::Frame& frame : score_->reference().frames()) {
    const Eigen::Vector3d place = plane.enu_from_ecef(frame.ecef_m);
    reference->add_east_m(place.x());
    reference->add_north_m(place.y());
  }
  references_.publish(std::move(reference));
}

void Scoring::publish_error(scoring::Kind kind, const Comparison& comparison) {
  auto error = errors_.loan();
  error->mutable_header()->set_taken_ns(nanoseconds_of(start_time() + comparison.offset));
  error->mutable_header()->set_frame("local_enu");
  error->set_kind(kind);
  error->set_error_m(comparison.error_m());
  error->set_east_m(comparison.position_m.x());
  error->set_north_m(comparison.position_m.y());
  error->set_reference_east_m(comparison.reference_m.x());
  error->set_reference_north_m(comparison.reference_m.y());
  errors_.publish(std::move(error));
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::Scoring)
