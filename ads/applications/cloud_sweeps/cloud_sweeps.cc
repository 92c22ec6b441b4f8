#include "cloud_sweeps.h"

#include <cmath>
#include <exception>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>

#include "common/params.h"
#include "devices/mounting.h"

namespace ads {
namespace {

CloudConfig read_config(fastcycle::Context& context) {
  CloudConfig config;
  config.rotation = read_mount_rotation(context);
  config.time_field =
      context
          .param<std::string>("time_field",
                              {.fallback = "",
                               .description = "Point field with the times of the points; empty: "
                                              "the first common name that is present"})
          .get();
  config.turn =
      context
          .param<Turn>("turn", {.fallback = Turn::kNone,
                                .names = {{"none", Turn::kNone},
                                          {"clockwise", Turn::kClockwise},
                                          {"counter_clockwise", Turn::kCounterClockwise}},
                                .description = "Direction of rotation seen from above, if points "
                                               "have no times; none: all have the same time"})
          .get();
  config.begin_rad = read_number(context, "begin_rad", std::numbers::pi, -std::numbers::pi,
                                 std::numbers::pi, "rad", "Azimuth at which a revolution begins");
  config.turn_ns = std::llround(
      1e6 * read_number(context, "turn_ms", 100.0, 1.0, 1000.0, "ms", "Duration of a revolution"));
  config.is_stamp_at_end =
      context
          .param<bool>(
              "stamp_at_end",
              {.fallback = false, .description = "The cloud's stamp is the end of the revolution"})
          .get();
  config.rings = static_cast<std::uint32_t>(
      context
          .param<int>("rings", {.fallback = static_cast<int>(config.rings),
                                .min = 1,
                                .max = 256,
                                .description = "Number of rings, if points have no ring field"})
          .get());
  config.intensity_max = read_number(context, "intensity_max", 255.0, 1e-3, 1e6, "1",
                                     "Intensity that is mapped to 255");
  return config;
}

}  // namespace

CloudSweeps::CloudSweeps(fastcycle::Context& context)
    : Component(context),
      config_(read_config(context)),
      mount_forward_m_(read_mount_forward_m(context)),
      mount_height_m_(read_mount_height_m(context)),
      sweeps_(context.create_publisher<lidar::Sweep>("lidar/points")) {
  context.create_subscriber<foxglove::PointCloud>(
      "points", [this](const foxglove::PointCloud& cloud) { on_cloud(cloud); });
}

void CloudSweeps::stop() {
  report("clouds", cloud_count_);
  report("clouds_unusable", unusable_count_);
}

void CloudSweeps::on_cloud(const foxglove::PointCloud& cloud) {
  ++cloud_count_;
  auto sweep = sweeps_.loan();
  try {
    read_cloud(cloud, config_, *sweep);
  } catch (const std::exception& error) {
    ++unusable_count_;
    health(fastcycle::Health::kDegraded, error.what());
    return;
  }
  if (!has_warned_ && config_.turn == Turn::kNone && !has_times(cloud, config_)) {
    has_warned_ = true;
    log().warning(
        "the points of \"points\" have no times: all count as seen at the cloud's time. Params "
        "turn, begin_rad and turn_ms say how the sensor turns");
  }
  health(fastcycle::Health::kOk);
  sweep->set_mount_forward_m(mount_forward_m_);
  sweep->set_mount_height_m(mount_height_m_);
  sweeps_.publish(std::move(sweep));
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::CloudSweeps)
