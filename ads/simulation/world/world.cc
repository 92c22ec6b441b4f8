#include "world.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "clutter.h"
#include "deviation.h"

namespace ads {
namespace {

using std::chrono_literals::operator""ms;

constexpr fastcycle::Duration kTick = 10ms;
constexpr double kTick_s = 0.01;
constexpr std::int64_t kTicksPerSecond = 100;
constexpr std::int64_t kTicksPerRow = 10;
constexpr double kStanding_mps = 0.01;
// Farther than a lidar reaches.
constexpr double kClutterSeen_m = 150.0;

std::int64_t ticks_of(double seconds) {
  return std::llround(seconds * static_cast<double>(kTicksPerSecond));
}

std::span<const std::uint8_t> payload_of(const can::Frame& frame) {
  return {reinterpret_cast<const std::uint8_t*>(frame.data().data()), frame.data().size()};
}

/// Says which file, and why.
[[noreturn]] void throw_unwritten(const std::filesystem::path& file) {
  throw std::runtime_error(fmt::format("{}: cannot be written: {}", file.string(),
                                       std::generic_category().message(errno)));
}

void begin_file(const std::filesystem::path& file, std::string_view columns, std::ofstream& rows) {
  if (!file.has_filename()) {
    return;
  }
  rows.open(file);
  rows << columns << '\n';
  if (!rows.flush()) {
    throw_unwritten(file);
  }
}

void fill(world::Body& message, const Body& body) {
  message.set_id(body.id);
  message.set_x_m(body.box.center_m.x());
  message.set_y_m(body.box.center_m.y());
  message.set_heading_rad(body.box.heading_rad);
  message.set_length_m(body.box.length_m);
  message.set_width_m(body.box.width_m);
  message.set_height_m(body.height_m);
  message.set_speed_mps(body.speed_mps);
  message.set_yaw_rate_radps(body.yaw_rate_radps);
}

// On its way to the scenario's initial state, with wheels that point along it.
EgoState state_on(const LeadIn& way, double before_m, double speed_mps, const EgoLimits& limits) {
  const LeadIn::Pose pose = way.at(before_m);
  return {.center_m = pose.center_m,
          .heading_rad = pose.heading_rad,
          .speed_mps = speed_mps,
          .steering_rad = std::clamp(std::atan(limits.wheelbase_m * pose.curvature_per_m),
                                     -limits.steering_max_rad, limits.steering_max_rad),
          .yaw_rate_radps = speed_mps * pose.curvature_per_m};
}

}  // namespace

World::Drive::Drive(Scenario read, const Dbc& dbc, const EgoLimits& limits,
                    const EgoDeviation& its_deviation, TrafficMode mode, double settle_s)
    : scenario(std::move(read)),
      begin_s(static_cast<double>(scenario.problem().initial.step) * scenario.step_s),
      lead_in(scenario, scenario.problem().initial, limits.wheelbase_m / 2.0,
              settle_s * std::max(0.0, scenario.problem().initial.speed_mps)),
      initial(state_on(lead_in, 0.0, scenario.problem().initial.speed_mps, limits)),
      deviation(its_deviation),
      ego(limits, initial, its_deviation),
      traffic(scenario, begin_s, mode),
      referee(scenario),
      command(dbc.message("ADS_COMMAND")),
      state(dbc.message("VEHICLE_STATE")),
      command_guard(command),
      state_guard(state) {
  const auto its = std::ranges::find(dbc.messages(), "DRIVER_INPUT", &DbcMessage::name);
  if (its != dbc.messages().end()) {
    driver = *its;
    driver_guard.emplace(*driver);
  }
}

World::World(fastcycle::Context& context)
    : Component(context),
      scenario_(context.param<fastcycle::Path>(
          "scenario", {.description = "The scenario to drive in: CommonRoad XML, 2018b or 2020a"})),
      dbc_(context.param<fastcycle::Path>("dbc", {.description = "The DBC file of the bus"})),
      trajectory_(context.param<fastcycle::Path>(
          "trajectory",
          {.fallback = fastcycle::Path(),
           .description = "CSV file for the trajectory of the ego vehicle; empty: none"})),
      bodies_(context.param<fastcycle::Path>(
          "bodies",
          {.fallback = fastcycle::Path(),
           .description = "CSV file for the poses of all others, at the same times; empty: none"})),
      mode_(context.param<TrafficMode>(
          "traffic",
          {.fallback = TrafficMode::kReplay,
           .names = {{"replay", TrafficMode::kReplay}, {"reactive", TrafficMode::kReactive}},
           .description = "Whether cars behind the ego vehicle leave their recording and follow it "
                          "to avoid a collision"})),
      driver_(context.param<DriverMode>("driver",
                                        {.fallback = DriverMode::kNone,
                                         .names = {{"none", DriverMode::kNone},
                                                   {"hands_off", DriverMode::kHandsOff},
                                                   {"steers", DriverMode::kSteers},
                                                   {"brakes", DriverMode::kBrakes},
                                                   {"presses_button", DriverMode::kPressesButton}},
                                         .description = "What the driver does with the controls"})),
      driver_after_s_(context.param<double>(
          "driver_after_s", {.fallback = 0.0,
                             .min = 0.0,
                             .max = 1e6,
                             .unit = "s",
                             .description = "Time of that, after the start of the scenario"})),
      settle_s_(context.param<double>(
          "settle_s",
          {.fallback = 2.0,
           .min = 0.0,
           .max = 60.0,
           .unit = "s",
           .description =
               "Time for which the world runs before the scenario; a multiple of 0.01"})),
      linger_s_(context.param<double>(
          "linger_s", {.fallback = 0.5,
                       .min = 0.0,
                       .max = 3600.0,
                       .unit = "s",
                       .description = "Time for which the run continues at the goal"})),
      overtime_s_(context.param<double>(
          "overtime_s", {.fallback = 5.0,
                         .min = 0.0,
                         .max = 3600.0,
                         .unit = "s",
                         .description = "Time for a vehicle that has missed the goal to stop"})),
      deviation_(context.param<double>(
          "deviation", {.fallback = 0.0,
                        .min = 0.0,
                        .max = 2.0,
                        .unit = "1",
                        .description = "Deviation of the vehicle from the controller's model, as a "
                                       "share of the bounds in README.md"})),
      clutter_share_(context.param<double>(
          "clutter", {.fallback = 0.0,
                      .min = 0.0,
                      .max = 10.0,
                      .unit = "1",
                      .description = "Density of posts, bushes and walls beside the road; 1: about "
                                     "one per 12 m of an edge"})),
      seed_(context.param<std::uint64_t>(
          "seed",
          {.fallback = 0, .description = "Seed of the vehicle's deviation and the clutter"})),
      limits_(read_limits(context)),
      actuators_(read_actuators(context)),
      scenes_(context.create_publisher<world::Scene>("world/scene")),
      states_(context.create_publisher<can::Frame>("can/state")),
      source_(context.create_source()) {
  context.create_subscriber<can::Frame>("can/command",
                                        [this](const can::Frame& frame) { on_command(frame); });
  context.create_timer({.period = kTick}, [this] { on_tick(); });
}

EgoLimits World::read_limits(fastcycle::Context& context) {
  const EgoLimits usual;
  const auto read = [&](std::string_view name, double fallback, double max, std::string unit,
                        std::string description) {
    return context
        .param<double>(name, {.fallback = fallback,
                              .min = 0.01,
                              .max = max,
                              .unit = std::move(unit),
                              .description = std::move(description)})
        .get();
  };
  return {
      .length_m = read("ego.length_m", usual.length_m, 30.0, "m", "The ego vehicle's box"),
      .width_m = read("ego.width_m", usual.width_m, 5.0, "m", "The ego vehicle's box"),
      .height_m = read("ego.height_m", usual.height_m, 5.0, "m", "The ego vehicle's box"),
      .wheelbase_m = read("ego.wheelbase_m", usual.wheelbase_m, 20.0, "m",
                          "Distance between its axles, which are symmetric to its centre"),
      .steering_max_rad = read("ego.steering_max_rad", usual.steering_max_rad, 1.5, "rad",
                               "Maximum steering angle of the front wheels, to each side"),
      .steering_rate_max_radps = read("ego.steering_rate_max_radps", usual.steering_rate_max_radps,
                                      10.0, "rad/s", "Maximum steering rate of the front wheels"),
      .acceleration_max_mps2 = read("ego.acceleration_max_mps2", usual.acceleration_max_mps2, 20.0,
                                    "m/s2", "Maximum acceleration of the drive"),
      .deceleration_max_mps2 = read("ego.deceleration_max_mps2", usual.deceleration_max_mps2, 20.0,
                                    "m/s2", "Maximum deceleration of the brakes")};
}

Actuators::Options World::read_actuators(fastcycle::Context& context) {
  const Actuators::Options usual;
  return {
      .delay_s = context
                     .param<double>("actuator_delay_s",
                                    {.fallback = usual.delay_s,
                                     .min = 0.0,
                                     .max = 1.0,
                                     .unit = "s",
                                     .description = "Delay from a command to its effect"})
                     .get(),
      .timeout_s =
          context
              .param<double>(
                  "command_timeout_s",
                  {.fallback = usual.timeout_s,
                   .min = 0.01,
                   .max = 10.0,
                   .unit = "s",
                   .description = "Time without commands after which the vehicle brakes by itself"})
              .get(),
      .timeout_braking_mps2 = context
                                  .param<double>("timeout_braking_mps2",
                                                 {.fallback = usual.timeout_braking_mps2,
                                                  .min = 0.1,
                                                  .max = 20.0,
                                                  .unit = "m/s2",
                                                  .description = "Deceleration of that braking"})
                                  .get()};
}

void World::start() {
  begin_tick_ = ticks_of(settle_s_.get());
  if (std::abs(static_cast<double>(begin_tick_) * kTick_s - settle_s_.get()) > 1e-9) {
    throw std::runtime_error(
        fmt::format("settle_s: expected a multiple of 0.01 s, found {}", settle_s_.get()));
  }
  drive_.emplace(Scenario::read(scenario_.get()), Dbc::read(dbc_.get()), limits_,
                 draw_deviation(deviation_.get(), seed_.get()), mode_.get(), settle_s_.get());
  clutter_ = draw_clutter(drive_->scenario, clutter_share_.get(), seed_.get());
  begin_file(trajectory_.get(), "time_s,x_m,y_m,heading_rad,speed_mps", rows_);
  begin_file(bodies_.get(), "time_s,id,x_m,y_m,heading_rad,length_m,width_m,speed_mps", body_rows_);
}

void World::stop() {
  const Referee& referee = drive_->referee;
  report("verdict", referee.verdict());
  report("goal_reached", referee.is_goal_reached());
  if (const auto time_s = referee.goal_time_s()) {
    report("goal_time_s", *time_s);
  }
  report("collisions", static_cast<std::int64_t>(referee.contacts().size()));
  if (const auto& gap = referee.smallest_gap()) {
    report("smallest_gap_m", gap->gap_m);
    report("smallest_gap_to", gap->id);
    report("smallest_gap_at_s", gap->time_s);
  }
  report("off_road_s", referee.off_road_s());
  const Referee::Extremes& extremes = referee.extremes();
  report("acceleration_max_mps2", extremes.acceleration_max_mps2);
  report("acceleration_min_mps2", extremes.acceleration_min_mps2);
  report("lateral_acceleration_max_mps2", extremes.lateral_acceleration_max_mps2);
  report("autonomous_s", static_cast<double>(autonomous_ticks_) * kTick_s);
  report("end_s", drive_time_s());
  report("end_speed_mps", drive_->ego.state().speed_mps);
  report("commands", commands_);
  report("commands_refused", refused_);
  report("commands_lost", static_cast<std::int64_t>(drive_->command_guard.lost()));
  if (deviation_.get() > 0.0) {
    const EgoDeviation& deviation = drive_->deviation;
    report("deviation.steering_gain", deviation.steering_gain);
    report("deviation.understeer_s2_per_m2", deviation.understeer_s2_per_m2);
    report("deviation.force_gain", deviation.force_gain);
    report("deviation.resistance_mps2", deviation.resistance_mps2);
    report("deviation.acceleration_lag_s", deviation.acceleration_lag_s);
    report("deviation.steering_lag_s", deviation.steering_lag_s);
    report("deviation.speed_gain", deviation.speed_gain);
  }
  if (mode_.get() == TrafficMode::kReactive) {
    report("reacting_cars_max", static_cast<std::int64_t>(reacting_max_));
  }
}

void World::on_command(const can::Frame& frame) {
  if (frame.address() != drive_->command.address) {
    return;
  }
  ++commands_;
  const auto payload = payload_of(frame);
  if (drive_->command_guard.check(payload) != FrameGuard::Verdict::kGood) {
    ++refused_;
    return;
  }
  const double time_s =
      std::chrono::duration<double>(now() - start_time()).count() - settle_s_.get();
  if (time_s < 0.0) {
    return;  // a driver drives
  }
  const DbcMessage& command = drive_->command;
  actuators_.take(time_s,
                  {.demand = {.steering_rad = command.signal("STEERING").decode(payload),
                              .acceleration_mps2 = command.signal("ACCELERATION").decode(payload)},
                   .is_autonomous = command.signal("AUTONOMOUS").decode(payload) != 0.0});
}

void World::on_tick() {
  // More than one step where ticks were skipped.
  const std::int64_t due = (now() - start_time()) / kTick;
  while (tick_ < due) {
    ++tick_;
    go_on();
    publish_scene();
    publish_state();
    publish_driver();
  }
}

void World::go_on() {
  const double time_s = drive_time_s();
  const EgoState before = drive_->ego.state();
  drive_->traffic.move_to(drive_->begin_s + time_s, drive_->ego.box(), before.speed_mps);
  if (time_s < 0.0) {
    const double speed_mps = drive_->initial.speed_mps;
    drive_->ego = EgoModel(
        limits_, state_on(drive_->lead_in, -time_s * std::max(0.0, speed_mps), speed_mps, limits_),
        drive_->deviation);
    return;
  }
  if (tick_ == begin_tick_) {
    drive_->ego = EgoModel(limits_, drive_->initial, drive_->deviation);
  } else {
    drive_->ego.advance(kTick_s, actuators_.demand_at(time_s - kTick_s, before));
    autonomous_ticks_ += actuators_.is_autonomous() ? 1 : 0;
  }
  reacting_max_ = std::max(reacting_max_, drive_->traffic.reacting());
  judge(time_s);
  end_when_over(time_s);
}

void World::judge(double time_s) {
  Referee& referee = drive_->referee;
  if (referee.is_goal_reached()) {
    return;
  }
  const EgoState& ego = drive_->ego.state();
  referee.watch(time_s, tick_ == begin_tick_ ? 0.0 : kTick_s, ego, drive_->ego.box(),
                drive_->traffic.bodies());
  // A step between two ticks is judged at the nearer one.
  const std::int64_t ticks = tick_ - begin_tick_;
  const std::int64_t step = std::llround(time_s / drive_->scenario.step_s);
  if (ticks_of(static_cast<double>(step) * drive_->scenario.step_s) == ticks) {
    referee.judge_step(step, ego);
  }
  for (; contacts_logged_ < referee.contacts().size(); ++contacts_logged_) {
    const Referee::Contact& contact = referee.contacts()[contacts_logged_];
    log().warning("the ego vehicle touched {} at {:.2f} s", contact.id, contact.time_s);
  }
  if (ticks % kTicksPerRow == 0 && time_s <= referee.window_end_s() + kTick_s / 2.0) {
    write_row(time_s);
    write_bodies(time_s);
  }
}

void World::end_when_over(double time_s) {
  const Referee& referee = drive_->referee;
  const double end_s = referee.goal_time_s().value_or(referee.window_end_s());
  if (is_over_ || time_s < end_s) {
    return;
  }
  const bool is_standing = drive_->ego.state().speed_mps < kStanding_mps;
  is_over_ = referee.is_goal_reached() ? time_s >= end_s + linger_s_.get()
                                       : is_standing || time_s >= end_s + overtime_s_.get();
  if (is_over_) {
    log().info("{}", referee.verdict());
    source_.finish();
  }
}

void World::publish_scene() {
  const EgoState& ego = drive_->ego.state();
  const Box box = drive_->ego.box();
  auto scene = scenes_.loan();
  scene->mutable_header()->set_taken_ns(time_of_tick().time_since_epoch().count());
  scene->mutable_header()->set_frame("map");
  fill(*scene->mutable_ego(), {.box = box,
                               .height_m = limits_.height_m,
                               .speed_mps = ego.speed_mps,
                               .yaw_rate_radps = ego.yaw_rate_radps});
  scene->set_ego_acceleration_mps2(ego.acceleration_mps2);
  scene->set_ego_steering_rad(ego.steering_rad);
  for (const Body& body : drive_->traffic.bodies()) {
    // Rolled backwards, what drives slower than the ego vehicle may come from where that is.
    if (drive_time_s() < 0.0 && overlap(box, body.box)) {
      continue;
    }
    fill(*scene->add_bodies(), body);
  }
  for (const Body& body : clutter_) {
    if ((body.box.center_m - ego.center_m).norm() < kClutterSeen_m) {
      fill(*scene->add_bodies(), body);
    }
  }
  scenes_.publish(std::move(scene));
}

void World::publish_state() {
  const EgoState& ego = drive_->ego.state();
  std::array<std::uint8_t, 64> bytes{};
  const std::span payload = std::span(bytes).first(drive_->state.byte_count);
  drive_->state.signal("SPEED").encode(drive_->deviation.speed_gain * ego.speed_mps, payload);
  drive_->state.signal("STEERING").encode(ego.steering_rad, payload);
  drive_->state.signal("ACCELERATION").encode(ego.acceleration_mps2, payload);
  drive_->state.signal("AUTONOMOUS").encode(actuators_.is_autonomous() ? 1.0 : 0.0, payload);
  drive_->state_guard.seal(payload);
  auto frame = states_.loan();
  frame->mutable_header()->set_taken_ns(time_of_tick().time_since_epoch().count());
  frame->set_address(drive_->state.address);
  frame->mutable_data()->assign(payload.begin(), payload.end());
  states_.publish(std::move(frame));
}

void World::publish_driver() {
  if (driver_.get() == DriverMode::kNone || !drive_->driver) {
    return;
  }
  // Well beyond what hands that rest on the wheel, or a foot on the pedal, do.
  constexpr double kTorque_nm = 6.0;
  constexpr double kBrake_percent = 40.0;
  const DriverMode does =
      drive_time_s() >= driver_after_s_.get() ? driver_.get() : DriverMode::kHandsOff;
  std::array<std::uint8_t, 64> bytes{};
  const std::span payload = std::span(bytes).first(drive_->driver->byte_count);
  const auto encode = [&](std::string_view signal, double value, bool is_done) {
    drive_->driver->signal(signal).encode(is_done ? value : 0.0, payload);
  };
  encode("STEERING_TORQUE", kTorque_nm, does == DriverMode::kSteers);
  encode("BRAKE_PEDAL", kBrake_percent, does == DriverMode::kBrakes);
  encode("TAKEOVER_BUTTON", 1.0, does == DriverMode::kPressesButton);
  drive_->driver_guard->seal(payload);
  auto frame = states_.loan();
  frame->mutable_header()->set_taken_ns(time_of_tick().time_since_epoch().count());
  frame->set_address(drive_->driver->address);
  frame->mutable_data()->assign(payload.begin(), payload.end());
  states_.publish(std::move(frame));
}

void World::write_row(double time_s) {
  if (!rows_.is_open()) {
    return;
  }
  const EgoState& ego = drive_->ego.state();
  rows_ << fmt::format("{:.1f},{},{},{},{}\n", time_s, ego.center_m.x(), ego.center_m.y(),
                       ego.heading_rad, ego.speed_mps);
  if (!rows_.flush()) {
    throw_unwritten(trajectory_.get());
  }
}

void World::write_bodies(double time_s) {
  if (!body_rows_.is_open()) {
    return;
  }
  for (const Body& body : drive_->traffic.bodies()) {
    const Box& box = body.box;
    body_rows_ << fmt::format("{:.1f},{},{},{},{},{},{},{}\n", time_s, body.id, box.center_m.x(),
                              box.center_m.y(), box.heading_rad, box.length_m, box.width_m,
                              body.speed_mps);
  }
  if (!body_rows_.flush()) {
    throw_unwritten(bodies_.get());
  }
}

double World::drive_time_s() const {
  return static_cast<double>(tick_ - begin_tick_) / static_cast<double>(kTicksPerSecond);
}

fastcycle::Time World::time_of_tick() const {
  return start_time() + tick_ * kTick;
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::World)
