#include "supervision.h"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>

#include "applications/rav4/drive/playback.h"
#include "can/frame.pb.h"
#include "gnss/fix.pb.h"
#include "motion/motion.pb.h"
#include "radar/tracks.pb.h"
#include "vehicle/motion.pb.h"

namespace rav4 {
namespace {

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
  watch<localization::Pose>(
      context, "localization/pose", "pose", {.rate_hz = 40.0, .age_s = 0.2, .essential = true},
      [this](const localization::Pose& pose) { position_stddev_m_ = pose.position_stddev_m(); });
  context.create_timer({.period = StreamWatch::kSlot}, [this] { judge_now(); });
}

void Supervision::stop() {
  report("frames", streams_.front().count());
  report("judgement", std::string(text_of(judgement_.verdict)));
  count_time();
  for (const Verdict verdict : {Verdict::kReady, Verdict::kDegraded, Verdict::kLost}) {
    report(fmt::format("{}_s", text_of(verdict)), seconds_in_[verdict]);
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

void Supervision::judge_now() {
  for (StreamWatch& stream : streams_) {
    stream.next_slot();
  }
  Judgement judgement = judge(streams_, position_stddev_m_, position_limits_, now());
  if (judgement.verdict != judgement_.verdict) {
    log().info("{} -> {}{}{}", text_of(judgement_.verdict), text_of(judgement.verdict),
               judgement.reason.empty() ? "" : ": ", judgement.reason);
    count_time();
  }
  judgement_ = std::move(judgement);
  auto status = statuses_.loan();
  status->mutable_header()->set_taken_ns(nanoseconds_of(now()));
  status->set_judgement(message_of(judgement_.verdict));
  status->set_reason(judgement_.reason);
  statuses_.publish(std::move(status));
}

// Until now it had the present judgement.
void Supervision::count_time() {
  const double now_s = seconds_at(now());
  seconds_in_[judgement_.verdict] += std::max(0.0, now_s - counted_until_s_);
  counted_until_s_ = now_s;
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::Supervision)
