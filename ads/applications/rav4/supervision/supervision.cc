#include "supervision.h"

#include <chrono>
#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

#include "applications/rav4/drive/playback.h"
#include "can/frame.pb.h"
#include "common/files.h"
#include "gnss/fix.pb.h"
#include "motion/motion.pb.h"
#include "radar/tracks.pb.h"
#include "vehicle/motion.pb.h"

namespace rav4 {
namespace {

constexpr std::size_t kSpansMax = 1'000;

std::string_view text_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kStarting:
      return "starting";
    case Verdict::kReady:
      return "ready";
    case Verdict::kDegraded:
      return "degraded";
    case Verdict::kLost:
      return "lost";
  }
  return "lost";
}

supervision::Judgement message_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kStarting:
      return supervision::STARTING;
    case Verdict::kReady:
      return supervision::READY;
    case Verdict::kDegraded:
      return supervision::DEGRADED;
    case Verdict::kLost:
      return supervision::LOST;
  }
  return supervision::LOST;
}

fastcycle::Time taken_of(const common::Header& header) {
  return fastcycle::Time(fastcycle::Duration(header.taken_ns()));
}

}  // namespace

template <typename T>
void Supervision::watch(fastcycle::Context& context, std::string_view topic,
                        const std::string& name, const StreamDefaults& defaults,
                        std::function<void(const T&)> and_then) {
  const double rate_hz =
      context
          .param<double>(name + ".rate_min_hz",
                         {.fallback = defaults.rate_hz,
                          .min = 0.0,
                          .unit = "Hz",
                          .description = "Below this rate, the state is degraded"})
          .get();
  const double age_s = context
                           .param<double>(name + ".age_max_s",
                                          {.fallback = defaults.age_s,
                                           .min = 0.0,
                                           .max = 1e6,
                                           .unit = "s",
                                           .description = "Above this age, the state is degraded"})
                           .get();
  const std::size_t index = streams_.size();
  streams_.emplace_back(StreamLimits{.name = std::string(topic),
                                     .rate_min_hz = rate_hz,
                                     .age_max = fastcycle::Duration(std::llround(age_s * 1e9)),
                                     .is_essential = defaults.essential});
  context.create_subscriber<T>(topic,
                               [this, index, and_then = std::move(and_then)](const T& message) {
                                 streams_[index].on_message(taken_of(message.header()));
                                 if (and_then) {
                                   and_then(message);
                                 }
                               });
}

Supervision::Supervision(fastcycle::Context& context)
    : Component(context),
      picture_file_(context.param<fastcycle::Path>(
          "picture", {.fallback = fastcycle::Path("drive.svg"),
                      .description = "SVG file of the drive; empty: none"})),
      title_(context.param<std::string>(
          "title", {.fallback = "A drive", .description = "Title of the picture"})),
      position_limits_{.degraded_stddev_m = stddev(context, "position_degraded_stddev_m", 5.0),
                       .lost_stddev_m = stddev(context, "position_lost_stddev_m", 20.0)},
      statuses_(context.create_publisher<supervision::Status>("supervision/status")) {
  watch<can::Frame>(context, "can/frames", "can", {.rate_hz = 1000.0, .age_s = 0.2});
  watch<gnss::Fix>(context, "gnss/fix", "gnss", {.rate_hz = 5.0, .age_s = 0.5});
  watch<radar::Tracks>(context, "radar/tracks", "radar", {.rate_hz = 10.0, .age_s = 0.3});
  watch<motion::Imu>(context, "imu/gyro", "gyro",
                     {.rate_hz = 50.0, .age_s = 0.2, .essential = true});
  watch<vehicle::WheelSpeeds>(context, "vehicle/wheel_speeds", "wheels",
                              {.rate_hz = 40.0, .age_s = 0.2, .essential = true});
  watch<localization::Pose>(context, "localization/pose", "pose",
                            {.rate_hz = 40.0, .age_s = 0.2, .essential = true},
                            [this](const localization::Pose& pose) { on_pose(pose); });
  context.create_subscriber<scoring::Reference>(
      "scoring/reference",
      [this](const scoring::Reference& reference) { on_reference(reference); });
  context.create_subscriber<scoring::PositionError>(
      "scoring/error", [this](const scoring::PositionError& error) { on_error(error); });
  context.create_timer({.period = StreamWatch::kSlot}, [this] { judge_now(); });
}

