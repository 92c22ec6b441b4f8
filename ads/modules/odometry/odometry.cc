#include "odometry.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>

#include "common/plane.h"
#include "odometry_tuning.h"

namespace odometry {
namespace {

constexpr std::size_t kPointBytes = 16;

ScanMatcherConfig read_config(fastcycle::Context& context) {
  ScanMatcherConfig config;
  const auto read = [&context](std::string_view name, double& value, double min, double max,
                               std::string description) {
    value = context
                .param<double>(name, {.fallback = value,
                                      .min = min,
                                      .max = max,
                                      .unit = "m",
                                      .description = std::move(description)})
                .get();
  };
  read("voxel_m", config.voxel_m, 0.1, 10.0, "Side length of a cell of the map");
  read("range_min_m", config.range_min_m, 0.0, 100.0, "Minimum range of matched points");
  read("range_max_m", config.range_max_m, 1.0, 200.0, "Maximum range of matched points");
  read("map_range_m", config.map_range_m, 1.0, 500.0, "Radius of the map around the sensor");
  read("height_min_m", config.height_min_m, -10.0, 10.0,
       "Minimum height of matched points above the sensor");
  read("height_max_m", config.height_max_m, -10.0, 50.0,
       "Maximum height of matched points above the sensor");
  read("reach_first_m", config.reach_first_m, 0.1, 10.0,
       "Maximum distance between a point and the map while the motion is unknown");
  read("reach_m", config.reach_m, 0.1, 10.0,
       "Maximum distance between a point and the map once the motion is known");
  return config;
}

Pose read_begin(fastcycle::Context& context) {
  const auto read = [&context](std::string_view name, std::string unit, std::string description) {
    return context
        .param<double>(name, {.fallback = 0.0,
                              .min = -1e6,
                              .max = 1e6,
                              .unit = std::move(unit),
                              .description = std::move(description)})
        .get();
  };
  const double x_m =
      read("begin_x_m", "m", "Position of the sensor in the map at the end of the first sweep");
  const double y_m =
      read("begin_y_m", "m", "Position of the sensor in the map at the end of the first sweep");
  return {.place_m = {x_m, y_m},
          .heading_rad = read("begin_heading_rad", "rad",
                              "Heading of the vehicle at the end of the first sweep")};
}

}  // namespace

Odometry::Odometry(fastcycle::Context& context)
    : Component(context),
      begin_(read_begin(context)),
      matcher_(read_config(context)),
      ego_(context.create_publisher<localization::Ego>("localization/ego")),
      sweeps_(context.create_publisher<lidar::Sweep>("odometry/points")) {
  context.create_subscriber<lidar::Sweep>(
      "lidar/points", [this](const fastcycle::Sample<lidar::Sweep>& sweep) { on_sweep(sweep); });
}

void Odometry::stop() {
  report("sweeps", sweep_count_);
  report("sweeps_invalid", invalid_count_);
  report("way_m", way_m_);
  if (sweep_count_ > invalid_count_ + 1) {
    report("residual_m", residual_sum_m_ / static_cast<double>(sweep_count_ - invalid_count_ - 1));
  }
}

void Odometry::on_sweep(const fastcycle::Sample<lidar::Sweep>& sweep) {
  ++sweep_count_;
  if (read(*sweep)) {
    const double turn_s = static_cast<double>(sweep->duration_ns()) * 1e-9;
    const double passed_s =
        last_ns_ ? static_cast<double>(sweep->header().taken_ns() - *last_ns_) * 1e-9 : turn_s;
    const Eigen::Vector2d before_m = matcher_.pose().place_m;
    matcher_.take(points_, turn_s, passed_s);
    way_m_ += (matcher_.pose().place_m - before_m).norm();
    residual_sum_m_ += last_ns_ ? matcher_.residual_m() : 0.0;
    publish_ego(*sweep);
    last_ns_ = sweep->header().taken_ns();
  } else {
    ++invalid_count_;
  }
  sweeps_.publish(sweep);
}

// Stores the returns in `points_`. False if there are none, or if the sweep is inconsistent.
bool Odometry::read(const lidar::Sweep& sweep) {
  const std::string& bytes = sweep.points();
  points_.clear();
  if (bytes.size() != std::uint64_t{sweep.columns()} * sweep.rings() * kPointBytes ||
      sweep.duration_ns() <= 0 || (last_ns_ && sweep.header().taken_ns() <= *last_ns_)) {
    health(fastcycle::Health::kDegraded, "the sweep has a wrong size, or is no later");
    return false;
  }
  for (std::size_t offset = 0; offset < bytes.size(); offset += kPointBytes) {
    TimedPoint point;
    std::uint16_t time = 0;
    std::memcpy(point.place_m.data(), bytes.data() + offset, 12);
    std::memcpy(&time, bytes.data() + offset + 12, sizeof time);
    if (point.place_m.allFinite() && !point.place_m.isZero(0.0F)) {
      point.share = static_cast<float>(time) / 65536.0F;
      points_.push_back(point);
    }
  }
  if (points_.empty()) {
    health(fastcycle::Health::kDegraded, "the sweep is empty");
    return false;
  }
  return true;
}

void Odometry::publish_ego(const lidar::Sweep& sweep) {
  const Pose pose = begin_.moved(matcher_.pose());
  const Eigen::Vector2d ahead = ads::direction(pose.heading_rad);
  const Eigen::Vector2d center_m = pose.place_m - sweep.mount_forward_m() * ahead;
  const bool is_held = !last_ns_ || matcher_.matched_share() >= kOdometry.matched_min;
  auto ego = ego_.loan();
  ego->mutable_header()->set_taken_ns(sweep.header().taken_ns() + sweep.duration_ns());
  ego->mutable_header()->set_frame("map");
  ego->set_x_m(center_m.x());
  ego->set_y_m(center_m.y());
  ego->set_heading_rad(pose.heading_rad);
  ego->set_speed_mps(matcher_.rate().place_m.x());
  ego->set_yaw_rate_radps(matcher_.rate().heading_rad);
  const double stddevs[] = {kOdometry.place_stddev_m, kOdometry.place_stddev_m,
                            kOdometry.heading_stddev_rad, kOdometry.speed_stddev_mps,
                            kOdometry.yaw_rate_stddev_radps};
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 5; ++column) {
      ego->add_covariance(row == column ? stddevs[row] * stddevs[row] : 0.0);
    }
  }
  ego->set_quality(is_held ? localization::GOOD : localization::UNCERTAIN);
  ego->set_reason(is_held ? "" : "too little of the sweep lies on the map");
  health(is_held ? fastcycle::Health::kOk : fastcycle::Health::kDegraded, ego->reason());
  ego_.publish(std::move(ego));
}

}  // namespace odometry

FASTCYCLE_COMPONENT(odometry::Odometry)
