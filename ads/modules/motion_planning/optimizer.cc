#include "optimizer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/LU>

#include "common/scalar.h"
#include "motion_planning_tuning.h"

namespace motion_planning {
namespace {

using ads::outside;

// Above what the road allows: a limit as the others, but not worth a collision.
constexpr std::array kAboveBound = {kOptimizer.limit, kOptimizer.above_limit_in_emergency};

double cube(double value) {
  return value * value * value;
}

// The vehicle brakes no harder than it can, or does already.
double possible_jerk_mps3(const State& state, double jerk_mps3) {
  const double hardest_mps2 = std::min(kOptimizer.braking_max_mps2, state.acceleration_mps2);
  return std::max(jerk_mps3, (hardest_mps2 - state.acceleration_mps2) / kStep_s);
}

}  // namespace

// A sum of squares, and its Gauss-Newton approximation.
struct Optimizer::Quadratic {
  double value = 0.0;
  StateVector x = StateVector::Zero();
  StateMatrix xx = StateMatrix::Zero();
  InputVector u = InputVector::Zero();
  Eigen::Matrix2d uu = Eigen::Matrix2d::Zero();
  bool with_derivatives = true;

  void add(int index, double residual, double weight) {
    value += 0.5 * weight * residual * residual;
    x(index) += weight * residual;
    xx(index, index) += weight;
  }
  void add_input(int index, double residual, double weight) {
    value += 0.5 * weight * residual * residual;
    u(index) += weight * residual;
    uu(index, index) += weight;
  }
  void add(const StateVector& jacobian, double residual, double weight) {
    value += 0.5 * weight * residual * residual;
    if (with_derivatives) {
      x += weight * residual * jacobian;
      xx += weight * jacobian * jacobian.transpose();
    }
  }
  // Depends on the pose alone.
  void add_pose(const Eigen::Vector3d& jacobian, double residual, double weight) {
    value += 0.5 * weight * residual * residual;
    if (with_derivatives) {
      x.head<3>() += weight * residual * jacobian;
      xx.topLeftCorner<3, 3>() += weight * jacobian * jacobian.transpose();
    }
  }
  // A residual that pulls less the larger it is (Cauchy), so that what is out of reach does not
  // outweigh all else.
  void add_pose_bounded(const Eigen::Vector3d& jacobian, double residual, double weight,
                        double scale) {
    const double ratio = residual / scale;
    value += 0.5 * weight * scale * scale * std::log1p(ratio * ratio);
    const double reduced = weight / (1.0 + ratio * ratio);
    x.head<3>() += reduced * residual * jacobian;
    xx.topLeftCorner<3, 3>() += reduced * jacobian * jacobian.transpose();
  }
};

struct Optimizer::Gains {
  InputVector open;
  Eigen::Matrix<double, 2, 6> feedback;
};

void Optimizer::add_motion(Quadratic& sum, const State& state, const Input* input) const {
  const Vehicle& vehicle = problem_.vehicle;
  const double speed = state.speed_mps;
  const double a = state.acceleration_mps2;
  const double braking = kOptimizer.braking_mps2[problem_.is_emergency ? 1 : 0];
  const double lateral_max = kOptimizer.lateral_mps2[problem_.is_emergency ? 1 : 0];
  sum.add(4, a, kStep_s * kOptimizer.acceleration);
  if (a < kOptimizer.comfort_braking_mps2 || a > kOptimizer.comfort_speeding_up_mps2) {
    sum.add(4, outside(a, kOptimizer.comfort_braking_mps2, kOptimizer.comfort_speeding_up_mps2),
            kStep_s * kOptimizer.discomfort);
  }
  if (a < braking || a > kOptimizer.speeding_up_mps2) {
    sum.add(4, outside(a, braking, kOptimizer.speeding_up_mps2), kStep_s * kOptimizer.limit);
  }
  if (speed < 0.0) {
    sum.add(3, speed, kStep_s * kOptimizer.limit);
  }
  const double tangent = std::tan(state.steering_rad) / vehicle.wheelbase_m;
  const double lateral = speed * speed * tangent;
  StateVector by_state = StateVector::Zero();
  by_state(3) = 2.0 * speed * tangent;
  by_state(5) = speed * speed /
                (vehicle.wheelbase_m * std::cos(state.steering_rad) * std::cos(state.steering_rad));
  sum.add(by_state, lateral, kStep_s * kOptimizer.lateral_acceleration);
  if (std::abs(lateral) > kOptimizer.comfort_lateral_mps2) {
    sum.add(by_state,
            outside(lateral, -kOptimizer.comfort_lateral_mps2, kOptimizer.comfort_lateral_mps2),
            kStep_s * kOptimizer.discomfort);
  }
  if (std::abs(lateral) > lateral_max) {
    sum.add(by_state, outside(lateral, -lateral_max, lateral_max), kStep_s * kOptimizer.limit);
  }
  const double steering_max = vehicle.steering_max_rad - kOptimizer.steering_spare_rad;
  if (std::abs(state.steering_rad) > steering_max) {
    sum.add(5, outside(state.steering_rad, -steering_max, steering_max),
            kStep_s * kOptimizer.limit);
  }
  if (input == nullptr) {
    return;
  }
  sum.add_input(0, input->jerk_mps3, kStep_s * kOptimizer.jerk);
  // Sideways, the jerk is about v^2 / wheelbase times the steering rate.
  const double jerk_by_rate = speed * speed / vehicle.wheelbase_m;
  sum.add_input(
      1, input->steering_rate_radps,
      kStep_s * (kOptimizer.steering_rate + kOptimizer.lateral_jerk * jerk_by_rate * jerk_by_rate));
  const double rate_max = kOptimizer.steering_rate_share * vehicle.steering_rate_max_radps;
  if (std::abs(input->steering_rate_radps) > rate_max) {
    sum.add_input(1, outside(input->steering_rate_radps, -rate_max, rate_max),
                  kStep_s * kOptimizer.limit);
  }
}

void Optimizer::add_road(Quadratic& sum, std::size_t step, const State& state) const {
  const Road& road = problem_.road;
  const RoadPlace place = road.locate_near(state.x_m, state.y_m, road_hints_[step]);
  const Eigen::Vector3d to_left{-std::sin(place.heading_rad), std::cos(place.heading_rad), 0.0};
  sum.add_pose(to_left, place.offset_m - lanes_m_[step], kStep_s * kOptimizer.lane);
  add_edges(sum, state, place);
  add_speed(sum, step, state, place);
  const bool is_before_goal = goal_step_ != 0 && step <= goal_step_;
  const double error =
      state.speed_mps - cruise_at(problem_, profile_, place.along_m, is_before_goal);
  sum.add(3, error, kStep_s * kOptimizer.cruise * cruise_share(error));
  if (step == problem_.traffic.steps()) {
    sum.add(2, wrapped(state.heading_rad - place.heading_rad), kOptimizer.end_heading);
  }
}

void Optimizer::add_speed(Quadratic& sum, std::size_t step, const State& state,
                          const RoadPlace& place) const {
  const SpeedProfile::Bound bound = profile_.at(place.along_m, kStep_s * static_cast<double>(step));
  const double allowed = std::max(0.0, bound.speed_mps);
  if (state.speed_mps <= allowed) {
    return;
  }
  StateVector by_state = StateVector::Zero();
  by_state(0) = -bound.by_along * std::cos(place.heading_rad);
  by_state(1) = -bound.by_along * std::sin(place.heading_rad);
  by_state(3) = 1.0;
  sum.add(by_state, state.speed_mps - allowed,
          kStep_s * kAboveBound[problem_.is_emergency ? 1 : 0]);
}

// The whole body must stay on the road: in a bend its corners and the middles of its sides come
// nearer to the edges than its centre.
void Optimizer::add_edges(Quadratic& sum, const State& state, const RoadPlace& place) const {
  const Road& road = problem_.road;
  const double half_length = problem_.vehicle.length_m / 2.0;
  const double half_width = problem_.vehicle.width_m / 2.0;
  const double reach = std::hypot(half_length, half_width) + kOptimizer.edge_space_m;
  const double left_m = road.left_edge_m(place.along_m);
  const double right_m = road.right_edge_m(place.along_m);
  if (place.offset_m + reach + kOptimizer.edge_change_m < left_m &&
      -place.offset_m + reach + kOptimizer.edge_change_m < right_m) {
    return;
  }
  const double cosine = std::cos(state.heading_rad);
  const double sine = std::sin(state.heading_rad);
  for (const double ahead : {-half_length, 0.0, half_length}) {
    for (const double aside : {-half_width, half_width}) {
      const double dx = ahead * cosine - aside * sine;
      const double dy = ahead * sine + aside * cosine;
      const RoadPlace at = road.locate_near(state.x_m + dx, state.y_m + dy, place.index);
      const double over_left = at.offset_m + kOptimizer.edge_space_m - road.left_edge_m(at.along_m);
      const double over_right =
          -at.offset_m + kOptimizer.edge_space_m - road.right_edge_m(at.along_m);
      const double side = over_left > over_right ? 1.0 : -1.0;
      const double over = std::max(over_left, over_right);
      if (over > 0.0) {
        const double left_x = -std::sin(at.heading_rad);
        const double left_y = std::cos(at.heading_rad);
        const Eigen::Vector3d jacobian{left_x, left_y, left_y * dx - left_x * dy};
        sum.add_pose(side * jacobian, over, kStep_s * problem_.edge_share * kOptimizer.edge);
        if (over > kOptimizer.edge_space_m - kOptimizer.edge_need_m) {
          sum.add_pose(side * jacobian, over - (kOptimizer.edge_space_m - kOptimizer.edge_need_m),
                       kStep_s * problem_.edge_share * kOptimizer.edge_near);
        }
      }
    }
  }
}

void Optimizer::add_traffic(Quadratic& sum, std::size_t step, const State& state) const {
  const double half_length = problem_.vehicle.length_m / 2.0;
  const double half_width = problem_.vehicle.width_m / 2.0;
  for (const Occupant& occupant : problem_.traffic.at(step)) {
    const double dx = state.x_m - occupant.x_m;
    const double dy = state.y_m - occupant.y_m;
    const double along = dx * occupant.cosine + dy * occupant.sine;
    const double across = -dx * occupant.sine + dy * occupant.cosine;
    const bool is_before = along > 0.0;
    const Occupant::Space& widest = occupant.spaces.front();
    // Rejects most of them; the vehicle's extent is not larger than this whatever its heading.
    const double reach = half_length + half_width;
    if (std::abs(across) > occupant.half_width_m + reach + widest.beside_m ||
        std::abs(along) > occupant.half_length_m + reach + widest.along_m) {
      continue;
    }
    const double angle = state.heading_rad - occupant.heading_rad;
    const double cosine = std::cos(angle);
    const double sine = std::sin(angle);
    const double extent_along = half_length * std::abs(cosine) + half_width * std::abs(sine);
    const double extent_across = half_length * std::abs(sine) + half_width * std::abs(cosine);
    const double along_by_angle = -half_length * std::copysign(sine, sine * cosine) * 1.0 +
                                  half_width * std::copysign(cosine, sine * cosine);
    const double across_by_angle = half_length * std::copysign(cosine, sine * cosine) -
                                   half_width * std::copysign(sine, sine * cosine);
    const double gap_along = std::abs(along) - occupant.half_length_m - extent_along;
    const double gap_across = std::abs(across) - occupant.half_width_m - extent_across;
    const double sign_along = is_before ? 1.0 : -1.0;
    const double sign_across = across > 0.0 ? 1.0 : -1.0;
    for (const Occupant::Space& space : occupant.spaces) {
      const double into_along = space.along_m - gap_along;
      const double into_across = space.beside_m - gap_across;
      if (into_along <= 0.0 || into_across <= 0.0) {
        break;
      }
      // How far it is into the space around the box: a smooth minimum of both.
      const double norm = std::sqrt(into_along * into_along + into_across * into_across);
      const double residual = into_along * into_across / norm;
      const double by_along = cube(into_across / norm);
      // If it is apart along the road, the vehicle keeps its lane: the search decides on changes.
      const double by_across = gap_along > 0.0 ? 0.0 : cube(into_along / norm);
      const Eigen::Vector3d jacobian{
          -by_along * sign_along * occupant.cosine + by_across * sign_across * occupant.sine,
          -by_along * sign_along * occupant.sine - by_across * sign_across * occupant.cosine,
          by_along * along_by_angle + by_across * across_by_angle};
      sum.add_pose(jacobian, residual, kStep_s * space.weight);
    }
  }
}

void Optimizer::add_goal(Quadratic& sum, std::size_t step, const State& state) const {
  const Goal& goal = *problem_.goal;
  const double way = state.speed_mps * goal_extra_s_;
  const double x = state.x_m + way * std::cos(state.heading_rad);
  const double y = state.y_m + way * std::sin(state.heading_rad);
  double cosine = std::cos(goal.centre.heading_rad);
  double sine = std::sin(goal.centre.heading_rad);
  double along = (x - goal.centre.x_m) * cosine + (y - goal.centre.y_m) * sine;
  double across = -(x - goal.centre.x_m) * sine + (y - goal.centre.y_m) * cosine;
  if (goal.on_road) {
    const RoadPlace place = problem_.road.locate_near(x, y, road_hints_[step]);
    cosine = std::cos(place.heading_rad);
    sine = std::sin(place.heading_rad);
    along = place.along_m - goal.on_road->middle_m();
    across = place.offset_m - goal.on_road->offset_m(place.along_m);
  }
  const Eigen::Vector3d by_along{cosine, sine, 0.0};
  const Eigen::Vector3d by_across{-sine, cosine, 0.0};
  const double room_along = goal.room_along_m();
  const double room_across = kProblem.goal_width_share * goal.half_width_m;
  if (!goal.on_road) {
    sum.add_pose_bounded(by_along, along, kOptimizer.goal_centre, 1.0);
  }
  sum.add_pose_bounded(by_across, across, kOptimizer.goal_centre, 1.0);
  if (std::abs(along) > room_along) {
    sum.add_pose_bounded(by_along, outside(along, -room_along, room_along),
                         problem_.goal_share * kOptimizer.goal_place, kOptimizer.goal_far_m);
  }
  if (std::abs(across) > room_across) {
    sum.add_pose_bounded(by_across, outside(across, -room_across, room_across),
                         problem_.goal_share * kOptimizer.goal_place, kOptimizer.goal_far_m);
  }
  const double middle = 0.5 * (goal.heading_rad.low + goal.heading_rad.high);
  if (std::isfinite(middle)) {
    const double room = 0.5 * 0.5 * (goal.heading_rad.high - goal.heading_rad.low);
    const double angle = wrapped(state.heading_rad - middle);
    sum.add(2, angle, kOptimizer.goal_ahead);
    if (std::abs(angle) > room) {
      sum.add(2, outside(angle, -room, room), problem_.goal_share * kOptimizer.goal_heading);
    }
  }
  const double slack =
      std::min(kOptimizer.goal_speed_spare_mps,
               kOptimizer.goal_speed_spare_share * (goal.speed_mps.high - goal.speed_mps.low));
  const double low = goal.speed_mps.low > 0.0 ? goal.speed_mps.low + slack : goal.speed_mps.low;
  const double high = goal.speed_mps.high - slack;
  if (state.speed_mps < low || state.speed_mps > high) {
    sum.add(3, outside(state.speed_mps, low, high), problem_.goal_share * kOptimizer.goal_speed);
  }
}

void Optimizer::add_pursuit(Quadratic& sum, const Pose& pose, const State& state) const {
  sum.add(0, state.x_m - pose.x_m, kStep_s * kOptimizer.pursuit);
  sum.add(1, state.y_m - pose.y_m, kStep_s * kOptimizer.pursuit);
  sum.add(2, wrapped(state.heading_rad - pose.heading_rad), kStep_s * kOptimizer.pursuit_heading);
}

void Optimizer::add_stage(Quadratic& sum, std::size_t step, const State& state,
                          const Input* input) const {
  add_motion(sum, state, input);
  if (pursued_ != nullptr) {
    if (step > 0) {
      add_pursuit(sum, (*pursued_)[step - 1], state);
    }
    return;
  }
  add_road(sum, step, state);
  add_traffic(sum, step, state);
  if (goal_step_ != 0 && step == goal_step_) {
    add_goal(sum, step, state);
  }
}

double Optimizer::total_cost(const Way& way) {
  Quadratic sum;
  sum.with_derivatives = false;
  for (std::size_t step = 0; step < way.states.size(); ++step) {
    add_stage(sum, step, way.states[step], step < way.inputs.size() ? &way.inputs[step] : nullptr);
  }
  return sum.value;
}

// Which lane each step keeps to, and when the goal is to be reached: as near to what the way does
// as can be.
void Optimizer::aim(const Way& way) {
  const std::size_t count = way.states.size();
  road_hints_.resize(count);
  lanes_m_.resize(count);
  RoadPlace place = problem_.road.locate(way.states[0].x_m, way.states[0].y_m);
  for (std::size_t step = 0; step < count; ++step) {
    const State& state = way.states[step];
    place = problem_.road.locate_near(state.x_m, state.y_m, place.index);
    road_hints_[step] = place.index;
    lanes_m_[step] = problem_.road.lane_m(place.along_m, place.offset_m);
  }
  goal_step_ = 0;
  if (!problem_.goal) {
    return;
  }
  double best = std::numeric_limits<double>::infinity();
  const Interval& window = problem_.goal->time_s;
  const double spare = std::min(0.15, 0.5 * (window.high - window.low));
  for (std::size_t step = 1; step < count; ++step) {
    const double time = kStep_s * static_cast<double>(step);
    const double wanted = std::clamp(time, window.low + spare, window.high - spare);
    if (std::abs(wanted - time) > kStep_s / 2.0 + 1e-9) {
      continue;
    }
    goal_extra_s_ = wanted - time;
    Quadratic sum;
    add_goal(sum, step, way.states[step]);
    if (sum.value < best) {
      best = sum.value;
      goal_step_ = step;
    }
  }
  if (goal_step_ != 0) {
    const double time = kStep_s * static_cast<double>(goal_step_);
    goal_extra_s_ = std::clamp(time, window.low + spare, window.high - spare) - time;
  }
}

Way Optimizer::roll_out(const std::vector<Input>& inputs) const {
  Way way{.states = {problem_.start}, .inputs = inputs};
  way.states.reserve(inputs.size() + 1);
  for (Input& input : way.inputs) {
    if (problem_.is_emergency) {
      input.jerk_mps3 = possible_jerk_mps3(way.states.back(), input.jerk_mps3);
    }
    way.states.push_back(drive(problem_.vehicle, way.states.back(), input, kStep_s));
  }
  return way;
}

Way Optimizer::descend(Way way, int iterations_max) {
  const std::size_t steps = way.inputs.size();
  std::vector<Gains> gains(steps);
  way.cost = total_cost(way);
  double damping = 1e-6;
  for (int iteration = 0; iteration < iterations_max; ++iteration) {
    StateVector value_x;
    StateMatrix value_xx;
    double expected = 0.0;
    for (std::size_t step = steps + 1; step-- > 0;) {
      Quadratic stage;
      add_stage(stage, step, way.states[step], step < steps ? &way.inputs[step] : nullptr);
      if (step == steps) {
        value_x = stage.x;
        value_xx = stage.xx;
        continue;
      }
      StepJacobians jacobians;
      drive(problem_.vehicle, way.states[step], way.inputs[step], kStep_s, &jacobians);
      const StateMatrix& a = jacobians.by_state;
      const InputMatrix& b = jacobians.by_input;
      const StateVector q_x = stage.x + a.transpose() * value_x;
      const InputVector q_u = stage.u + b.transpose() * value_x;
      const StateMatrix q_xx = stage.xx + a.transpose() * value_xx * a;
      const Eigen::Matrix<double, 2, 6> q_ux = b.transpose() * value_xx * a;
      Eigen::Matrix2d q_uu = stage.uu + b.transpose() * value_xx * b;
      q_uu.diagonal().array() += damping;
      const Eigen::Matrix2d inverse = q_uu.inverse();
      Gains& gain = gains[step];
      gain.open = -inverse * q_u;
      gain.feedback = -inverse * q_ux;
      expected += -0.5 * q_u.dot(gain.open);
      value_x = q_x + q_ux.transpose() * gain.open;
      value_xx = q_xx + q_ux.transpose() * gain.feedback;
      value_xx = 0.5 * (value_xx + value_xx.transpose()).eval();
    }
    if (!(expected > 1e-4 * std::max(1.0, way.cost))) {
      break;
    }
    bool is_better = false;
    Way trial;
    for (const double share : {1.0, 0.5, 0.25, 0.1, 0.02}) {
      trial = {.states = {way.states[0]}, .inputs = std::vector<Input>(steps)};
      trial.states.reserve(steps + 1);
      for (std::size_t step = 0; step < steps; ++step) {
        const State& now = trial.states[step];
        const State& was = way.states[step];
        StateVector change;
        change << now.x_m - was.x_m, now.y_m - was.y_m, now.heading_rad - was.heading_rad,
            now.speed_mps - was.speed_mps, now.acceleration_mps2 - was.acceleration_mps2,
            now.steering_rad - was.steering_rad;
        const InputVector input = share * gains[step].open + gains[step].feedback * change;
        const double rate_max = problem_.vehicle.steering_rate_max_radps;
        trial.inputs[step] = {
            .jerk_mps3 = std::clamp(way.inputs[step].jerk_mps3 + input(0),
                                    -kOptimizer.jerk_max_mps3, kOptimizer.jerk_max_mps3),
            .steering_rate_radps =
                std::clamp(way.inputs[step].steering_rate_radps + input(1), -rate_max, rate_max)};
        if (problem_.is_emergency) {
          trial.inputs[step].jerk_mps3 = possible_jerk_mps3(now, trial.inputs[step].jerk_mps3);
        }
        // The wheels turn no farther than they can.
        const double most = std::max(problem_.vehicle.steering_max_rad, std::abs(now.steering_rad));
        double& rate = trial.inputs[step].steering_rate_radps;
        rate = std::clamp(rate, (-most - now.steering_rad) / kStep_s,
                          (most - now.steering_rad) / kStep_s);
        trial.states.push_back(drive(problem_.vehicle, now, trial.inputs[step], kStep_s));
      }
      trial.cost = total_cost(trial);
      if (trial.cost < way.cost - 1e-3 * share * expected) {
        is_better = true;
        break;
      }
    }
    if (!is_better) {
      if (damping > 1.0) {
        break;
      }
      damping = std::max(1e-3, 100.0 * damping);
      continue;
    }
    const double gained = way.cost - trial.cost;
    way = std::move(trial);
    if (gained < 2e-3 * way.cost) {
      break;
    }
    damping = std::max(1e-6, 0.1 * damping);
  }
  return way;
}

Way Optimizer::follow(const std::vector<Pose>& guess) {
  pursued_ = &guess;
  Way way = descend(roll_out(std::vector<Input>(guess.size())), 6);
  pursued_ = nullptr;
  return way;
}

Way Optimizer::improve(const Way& guess) {
  Way way = roll_out(guess.inputs);
  aim(way);
  way = descend(std::move(way), kIterationsMax / 2);
  aim(way);
  way = descend(std::move(way), kIterationsMax / 2);
  return way;
}

double Optimizer::cost(const Way& way) {
  aim(way);
  return total_cost(way);
}

}  // namespace motion_planning
