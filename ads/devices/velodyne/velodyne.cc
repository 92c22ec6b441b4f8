#include "velodyne.h"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "common/params.h"
#include "devices/mounting.h"

namespace ads {
namespace {

using velodyne::ClockSource;
using velodyne::DualReturn;
using velodyne::ModelKind;

// Five revolutions.
constexpr double kSilence_s = 0.5;

velodyne::RevolutionConfig read_config(fastcycle::Context& context) {
  velodyne::RevolutionConfig config;
  config.cut_azimuth_deg =
      read_number(context, "cut_azimuth_deg", config.cut_azimuth_deg, 0.0, 360.0, "deg",
                  "Azimuth at which a sweep begins, clockwise from the sensor's zero");
  config.range_min_m =
      read_number(context, "range_min_m", config.range_min_m, 0.0, 300.0, "m",
                  "Minimum range of a return; nearer ones are of the vehicle itself");
  config.range_max_m = read_number(context, "range_max_m", config.range_max_m, 0.0, 300.0, "m",
                                   "Maximum range of a return");
  config.dual_return =
      context
          .param<DualReturn>(
              "dual_return",
              {.fallback = config.dual_return,
               .names = {{"strongest", DualReturn::kStrongest}, {"last", DualReturn::kLast}},
               .description = "The return to use if the sensor sends two"})
          .get();
  config.clock =
      context
          .param<ClockSource>(
              "clock", {.fallback = config.clock,
                        .names = {{"arrival", ClockSource::kArrival}, {"utc", ClockSource::kUtc}},
                        .description = "utc: sensor and computer are both synchronised to UTC"})
          .get();
  config.rotation = read_mount_rotation(context);
  return config;
}

}  // namespace

Velodyne::Velodyne(fastcycle::Context& context)
    : DeviceComponent(context, kSilence_s),
      model_(context.param<ModelKind>(
          "model", {.names = {{"vlp16", ModelKind::kVlp16}, {"hdl64", ModelKind::kHdl64}},
                    .description = "Model of the sensor"})),
      calibration_(context.param<fastcycle::Path>(
          "calibration",
          {.fallback = fastcycle::Path(),
           .description = "Calibration of an HDL-64E: the db.xml file supplied with it"})),
      nominal_calibration_(context.param<bool>(
          "nominal_calibration",
          {.fallback = false,
           .description =
               "Use the nominal calibration of an HDL-64E, as for a simulated one without file"})),
      capture_(context.param<fastcycle::Path>(
          "pcap", {.fallback = fastcycle::Path(),
                   .description = "Capture file to play; empty: receive packets by UDP"})),
      address_(context.param<std::string>(
          "address",
          {.fallback = "0.0.0.0", .description = "IP address of the interface to listen on"})),
      port_(context.param<int>("port",
                               {.fallback = 2368,
                                .min = 1,
                                .max = 65'535,
                                .description = "UDP port to which the sensor sends its data"})),
      sensor_address_(context.param<std::string>(
          "sensor_address",
          {.fallback = "",
           .description = "Accept only packets from this IP address; empty: from all"})),
      config_(read_config(context)),
      mount_forward_m_(read_mount_forward_m(context)),
      mount_height_m_(read_mount_height_m(context)) {
  if (capture_.get().empty()) {
    received_.emplace(context.create_external_publisher<lidar::Sweep>("lidar/points"));
    create_device_thread(context, "velodyne", [this]() -> Device& { return *device_; });
  } else {
    played_.emplace(context.create_publisher<lidar::Sweep>("lidar/points"));
    timer_.emplace(context.create_timer([this] { play(); }));
    source_.emplace(context.create_source());
  }
}

velodyne::Model Velodyne::make_model() const {
  if (model_.get() == ModelKind::kVlp16) {
    return velodyne::vlp16();
  }
  if (!calibration_.get().empty()) {
    return velodyne::read_hdl64(calibration_.get());
  }
  if (!nominal_calibration_.get()) {
    throw std::runtime_error(
        "param calibration: expected the db.xml of this HDL-64E, found none; a simulated one has "
        "nominal_calibration: true");
  }
  return velodyne::nominal_hdl64();
}

void Velodyne::start() {
  decoder_.emplace(make_model(), config_);
  if (received_) {
    device_.emplace(
        address_.get(), static_cast<std::uint16_t>(port_.get()), sensor_address_.get(),
        [this](std::span<const std::uint8_t> payload) {
          const auto arrived = received_->now().time_since_epoch().count();
          const auto packets = decoder_->counts().packets;
          if (take(payload, arrived)) {
            auto sweep = received_->loan_uncleared();
            fill(*sweep);
            const fastcycle::Time taken(fastcycle::Duration(sweep->header().taken_ns()));
            received_->publish(std::move(sweep), taken);
          }
          return decoder_->counts().packets > packets;
        });
    return;
  }
  reader_.emplace(capture_.get());
  // A capture has its own times; the begin of the sensor's hour in them is unknown.
  config_.clock = ClockSource::kArrival;
  decoder_.emplace(make_model(), config_);
  read_ahead();
}

// Returns whether a revolution has ended. Each kind of packet fault is logged once.
bool Velodyne::take(std::span<const std::uint8_t> payload, std::int64_t arrival_ns) {
  const bool has_ended = decoder_->take(payload, arrival_ns);
  if (const auto fault = decoder_->fault()) {
    bool& has_warned = has_warned_[static_cast<std::size_t>(*fault)];
    if (!std::exchange(has_warned, true)) {
      log().warning("a packet of {} bytes was left out: {}", payload.size(),
                    velodyne::text_of(*fault));
    }
  }
  keep_counts();
  return has_ended;
}

void Velodyne::fill(lidar::Sweep& sweep) const {
  decoder_->write(sweep);
  sweep.set_mount_forward_m(mount_forward_m_);
  sweep.set_mount_height_m(mount_height_m_);
}

void Velodyne::keep_counts() {
  const std::lock_guard lock(counts_mutex_);
  counts_ = decoder_->counts();
}

void Velodyne::play() {
  auto sweep = played_->loan_uncleared();
  fill(*sweep);
  const fastcycle::Time taken(fastcycle::Duration(sweep->header().taken_ns()));
  played_->publish(std::move(sweep), {.taken_at = taken});
  read_ahead();
}

// Reads to the end of the next revolution, which is published at its time.
void Velodyne::read_ahead() {
  const std::int64_t start_ns = start_time().time_since_epoch().count();
  while (const auto datagram = reader_->next()) {
    if (datagram->port != port_.get()) {
      continue;
    }
    first_ns_ = first_ns_.value_or(datagram->time_ns);
    const std::int64_t arrival_ns = start_ns + datagram->time_ns - *first_ns_;
    if (take(datagram->payload, arrival_ns)) {
      timer_->arm_at(fastcycle::Time(fastcycle::Duration(arrival_ns)));
      return;
    }
  }
  if (!reader_->damage().empty()) {
    log().warning("{}", reader_->damage());
    health(fastcycle::Health::kDegraded, reader_->damage());
  }
  source_->finish();
}

void Velodyne::stop() {
  const std::lock_guard lock(counts_mutex_);
  report("packets", counts_.packets);
  report("packets_lost", counts_.packets_lost);
  for (std::size_t index = 0; index < velodyne::kPacketFaults; ++index) {
    if (counts_.faults[index] > 0) {
      report(fmt::format("packets_refused: {}",
                         velodyne::text_of(static_cast<velodyne::PacketFault>(index))),
             counts_.faults[index]);
    }
  }
  report("sweeps", counts_.revolutions);
  report("sweeps_incomplete", counts_.incomplete);
  report("clock_steps", counts_.clock_steps);
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Velodyne)