void Supervision::stop() {
  report("frames", streams_.front().count());
  report("judgement", std::string(text_of(judgement_.verdict)));
  const std::vector<JudgedSpan> spans = spans_until(now());
  for (const Verdict verdict : {Verdict::kReady, Verdict::kDegraded, Verdict::kLost}) {
    double sum_s = 0.0;
    for (const JudgedSpan& span : spans) {
      sum_s += span.judgement == text_of(verdict) ? span.to_s - span.from_s : 0.0;
    }
    report(fmt::format("{}_s", text_of(verdict)), sum_s);
  }
  if (!picture_file_.get().empty()) {
    draw(spans);
    report("picture", std::filesystem::absolute(picture_file_.get()).lexically_normal().string());
  }
}

double Supervision::stddev(fastcycle::Context& context, std::string_view name, double fallback) {
  return context
      .param<double>(name, {.fallback = fallback,
                            .min = 0.0,
                            .unit = "m",
                            .description = "Maximum 1 sigma of the position for this state"})
      .get();
}

double Supervision::seconds_at(fastcycle::Time time) const {
  return std::chrono::duration<double>(time - start_time()).count();
}

void Supervision::on_pose(const localization::Pose& pose) {
  position_stddev_m_ = pose.position_stddev_m();
  estimate_.add({.east_m = pose.east_m(), .north_m = pose.north_m()});
  distance_m_ += std::hypot(pose.east_mps(), pose.north_mps()) *
                 std::max(0.0, seconds_at(taken_of(pose.header())) - last_pose_s_);
  last_pose_s_ = seconds_at(taken_of(pose.header()));
}

void Supervision::on_reference(const scoring::Reference& reference) {
  for (int index = 0; index < std::min(reference.east_m_size(), reference.north_m_size());
       ++index) {
    reference_.add({.east_m = reference.east_m(index), .north_m = reference.north_m(index)});
  }
}

void Supervision::on_error(const scoring::PositionError& error) {
  Trace<ComparedPoint>& trace = error.kind() == scoring::RAW_FIX ? fixes_ : estimates_;
  trace.add(
      {.time_s = seconds_at(taken_of(error.header())),
       .position = {.east_m = error.east_m(), .north_m = error.north_m()},
       .reference = {.east_m = error.reference_east_m(), .north_m = error.reference_north_m()},
       .error_m = error.error_m()});
}

void Supervision::judge_now() {
  for (StreamWatch& stream : streams_) {
    stream.next_slot();
  }
  Judgement judgement = judge(streams_, position_stddev_m_, position_limits_, now());
  if (judgement.verdict != judgement_.verdict) {
    log().info("{} -> {}{}{}", text_of(judgement_.verdict), text_of(judgement.verdict),
               judgement.reason.empty() ? "" : ": ", judgement.reason);
    remember_span();
  }
  judgement_ = std::move(judgement);
  auto status = statuses_.loan();
  status->mutable_header()->set_taken_ns(nanoseconds_of(now()));
  status->set_judgement(message_of(judgement_.verdict));
  status->set_reason(judgement_.reason);
  statuses_.publish(std::move(status));
}

void Supervision::remember_span() {
  const double now_s = seconds_at(now());
  if (spans_.size() < kSpansMax) {
    spans_.push_back({.from_s = span_from_s_,
                      .to_s = now_s,
                      .judgement = std::string(text_of(judgement_.verdict))});
    span_from_s_ = now_s;
  }
}

std::vector<JudgedSpan> Supervision::spans_until(fastcycle::Time time) const {
  std::vector<JudgedSpan> spans = spans_;
  spans.push_back({.from_s = span_from_s_,
                   .to_s = std::max(span_from_s_, seconds_at(time)),
                   .judgement = std::string(text_of(judgement_.verdict))});
  return spans;
}

void Supervision::draw(const std::vector<JudgedSpan>& spans) {
  const DrivePicture picture{
      .title = title_.get(),
      .subtitle = fmt::format("{:.0f} s, {:.0f} m, {} CAN frames, {} fixes", last_pose_s_,
                              distance_m_, streams_[0].count(), streams_[1].count()),
      .reference = reference_.points(),
      .estimate = estimate_.points(),
      .fixes = fixes_.points(),
      .estimates = estimates_.points(),
      .judgements = spans};
  try {
    ads::write_file(picture_file_.get(), draw_svg(picture));
  } catch (const std::runtime_error& error) {
    log().warning("{}", error.what());
    health(fastcycle::Health::kDegraded, "the picture of the drive cannot be written");
  }
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::Supervision)
