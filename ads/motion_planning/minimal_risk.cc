#include "minimal_risk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace motion_planning {
namespace {

constexpr std::array kBrakings_mps2 = {2.0, 3.0, 4.0, 5.0, 6.0, 8.0};
constexpr double kJerk_mps3 = 15.0;
// What it holds the brake after it has stopped, and what it looks at.
constexpr double kStanding_s = 1.0;

// The line of a trajectory, by its length.
class Line {
 public:
  explicit Line(const Trajectory& trajectory) {
    for (const State& state : trajectory.states) {
      const double way = states_.empty() ? 0.0
                                         : std::hypot(state.x_m - states_.back().x_m,
                                                      state.y_m - states_.back().y_m);
      if (states_.empty() || way > 1e-3) {
        alongs_m_.push_back(states_.empty() ? 0.0 : alongs_m_.back() + way);
        states_.push_back(state);
      }
    }
  }

  [[nodiscard]] State at(double along_m) const {
    if (states_.size() < 2 || along_m >= alongs_m_.back()) {
      State end = states_.back();
      const double beyond = along_m - alongs_m_.back();
      end.x_m += beyond * std::cos(end.heading_rad);
      end.y_m += beyond * std::sin(end.heading_rad);
      end.steering_rad = states_.size() < 2 ? end.steering_rad : 0.0;
      return end;
    }
    const auto after = std::upper_bound(alongs_m_.begin(), alongs_m_.end(), along_m);
    const auto index = static_cast<std::size_t>(after - alongs_m_.begin());
    const double share =
        (along_m - alongs_m_[index - 1]) / (alongs_m_[index] - alongs_m_[index - 1]);
    return between(states_[index - 1], states_[index], share);
  }

 private:
  std::vector<State> states_;
  std::vector<double> alongs_m_;
};

Trajectory braked(const Line& line, const Trajectory& along, double braking_mps2) {
  Trajectory stop{.start_s = along.start_s, .step_s = along.step_s, .states = {}};
  double speed = along.states.front().speed_mps;
  double acceleration = along.states.front().acceleration_mps2;
  double driven = 0.0;
  const double step = stop.step_s;
  const auto standing = static_cast<std::size_t>(kStanding_s / step);
  for (std::size_t stood = 0; stood < standing && stop.states.size() < 400;) {
    State state = line.at(driven);
    state.speed_mps = speed;
    state.acceleration_mps2 = speed > 0.0 ? acceleration : 0.0;
    stop.states.push_back(state);
    stood += speed > 0.0 ? 0 : 1;
    acceleration += std::clamp(-braking_mps2 - acceleration, -kJerk_mps3 * step, kJerk_mps3 * step);
    const double next = std::max(0.0, speed + step * acceleration);
    driven += 0.5 * step * (speed + next);
    speed = next;
  }
  return stop;
}

// Whether a driver who comes from behind, on the same line, would run into the vehicle.
bool is_run_into(const Problem& problem, const Trajectory& stop, const Occupant& behind) {
  constexpr double kReaction_s = 1.0;
  constexpr double kBraking_mps2 = 5.0;
  const State& start = stop.states.front();
  const double distance = std::cos(behind.heading_rad) * (start.x_m - behind.x_m) +
                          std::sin(behind.heading_rad) * (start.y_m - behind.y_m);
  double gap = distance - behind.half_length_m - problem.vehicle.length_m / 2.0;
  double speed = behind.speed_mps;
  for (std::size_t index = 0; index < stop.states.size(); ++index) {
    const double time = stop.step_s * static_cast<double>(index);
    const double own = stop.states[index].speed_mps;
    if (time > kReaction_s && speed > own) {
      speed = std::max(own, speed - stop.step_s * kBraking_mps2);
    }
    gap += stop.step_s * (own - speed);
    if (gap < 0.0) {
      return true;
    }
  }
  return false;
}

}  // namespace

Stop stop_along(const Problem& problem, const Trajectory& along) {
  const Line line(along);
  const State& start = along.states.front();
  // Those who come from behind on the same line see the vehicle brake.
  std::vector<bool> is_behind;
  std::vector<const Occupant*> followers;
  for (const Occupant& occupant : problem.traffic.at(0)) {
    is_behind.resize(std::max(is_behind.size(), occupant.object + 1), false);
    const double dx = occupant.x_m - start.x_m;
    const double dy = occupant.y_m - start.y_m;
    const double ahead = dx * std::cos(start.heading_rad) + dy * std::sin(start.heading_rad);
    const double left = -dx * std::sin(start.heading_rad) + dy * std::cos(start.heading_rad);
    const bool is_aligned = std::cos(occupant.heading_rad - start.heading_rad) > 0.85;
    const double beside = occupant.half_width_m + problem.vehicle.width_m / 2.0;
    if (ahead < -problem.vehicle.length_m / 2.0 && std::abs(left) < beside && is_aligned) {
      is_behind[occupant.object] = true;
      followers.push_back(&occupant);
    }
  }
  Stop best;
  double best_price = std::numeric_limits<double>::infinity();
  for (const double braking : kBrakings_mps2) {
    Trajectory stop = braked(line, along, braking);
    const Verdict verdict =
        judge(problem.vehicle, stop, problem.traffic, stop.duration_s(), is_behind);
    double price = braking;
    if (std::isfinite(verdict.hit_s)) {
      price +=
          1000.0 / (0.2 + verdict.hit_s) + 100.0 * stop.at(stop.start_s + verdict.hit_s).speed_mps;
    } else if (verdict.smallest_gap_m < 0.5) {
      price += 20.0 * (0.5 - verdict.smallest_gap_m);
    }
    for (const Occupant* follower : followers) {
      price += is_run_into(problem, stop, *follower) ? 50.0 : 0.0;
    }
    if (price < best_price) {
      best_price = price;
      best = {.trajectory = std::move(stop), .braking_mps2 = braking, .hit_s = verdict.hit_s};
    }
  }
  return best;
}

}  // namespace motion_planning
