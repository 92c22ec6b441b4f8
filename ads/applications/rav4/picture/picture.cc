#include "picture.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

#include "common/files.h"
#include "common/header.pb.h"

namespace rav4 {
namespace {

fastcycle::Time time_of(const common::Header& header) {
  return fastcycle::Time(fastcycle::Duration(header.taken_ns()));
}

std::string name_of(supervision::Judgement judgement) {
  switch (judgement) {
    case supervision::STARTING:
      return "starting";
    case supervision::READY:
      return "ready";
    case supervision::DEGRADED:
      return "degraded";
    default:
      return "lost";
  }
}

}  // namespace

Picture::Picture(fastcycle::Context& context)
    : Component(context),
      file_(context.param<fastcycle::Path>("file", {.fallback = fastcycle::Path("drive.svg"),
                                                    .description = "SVG file of the drive"})),
      title_(context.param<std::string>(
          "title", {.fallback = "A drive", .description = "Title of the picture"})) {
  context.create_subscriber<gnss::Fix>("gnss/fix", [this](const gnss::Fix&) { ++fixes_count_; });
  context.create_subscriber<localization::Pose>(
      "localization/pose", [this](const localization::Pose& pose) { on_pose(pose); });
  context.create_subscriber<scoring::Reference>(
      "scoring/reference",
      [this](const scoring::Reference& reference) { on_reference(reference); });
  context.create_subscriber<scoring::PositionError>(
      "scoring/error", [this](const scoring::PositionError& error) { on_error(error); });
  context.create_subscriber<supervision::Status>(
      "supervision/status", [this](const supervision::Status& status) { on_status(status); });
}

double Picture::seconds_at(fastcycle::Time time) const {
  return std::chrono::duration<double>(time - start_time()).count();
}

void Picture::on_pose(const localization::Pose& pose) {
  estimate_.add({.east_m = pose.east_m(), .north_m = pose.north_m()});
  const double taken_s = seconds_at(time_of(pose.header()));
  distance_m_ +=
      std::hypot(pose.east_mps(), pose.north_mps()) * std::max(0.0, taken_s - last_pose_s_);
  last_pose_s_ = taken_s;
}

void Picture::on_reference(const scoring::Reference& reference) {
  for (int index = 0; index < std::min(reference.east_m_size(), reference.north_m_size());
       ++index) {
    reference_.add({.east_m = reference.east_m(index), .north_m = reference.north_m(index)});
  }
}

void Picture::on_error(const scoring::PositionError& error) {
  Trace<ComparedPoint>& trace = error.kind() == scoring::RAW_FIX ? fixes_ : estimates_;
  trace.add(
      {.time_s = seconds_at(time_of(error.header())),
       .position = {.east_m = error.east_m(), .north_m = error.north_m()},
       .reference = {.east_m = error.reference_east_m(), .north_m = error.reference_north_m()},
       .error_m = error.error_m()});
}

void Picture::on_status(const supervision::Status& status) {
  if (status.judgement() != judgement_) {
    end_span();
    judgement_ = status.judgement();
  }
}

void Picture::end_span() {
  const double now_s = seconds_at(now());
  if (spans_.size() < kSpansMax) {
    spans_.push_back({.from_s = span_from_s_, .to_s = now_s, .judgement = name_of(judgement_)});
    span_from_s_ = now_s;
  }
}

void Picture::stop() {
  end_span();
  const DrivePicture picture{.title = title_.get(),
                             .subtitle = fmt::format("{:.0f} s, {:.0f} m, {} fixes", last_pose_s_,
                                                     distance_m_, fixes_count_),
                             .reference = reference_.points(),
                             .estimate = estimate_.points(),
                             .fixes = fixes_.points(),
                             .estimates = estimates_.points(),
                             .judgements = spans_};
  try {
    ads::write_file(file_.get(), draw_svg(picture));
    report("file", std::filesystem::absolute(file_.get()).lexically_normal().string());
  } catch (const std::runtime_error& error) {
    log().warning("{}", error.what());
    health(fastcycle::Health::kDegraded, "the picture of the drive cannot be written");
  }
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::Picture)
