// A lidar, and a tracker with a bug in it, which only a search for faults finds.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include <fastcycle/fastcycle.h>

#include "campaign_test/sweep.pb.h"

namespace {

using campaign_test::Sweep;
using campaign_test::Track;

/// Publishes a sweep in every serve period, with one object that comes nearer; ends after `count`.
class Lidar final : public fastcycle::Component {
 public:
  explicit Lidar(fastcycle::Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 100})),
        sweeps_(context.create_publisher<Sweep>("sweeps")),
        source_(context.create_source()) {}

  void serve() override {
    if (number_ == count_.get()) {
      source_.finish();
      return;
    }
    auto sweep = sweeps_.loan();
    sweep->set_number(++number_);
    sweep->set_stamp_s(0.1 * static_cast<double>(number_));
    auto* const object = sweep->add_objects();
    object->set_range_m(100.0 - 5.0 * sweep->stamp_s());
    object->set_speed_mps(-5.0);
    sweeps_.publish(std::move(sweep));
  }

 private:
  fastcycle::Param<std::int64_t> count_;
  fastcycle::Publisher<Sweep> sweeps_;
  fastcycle::Source source_;
  std::int64_t number_ = 0;
};

/// Follows the object. The bug: where it coasts, it looks only one sweep back, so that a track
/// that was not seen for two sweeps is forgotten.
class Tracker final : public fastcycle::Component {
 public:
  explicit Tracker(fastcycle::Context& context)
      : Component(context),
        crashes_on_nan_(context.param<bool>("crashes_on_nan", {.fallback = false})),
        tracks_(context.create_publisher<Track>("tracks")) {
    context.create_subscriber<Sweep>("sweeps", [this](const Sweep& sweep) { on_sweep(sweep); });
  }

  void stop() override {
    report("tracks_lost", lost_);
    report("sweeps", sweeps_);
    report("range_sum_m", sum_m_);
  }

 private:
  void on_sweep(const Sweep& sweep) {
    ++sweeps_;
    if (last_s_ > 0 && sweep.stamp_s() - last_s_ > 0.25) {
      age_ = 0;
      ++lost_;
    }
    last_s_ = sweep.stamp_s();
    const double range_m = sweep.objects(0).range_m();
    if (std::isnan(range_m) && crashes_on_nan_.get()) {
      __builtin_trap();
    }
    sum_m_ += range_m;
    auto track = tracks_.loan();
    track->set_range_m(range_m);
    track->set_age(++age_);
    tracks_.publish(std::move(track));
  }

  fastcycle::Param<bool> crashes_on_nan_;
  fastcycle::Publisher<Track> tracks_;
  double last_s_ = 0;
  double sum_m_ = 0;
  std::int64_t age_ = 0;
  std::int64_t lost_ = 0;
  std::int64_t sweeps_ = 0;
};

/// Counts tracks, and how far apart they came.
class Planner final : public fastcycle::Component {
 public:
  explicit Planner(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<Track>("tracks", [this](const Track& track) { on_track(track); });
  }

  void stop() override {
    report("tracks", tracks_);
    report("longest_gap_ms", longest_ms_);
  }

 private:
  void on_track(const Track&) {
    const fastcycle::Time time = now();
    if (tracks_++ > 0) {
      longest_ms_ =
          std::max(longest_ms_, std::chrono::duration<double, std::milli>(time - last_).count());
    }
    last_ = time;
  }

  std::int64_t tracks_ = 0;
  fastcycle::Time last_{};
  double longest_ms_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENTS(Lidar, Tracker, Planner)
