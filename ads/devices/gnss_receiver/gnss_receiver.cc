#include "gnss_receiver.h"

#include <chrono>
#include <cmath>
#include <string_view>
#include <utility>

#include "common/params.h"
#include "common/plane.h"

namespace ads {
namespace {

constexpr double kSilence_s = 1.0;
constexpr double kDay_s = 86'400.0;

SerialConfig read_serial(fastcycle::Context& context) {
  SerialConfig config;
  config.path =
      context.param<std::string>("device", {.description = "The serial line: \"/dev/ttyACM0\""})
          .get();
  const auto baud = context.param<int>(
      "baud", {.fallback = 9600, .min = 4800, .max = 921'600, .description = "Bits per second"});
  context.check_params([baud](const fastcycle::ProposedParams& proposed) {
    return is_baud(proposed.get(baud))
               ? std::string()
               : std::string(
                     "baud: expected 4800, 9600, 19200, 38400, 57600, 115200, 230400, "
                     "460800 or 921600");
  });
  config.baud = baud.get();
  config.parity =
      context
          .param<Parity>(
              "parity",
              {.fallback = Parity::kNone,
               .names = {{"none", Parity::kNone}, {"even", Parity::kEven}, {"odd", Parity::kOdd}}})
          .get();
  config.stop_bits = context.param<int>("stop_bits", {.fallback = 1, .min = 1, .max = 2}).get();
  return config;
}

}  // namespace

GnssReceiver::GnssReceiver(fastcycle::Context& context)
    : DeviceComponent(context, kSilence_s),
      serial_(read_serial(context)),
      origin_latitude_deg_(read_number(context, "origin_latitude_deg", std::nullopt, -90.0, 90.0,
                                       "deg", "Coordinate of the map's origin, WGS-84")),
      origin_longitude_deg_(read_number(context, "origin_longitude_deg", std::nullopt, -180.0,
                                        180.0, "deg", "Coordinate of the map's origin, WGS-84")),
      origin_altitude_m_(read_number(context, "origin_altitude_m", 0.0, -1000.0, 10'000.0, "m",
                                     "Altitude of the road above the ellipsoid")),
      antenna_forward_m_(read_number(context, "antenna_forward_m", 0.0, -20.0, 20.0, "m",
                                     "Distance of the antenna in front of the vehicle's centre")),
      antenna_left_m_(read_number(context, "antenna_left_m", 0.0, -5.0, 5.0, "m",
                                  "Distance of the antenna left of the vehicle's centre")),
      latency_s_(
          read_number(context, "latency_s", 0.085, 0.0, 10.0, "s", "Age of a position on arrival")),
      clock_(context
                 .param<ClockSource>(
                     "clock",
                     {.fallback = ClockSource::kArrival,
                      .names = {{"arrival", ClockSource::kArrival}, {"utc", ClockSource::kUtc}},
                      .description =
                          "utc: the computer is synchronised to UTC, and latency_s is ignored"})
                 .get()),
      reader_(read_number(context, "range_error_m", 3.0, 0.01, 100.0, "m",
                          "Error per unit of HDOP, if the receiver reports no error")),
      positions_(context.create_external_publisher<gnss::Position>("gnss/position")) {
  context.create_subscriber<localization::Ego>(
      "localization/ego", [this](const localization::Ego& ego) {
        if (ego.quality() != localization::INITIALIZING && std::isfinite(ego.heading_rad())) {
          heading_rad_ = ego.heading_rad();
          has_heading_ = true;
        }
      });
  create_device_thread(context, "gnss_receiver", [this]() -> Device& { return *device_; });
}

void GnssReceiver::start() {
  map_.emplace(GeodeticPosition{.latitude_deg = origin_latitude_deg_,
                                .longitude_deg = origin_longitude_deg_,
                                .altitude_m = origin_altitude_m_});
  const auto publish_if = [this](const std::optional<GnssFix>& fix) {
    if (fix) {
      publish(*fix);
    }
  };
  parser_.emplace(
      [this, publish_if](std::string_view body) { publish_if(reader_.take_sentence(body)); },
      [this, publish_if](std::uint8_t message_class, std::uint8_t message,
                         std::span<const std::uint8_t> content) {
        publish_if(reader_.take_frame(message_class, message, content));
      });
  device_.emplace(serial_, [this](std::string_view bytes) { return receive(bytes); });
}

bool GnssReceiver::receive(std::string_view bytes) {
  has_published_ = false;
  parser_->take(bytes);
  const std::lock_guard lock(counts_mutex_);
  counts_ = parser_->counts();
  malformed_ = reader_.malformed();
  without_fix_ = reader_.without_fix();
  return has_published_;
}

fastcycle::Time GnssReceiver::time_of(const GnssFix& fix, fastcycle::Time arrived) const {
  const auto seconds = [](double value) {
    return fastcycle::Duration(static_cast<std::int64_t>(std::llround(value * 1e9)));
  };
  if (clock_ == ClockSource::kArrival || !fix.second_of_day) {
    return arrived - seconds(latency_s_);
  }
  const auto arrived_ns = arrived.time_since_epoch().count();
  const double arrived_s = 1e-9 * static_cast<double>(arrived_ns % 86'400'000'000'000);
  return arrived + seconds(std::remainder(*fix.second_of_day - arrived_s, kDay_s));
}

// In the plane; of the vehicle's centre as soon as it is known which way it looks.
void GnssReceiver::publish(const GnssFix& fix) {
  const fastcycle::Time taken = time_of(fix, positions_.now());
  const Eigen::Vector3d antenna_m = map_->enu_from_geodetic(fix.position);
  const Eigen::Vector2d ahead = direction(heading_rad_);
  const bool is_at_centre = antenna_forward_m_ == 0.0 && antenna_left_m_ == 0.0;
  const Eigen::Vector2d from_centre_m =
      antenna_forward_m_ * ahead + antenna_left_m_ * left_of(ahead);
  auto position = positions_.loan();
  position->mutable_header()->set_taken_ns(taken.time_since_epoch().count());
  position->mutable_header()->set_frame("map");
  const Eigen::Vector2d place_m =
      antenna_m.head<2>() - (has_heading_ ? from_centre_m : Eigen::Vector2d(0.0, 0.0));
  position->set_x_m(place_m.x());
  position->set_y_m(place_m.y());
  position->set_stddev_m(has_heading_ || is_at_centre
                             ? fix.stddev_m
                             : std::hypot(fix.stddev_m, antenna_forward_m_, antenna_left_m_));
  positions_.publish(std::move(position), taken);
  has_published_ = true;
  const std::lock_guard lock(counts_mutex_);
  ++positions_count_;
}

void GnssReceiver::stop() {
  const std::lock_guard lock(counts_mutex_);
  report("positions", positions_count_);
  report("sentences", counts_.sentences);
  report("frames", counts_.frames);
  report("wrong_checksums", counts_.wrong_checksums);
  report("bytes_left_out", counts_.bytes_left_out);
  report("malformed", malformed_);
  report("without_fix", without_fix_);
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::GnssReceiver)
