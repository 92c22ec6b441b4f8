#include "lidar_driver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>

#include "common/params.h"

namespace kitti {
namespace {

constexpr std::size_t kPointBytes = 16;
// A place in the grid may be taken already: the next ones are as good.
constexpr std::array<int, 9> kBeside = {0, 1, -1, 2, -2, 3, -3, 4, -4};

fastcycle::Param<int> count(fastcycle::Context& context, std::string_view name, int fallback,
                            int max, std::string description) {
  return context.param<int>(
      name, {.fallback = fallback, .min = 1, .max = max, .description = std::move(description)});
}

}  // namespace

LidarDriver::LidarDriver(fastcycle::Context& context)
    : Component(context),
      data_(context.param<fastcycle::Path>("data", {.description = "The drive's folder"})),
      columns_(count(context, "columns", 2250, 36'000, "Azimuths of a turn")),
      rings_(count(context, "rings", 64, 256, "Beams above each other")),
      passes_(count(context, "passes", 1, 10'000,
                    "How often the drive is played; each second time backwards")),
      is_clockwise_(context.param<bool>(
          "is_clockwise",
          {.fallback = true, .description = "Rotation of the sensor, seen from above"})),
      mount_forward_m_(ads::number_param(context, "mount_forward_m", -0.6, -10.0, 10.0, "m",
                                         "Of the sensor before the vehicle's centre")),
      mount_height_m_(ads::number_param(context, "mount_height_m", 1.73, -10.0, 10.0, "m",
                                        "Of the sensor above the ground")),
      sweeps_(context.create_publisher<lidar::Sweep>("lidar/points")),
      timer_(context.create_timer([this] { play(); })),
      source_(context.create_source()) {}

void LidarDriver::start() {
  frames_ = list_frames(data_.get() / "velodyne", ".bin.xz");
  schedule();
}

void LidarDriver::stop() {
  report("sweeps", static_cast<std::int64_t>(next_));
  report("points", points_);
  report("points_left_out", points_left_out_);
}

void LidarDriver::play() {
  publish(turn(next_++));
  schedule();
}

// A pass takes as long as the drive did, also where frames are missing.
LidarDriver::Turn LidarDriver::turn(std::size_t number) const {
  const std::size_t pass = number / frames_.size();
  const std::size_t index = number % frames_.size();
  const bool is_backwards = pass % 2 == 1;
  const Frame& frame = frames_[is_backwards ? frames_.size() - 1 - index : index];
  const std::int64_t since_first = frame.number - frames_.front().number;
  const std::int64_t last = frames_.back().number - frames_.front().number;
  return {.frame = &frame,
          .slot = static_cast<std::int64_t>(pass) * (last + 1) +
                  (is_backwards ? last - since_first : since_first),
          .is_backwards = is_backwards};
}

// A sweep is there when its turn is over.
void LidarDriver::schedule() {
  if (next_ < frames_.size() * static_cast<std::size_t>(passes_.get())) {
    const Turn its = turn(next_);
    timer_.arm_at(start_time() + offset_of(its.slot + 1, 0));
    points_of_next_ = read_sweep(its.frame->file);  // A sensor has its returns when it has turned.
  } else {
    source_.finish();
  }
}

void LidarDriver::publish(const Turn& turn) {
  const fastcycle::Time taken = start_time() + offset_of(turn.slot, 0);
  auto sweep = sweeps_.loan();
  sweep->mutable_header()->set_taken_ns(taken.time_since_epoch().count());
  sweep->mutable_header()->set_frame("lidar");
  sweep->set_duration_ns(kFrame_ns);
  sweep->set_columns(static_cast<std::uint32_t>(columns_.get()));
  sweep->set_rings(static_cast<std::uint32_t>(rings_.get()));
  sweep->set_mount_forward_m(mount_forward_m_.get());
  sweep->set_mount_height_m(mount_height_m_.get());
  place(points_of_next_, is_clockwise_.get() != turn.is_backwards, *sweep);
  sweeps_.publish(std::move(sweep), {.taken_at = taken});
}

// The files hold ring after ring, from the highest, each beginning ahead and going to the left,
// whichever way the sensor turned. A turn begins behind.
void LidarDriver::place(const std::vector<Point>& points, bool is_clockwise, lidar::Sweep& sweep) {
  const int columns = columns_.get();
  const int rings = rings_.get();
  std::string& bytes = *sweep.mutable_points();
  bytes.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rings) * kPointBytes,
               '\0');
  int ring = rings - 1;
  bool was_behind = false;
  for (const Point& point : points) {
    if (point.x_m == 0.0F && point.y_m == 0.0F && point.z_m == 0.0F) {
      continue;  // No return.
    }
    if (point.x_m > 0.0F && point.y_m >= 0.0F && was_behind) {
      ring = std::max(0, ring - 1);
    }
    was_behind = point.x_m < 0.0F || (was_behind && point.y_m < 0.0F);
    const double turned = std::atan2(point.y_m, point.x_m) / (2.0 * std::numbers::pi);
    const double share = is_clockwise ? 0.5 - turned : 0.5 + turned;
    // A non-finite return has no direction, but is kept.
    const int column = std::isfinite(share) ? static_cast<int>(share * columns) % columns : 0;
    ++points_;
    bool is_placed = false;
    for (const int beside : kBeside) {
      const int its_column = (column + beside + columns) % columns;
      char* const at = bytes.data() + kPointBytes * (static_cast<std::size_t>(its_column) *
                                                         static_cast<std::size_t>(rings) +
                                                     static_cast<std::size_t>(ring));
      std::array<float, 3> there;
      std::memcpy(there.data(), at, sizeof there);
      if (there != std::array<float, 3>{}) {
        continue;
      }
      const auto time = static_cast<std::uint16_t>(
          std::isfinite(share) ? std::clamp(share * 65536.0, 0.0, 65535.0) : 0.0);
      const auto its_ring = static_cast<std::uint8_t>(ring);
      const auto intensity = static_cast<std::uint8_t>(
          std::isfinite(point.reflectance) ? std::clamp(point.reflectance * 255.0F, 0.0F, 255.0F)
                                           : 0.0F);
      std::memcpy(at, &point, 12);
      std::memcpy(at + 12, &time, 2);
      std::memcpy(at + 14, &its_ring, 1);
      std::memcpy(at + 15, &intensity, 1);
      is_placed = true;
      break;
    }
    points_left_out_ += is_placed ? 0 : 1;
  }
}

}  // namespace kitti

FASTCYCLE_COMPONENT(kitti::LidarDriver)
