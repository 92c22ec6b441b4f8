#include "judge.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include <fmt/format.h>

namespace rav4 {
namespace {

constexpr int kLostAges = 10;

double seconds(fastcycle::Duration duration) {
  return std::chrono::duration<double>(duration).count();
}

// The judgement of one stream; ready if it has no fault.
Judgement judge(const StreamWatch& stream, fastcycle::Time now) {
  const StreamLimits& limits = stream.limits();
  if (!stream.newest()) {
    return {limits.is_essential ? Verdict::kStarting : Verdict::kDegraded,
            fmt::format("no {} yet", limits.name)};
  }
  const fastcycle::Duration age = now - *stream.newest();
  if (limits.is_essential && age > kLostAges * limits.age_max) {
    return {Verdict::kLost, fmt::format("no {} for {:.1f} s", limits.name, seconds(age))};
  }
  if (age > limits.age_max) {
    return {Verdict::kDegraded, fmt::format("no {} for {:.1f} s", limits.name, seconds(age))};
  }
  const auto rate = stream.rate_hz();
  if (rate && *rate < limits.rate_min_hz) {
    return {Verdict::kDegraded, fmt::format("{} at {:.0f} Hz, expected at least {:g}", limits.name,
                                            *rate, limits.rate_min_hz)};
  }
  return {Verdict::kReady, ""};
}

Judgement judge(std::optional<double> stddev_m, const PositionLimits& limits) {
  if (!stddev_m) {
    return {Verdict::kStarting, "no position yet"};
  }
  if (!(*stddev_m <= limits.lost_stddev_m)) {
    return {Verdict::kLost, fmt::format("position uncertain by {:.1f} m", *stddev_m)};
  }
  if (*stddev_m > limits.degraded_stddev_m) {
    return {Verdict::kDegraded, fmt::format("position uncertain by {:.1f} m", *stddev_m)};
  }
  return {Verdict::kReady, ""};
}

// A stream that has not started is neither good nor bad.
int severity(Verdict verdict) {
  switch (verdict) {
    case Verdict::kReady:
      return 0;
    case Verdict::kDegraded:
      return 1;
    case Verdict::kLost:
      return 2;
    case Verdict::kStarting:
      return 3;
  }
  return 3;
}

}  // namespace

void StreamWatch::on_message(fastcycle::Time taken) {
  ++count_;
  ++counts_[slot_];
  newest_ = newest_ ? std::max(*newest_, taken) : taken;
}

void StreamWatch::next_slot() {
  full_slots_ = newest_ ? std::min(full_slots_ + 1, kSlots) : 0;
  slot_ = (slot_ + 1) % kSlots;
  counts_[slot_] = 0;
}

// The slot that is being filled counts with none of its time: the others are whole.
std::optional<double> StreamWatch::rate_hz() const {
  if (full_slots_ < kSlots) {
    return std::nullopt;
  }
  const auto whole =
      std::accumulate(counts_.begin(), counts_.end(), std::int64_t{0}) - counts_[slot_];
  return static_cast<double>(whole) / seconds(kSlot * (kSlots - 1));
}

Judgement judge(const std::vector<StreamWatch>& streams, std::optional<double> position_stddev_m,
                const PositionLimits& limits, fastcycle::Time now) {
  Judgement worst = judge(position_stddev_m, limits);
  for (const StreamWatch& stream : streams) {
    Judgement judgement = judge(stream, now);
    if (severity(judgement.verdict) > severity(worst.verdict)) {
      worst = std::move(judgement);
    }
  }
  return worst;
}

}  // namespace rav4
