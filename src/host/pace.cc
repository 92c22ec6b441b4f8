#include "host/pace.h"

#include <algorithm>

#include "base/clock.h"

namespace fastcycle::host {

Time WallPace::position(std::int64_t wall_ns) const noexcept {
  const double ahead = is_paused_ ? 0.0 : static_cast<double>(wall_ns - anchor_ns_) * rate_;
  return anchor_ + Duration(static_cast<std::int64_t>(ahead));
}

void WallPace::move_anchor() {
  const std::int64_t wall_ns = base::monotonic_ns();
  anchor_ = position(wall_ns);
  anchor_ns_ = wall_ns;
}

void WallPace::begin(Time time) {
  const std::lock_guard lock(mutex_);
  anchor_ = time;
  anchor_ns_ = base::monotonic_ns();
}

void WallPace::set_paused(bool is_paused) {
  {
    const std::lock_guard lock(mutex_);
    move_anchor();
    is_paused_ = is_paused;
    steps_ = 0;
  }
  on_change();
}

bool WallPace::is_paused() const {
  const std::lock_guard lock(mutex_);
  return is_paused_;
}

void WallPace::set_rate(double rate) {
  {
    const std::lock_guard lock(mutex_);
    move_anchor();
    rate_ = rate;
  }
  on_change();
}

double WallPace::rate() const {
  const std::lock_guard lock(mutex_);
  return rate_;
}

void WallPace::step() {
  {
    const std::lock_guard lock(mutex_);
    move_anchor();
    is_paused_ = true;
    ++steps_;
  }
  on_change();
}

std::int64_t WallPace::may_go_at(Time next) noexcept {
  const std::lock_guard lock(mutex_);
  if (steps_ > 0) {
    return 0;
  }
  if (is_paused_) {
    return base::kNever;
  }
  const double ahead_ns = static_cast<double>((next - anchor_).count()) / rate_;
  // Far beyond any run, and not beyond what can be added.
  constexpr double kMostNs = 1e18;
  return anchor_ns_ + static_cast<std::int64_t>(std::min(ahead_ns, kMostNs));
}

void WallPace::goes(Time next, bool is_fed) noexcept {
  const std::lock_guard lock(mutex_);
  if (is_paused_) {
    anchor_ = next;
  }
  if (is_fed && steps_ > 0) {
    --steps_;
  }
}

}  // namespace fastcycle::host
