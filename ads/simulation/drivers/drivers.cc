#include "drivers.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "common/even.h"
#include "common/params.h"
#include "common/scalar.h"

namespace ads {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
// Scenes that are farther apart are not joined: the lidar starts again.
constexpr std::int64_t kGapMax_ns = kSecond_ns / 5;
// The standard acceleration of gravity (CGPM 1901).
constexpr double kGravity_mps2 = 9.80665;

LidarConfig read_lidar(fastcycle::Context& context) {
  LidarConfig lidar;
  const auto angle = [&context](std::string_view name, double fallback, std::string description) {
    return context
        .param<double>(name, {.fallback = fallback,
                              .min = -180.0,
                              .max = 180.0,
                              .unit = "deg",
                              .description = std::move(description)})
        .get();
  };
  const auto count = [&context](std::string_view name, int fallback, int max,
                                std::string description) {
    return context
        .param<int>(
            name,
            {.fallback = fallback, .min = 1, .max = max, .description = std::move(description)})
        .get();
  };
  lidar.columns =
      count("lidar.columns", lidar.columns, 36'000, "Number of azimuths per revolution");
  lidar.rings = count("lidar.rings", lidar.rings, 256, "Elevations");
  lidar.elevation_min_deg =
      angle("lidar.elevation_min_deg", lidar.elevation_min_deg, "Elevation of the lowest ring");
  lidar.elevation_max_deg =
      angle("lidar.elevation_max_deg", lidar.elevation_max_deg, "Elevation of the highest ring");
  lidar.elevations_deg =
      context
          .param<std::vector<double>>(
              "lidar.elevations_deg",
              {.fallback = lidar.elevations_deg,
               .description = "Elevation of each ring, from the lowest; empty: evenly spaced"})
          .get();
  lidar.is_clockwise =
      context
          .param<bool>("lidar.is_clockwise",
                       {.fallback = lidar.is_clockwise,
                        .description = "Whether the sensor turns clockwise, seen from above"})
          .get();
  lidar.first_azimuth_deg = angle("lidar.first_azimuth_deg", lidar.first_azimuth_deg,
                                  "Azimuth at which a revolution begins");
  lidar.range_max_m = number_param(context, "lidar.range_max_m", lidar.range_max_m, 0.0, 1000.0,
                                   "m", "Maximum range of a return")
                          .get();
  lidar.range_stddev_m = number_param(context, "lidar.range_stddev_m", lidar.range_stddev_m, 0.0,
                                      10.0, "m", "Error of each range, 1 sigma")
                             .get();
  lidar.beam_dropout = number_param(context, "lidar.beam_dropout", lidar.beam_dropout, 0.0, 1.0,
                                    "1", "Share of beams without a return")
                           .get();
  lidar.mount_height_m = number_param(context, "lidar.mount_height_m", lidar.mount_height_m, 0.0,
                                      10.0, "m", "Height of the sensor above the ground")
                             .get();
  lidar.mount_forward_m =
      context
          .param<double>("lidar.mount_forward_m",
                         {.fallback = lidar.mount_forward_m,
                          .min = -10.0,
                          .max = 10.0,
                          .unit = "m",
                          .description = "Distance of the sensor in front of the vehicle's centre"})
          .get();
  return lidar;
}

}  // namespace

Drivers::Drivers(fastcycle::Context& context)
    : Component(context),
      lidar_config_(read_lidar(context)),
      gnss_{
          .period_s = context.param<double>("gnss.period_s", {.fallback = 0.1,
                                                              .min = 0.01,
                                                              .max = 10.0,
                                                              .unit = "s",
                                                              .description = "Time between fixes"}),
          .noise_m = number_param(context, "gnss.noise_m", 0.1, 0.0, 100.0, "m",
                                  "Independent error of each fix, 1 sigma per axis"),
          .bias_m = number_param(context, "gnss.bias_m", 0.15, 0.0, 100.0, "m",
                                 "Slow error, 1 sigma per axis"),
          .bias_time_s = context.param<double>(
              "gnss.bias_time_s", {.fallback = 60.0,
                                   .min = 0.01,
                                   .max = 1e6,
                                   .unit = "s",
                                   .description = "Correlation time of the slow error"}),
          .fix_dropout = context.param<std::uint32_t>(
              "gnss.fix_dropout",
              {.fallback = 0, .description = "One of this number of fixes is missing; 0: none"})},
      imu_{.forward_noise_mps2 = number_param(context, "imu.forward_noise_mps2", 0.67, 0.0, 100.0,
                                              "m/s^2", "Error of one measurement, 1 sigma"),
           .left_noise_mps2 = number_param(context, "imu.left_noise_mps2", 0.29, 0.0, 100.0,
                                           "m/s^2", "Error of one measurement, 1 sigma"),
           .yaw_rate_noise_radps = number_param(context, "imu.yaw_rate_noise_radps", 0.0028, 0.0,
                                                1.0, "rad/s", "Error of one measurement, 1 sigma"),
           .acceleration_bias_mps2 = number_param(context, "imu.acceleration_bias_mps2", 0.04, 0.0,
                                                  10.0, "m/s^2", "Offset, 1 sigma"),
           .yaw_rate_bias_radps = number_param(context, "imu.yaw_rate_bias_radps", 0.0007, 0.0, 1.0,
                                               "rad/s", "Offset, 1 sigma"),
           .bias_time_s = context.param<double>(
               "imu.bias_time_s", {.fallback = 300.0,
                                   .min = 0.01,
                                   .max = 1e6,
                                   .unit = "s",
                                   .description = "Correlation time of the offsets"})},
      noise_deviation_(
          number_param(context, "noise_deviation", 0.0, 0.0, 2.0, "1",
                       "Uncertainty of the error sizes: true errors differ by a factor of "
                       "up to 2 to this power")),
      seed_(context.param<std::uint64_t>("seed",
                                         {.fallback = 0, .description = "Seed of the noise"})),
      lidar_fault_(
          context.param<LidarFault>("lidar_fault", {.fallback = LidarFault::kNone,
                                                    .names = {{"none", LidarFault::kNone},
                                                              {"nan", LidarFault::kNan},
                                                              {"empty", LidarFault::kEmpty}},
                                                    .description = "Fault of the sweeps"})),
      lidar_fault_after_s_(number_param(context, "lidar_fault_after_s", 0.0, 0.0, 1e9, "s",
                                        "Time of the fault, after the start")),
      sweeps_(context.create_publisher<lidar::Sweep>("lidar/points")),
      positions_(context.create_publisher<gnss::Position>("gnss/position")),
      motions_(context.create_publisher<motion::Imu>("imu/motion")) {
  context.create_subscriber<world::Scene>(
      "world/scene", {.keep = 1},
      [this](const fastcycle::Sample<world::Scene>& scene) { on_scene(scene); });
}

void Drivers::start() {
  const std::size_t elevations = lidar_config_.elevations_deg.size();
  if (elevations != 0 && elevations != static_cast<std::size_t>(lidar_config_.rings)) {
    throw std::runtime_error(
        fmt::format("param lidar.elevations_deg: expected one for each of the {} rings, found {}",
                    lidar_config_.rings, elevations));
  }
  std::seed_seq seeds{static_cast<std::uint32_t>(random()()),
                      static_cast<std::uint32_t>(seed_.get()),
                      static_cast<std::uint32_t>(seed_.get() >> 32)};
  random_.seed(seeds);
  lidar_.emplace(lidar_config_, random_());
  sizes_ = draw_sizes(noise_deviation_.get(), seed_.get());
  const GaussMarkov position(sizes_.gnss_bias * gnss_.bias_m.get(), gnss_.bias_time_s.get());
  const GaussMarkov acceleration(sizes_.imu_bias * imu_.acceleration_bias_mps2.get(),
                                 imu_.bias_time_s.get());
  errors_ = Errors{
      .east = position,
      .north = position,
      .forward = acceleration,
      .left = acceleration,
      .yaw_rate = {sizes_.imu_bias * imu_.yaw_rate_bias_radps.get(), imu_.bias_time_s.get()}};

  report("lidar_beams", std::int64_t{lidar_config_.columns} * lidar_config_.rings);
  report("lidar_range_stddev_m", lidar_config_.range_stddev_m);
  report("lidar_range_max_m", lidar_config_.range_max_m);
  report("lidar_beam_dropout", lidar_config_.beam_dropout);
  report("gnss_noise_m", gnss_.noise_m.get());
  report("gnss_bias_m", gnss_.bias_m.get());
  report("gnss_bias_time_s", gnss_.bias_time_s.get());
  report("gnss_fix_dropout", std::int64_t{gnss_.fix_dropout.get()});
  report("imu_forward_noise_mps2", imu_.forward_noise_mps2.get());
  report("imu_left_noise_mps2", imu_.left_noise_mps2.get());
  report("imu_yaw_rate_noise_radps", imu_.yaw_rate_noise_radps.get());
  report("imu_acceleration_bias_mps2", imu_.acceleration_bias_mps2.get());
  report("imu_yaw_rate_bias_radps", imu_.yaw_rate_bias_radps.get());
  report("seed", static_cast<std::int64_t>(seed_.get()));
  if (noise_deviation_.get() > 0.0) {
    report("gnss_noise_size", sizes_.gnss_noise);
    report("gnss_bias_size", sizes_.gnss_bias);
    report("imu_noise_size", sizes_.imu_noise);
    report("imu_bias_size", sizes_.imu_bias);
  }
}

Drivers::ErrorSizes Drivers::draw_sizes(double share, std::uint64_t seed) {
  // A separate generator, so that the errors themselves are the same numbers for any share.
  std::mt19937_64 random(seed);
  const auto size = [&] { return std::exp2(share * (2.0 * even(random) - 1.0)); };
  ErrorSizes sizes;
  for (double* const one :
       {&sizes.gnss_noise, &sizes.gnss_bias, &sizes.imu_noise, &sizes.imu_bias}) {
    *one = size();
  }
  return sizes;
}

void Drivers::stop() {
  report("sweeps", sweep_count_);
  report("fixes", position_count_ - dropped_count_);
  report("fixes_dropped", dropped_count_);
  sweep_.reset();
}

void Drivers::on_scene(const fastcycle::Sample<world::Scene>& scene) {
  const std::int64_t time_ns = scene->header().taken_ns();
  const std::int64_t passed_ns = before_ ? time_ns - before_->header().taken_ns() : kGapMax_ns + 1;
  const bool joins = passed_ns > 0 && passed_ns <= kGapMax_ns;
  if (joins) {
    turn_lidar(*scene);
  } else {
    begin_turn(time_ns);
    next_position_ns_ = time_ns;
  }
  publish_motion(*scene, joins ? seconds_of(passed_ns) : 0.0);
  if (time_ns >= next_position_ns_) {
    publish_position(*scene);
    next_position_ns_ += static_cast<std::int64_t>(gnss_.period_s.get() * 1e9);
  }
  before_ = scene;
}

// The columns that were measured since the scene before.
void Drivers::turn_lidar(const world::Scene& after) {
  const std::int64_t now_ns = after.header().taken_ns();
  while (true) {
    int end = next_column_;
    while (end < lidar_config_.columns && turn_begin_ns_ + lidar_->column_ns(end) < now_ns) {
      ++end;
    }
    std::string& points = *(*sweep_)->mutable_points();
    lidar_->cast(*before_, after, turn_begin_ns_, next_column_, end,
                 {points.data(), points.size()});
    next_column_ = end;
    if (now_ns < turn_begin_ns_ + lidar_config_.turn_ns) {
      return;
    }
    end_turn();
    begin_turn(turn_begin_ns_ + lidar_config_.turn_ns);
  }
}

void Drivers::begin_turn(std::int64_t time_ns) {
  turn_begin_ns_ = time_ns;
  next_column_ = 0;
  // Every byte of the points is written in each turn: they need no clearing, and no new memory.
  sweep_.emplace(sweeps_.loan_uncleared());
  lidar::Sweep& sweep = **sweep_;
  sweep.mutable_header()->set_taken_ns(time_ns);
  sweep.mutable_header()->set_frame("lidar");
  sweep.set_duration_ns(lidar_config_.turn_ns);
  sweep.set_columns(static_cast<std::uint32_t>(lidar_config_.columns));
  sweep.set_rings(static_cast<std::uint32_t>(lidar_config_.rings));
  sweep.set_mount_forward_m(lidar_config_.mount_forward_m);
  sweep.set_mount_height_m(lidar_config_.mount_height_m);
  sweep.mutable_points()->resize(lidar_->sweep_bytes());
}

void Drivers::end_turn() {
  lidar::Sweep& sweep = **sweep_;
  const bool has_fault = seconds_of((now() - start_time()).count()) >= lidar_fault_after_s_.get();
  if (has_fault && lidar_fault_.get() == LidarFault::kEmpty) {
    sweep.mutable_points()->clear();
  } else if (has_fault && lidar_fault_.get() == LidarFault::kNan) {
    spoil(*sweep.mutable_points());
  }
  ++sweep_count_;
  sweeps_.publish(std::move(*sweep_));
}

void Drivers::publish_position(const world::Scene& scene) {
  const double passed_s = gnss_.period_s.get();
  const double stddev_m = sizes_.gnss_noise * gnss_.noise_m.get();
  const double east_m = errors_->east.step(passed_s, random_) + noise(stddev_m);
  const double north_m = errors_->north.step(passed_s, random_) + noise(stddev_m);
  ++position_count_;
  const std::uint32_t dropout = gnss_.fix_dropout.get();
  if (dropout > 0 && position_count_ % dropout == 0) {
    ++dropped_count_;
    return;
  }
  auto position = positions_.loan();
  position->mutable_header()->set_taken_ns(scene.header().taken_ns());
  position->mutable_header()->set_frame("map");
  position->set_x_m(scene.ego().x_m() + east_m);
  position->set_y_m(scene.ego().y_m() + north_m);
  position->set_stddev_m(std::hypot(gnss_.noise_m.get(), gnss_.bias_m.get()));
  positions_.publish(std::move(position));
}

void Drivers::publish_motion(const world::Scene& scene, double passed_s) {
  const world::Body& ego = scene.ego();
  auto motion = motions_.loan();
  motion->mutable_header()->set_taken_ns(scene.header().taken_ns());
  motion->mutable_header()->set_frame("vehicle");
  motion::Vector& acceleration = *motion->mutable_acceleration_mps2();
  acceleration.set_x(scene.ego_acceleration_mps2() + errors_->forward.step(passed_s, random_) +
                     noise(sizes_.imu_noise * imu_.forward_noise_mps2.get()));
  acceleration.set_y(ego.speed_mps() * ego.yaw_rate_radps() +
                     errors_->left.step(passed_s, random_) +
                     noise(sizes_.imu_noise * imu_.left_noise_mps2.get()));
  acceleration.set_z(kGravity_mps2);
  motion->mutable_angular_rate_radps()->set_z(
      ego.yaw_rate_radps() + errors_->yaw_rate.step(passed_s, random_) +
      noise(sizes_.imu_noise * imu_.yaw_rate_noise_radps.get()));
  motions_.publish(std::move(motion));
}

double Drivers::noise(double stddev) {
  return stddev * std::normal_distribution<double>()(random_);
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Drivers)
