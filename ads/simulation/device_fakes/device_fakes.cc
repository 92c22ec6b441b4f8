#include "device_fakes.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <system_error>
#include <utility>

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include "devices/gnss_receiver/fix.h"

namespace ads {
namespace {

using std::chrono_literals::operator""ms;
using velodyne::ModelKind;

constexpr double kSilence_s = 1.0;
// A sweep comes at once, at the end of its turn; a socket that receives it has no place for all of
// its packets.
constexpr std::size_t kPacketsAtOnce = 40;
constexpr fastcycle::Duration kPause = 1ms;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;

double read_degrees(fastcycle::Context& context, std::string_view name, double max) {
  return context
      .param<double>(name, {.min = -max,
                            .max = max,
                            .unit = "deg",
                            .description = "Coordinate of the map's origin, WGS-84"})
      .get();
}

}  // namespace

DeviceFakes::DeviceFakes(fastcycle::Context& context)
    : DeviceComponent(context, kSilence_s),
      lidar_model_(context.param<ModelKind>(
          "lidar_model",
          {.names = {{"vlp16", ModelKind::kVlp16}, {"hdl64", ModelKind::kHdl64}},
           .description = "Lidar model of the packets; the sweeps must have its rings"})),
      lidar_address_(context.param<std::string>(
          "lidar_address",
          {.fallback = "127.0.0.1", .description = "IP address to which packets are sent"})),
      lidar_port_(context.param<int>("lidar_port", {.fallback = 2368, .min = 1, .max = 65'535})),
      gnss_line_(context.param<fastcycle::Path>(
          "gnss_line", {.description = "Symbolic link to the pseudo terminal"})),
      can_(context.param<fastcycle::Path>(
          "can", {.description = "The path of the fake CAN bus; as `fake` of can_bus"})),
      origin_{.latitude_deg = read_degrees(context, "origin_latitude_deg", 90.0),
              .longitude_deg = read_degrees(context, "origin_longitude_deg", 180.0)},
      commands_(context.create_external_publisher<can::Frame>("fake/can/command")),
      timer_(context.create_timer([this] { send_some(); })) {
  context.create_subscriber<lidar::Sweep>("fake/lidar/points",
                                          [this](const lidar::Sweep& sweep) { on_sweep(sweep); });
  context.create_subscriber<gnss::Position>(
      "fake/gnss/position", [this](const gnss::Position& position) { on_position(position); });
  context.create_subscriber<can::Frame>("fake/can/state",
                                        [this](const can::Frame& frame) { on_state(frame); });
  create_device_thread(context, "device_fakes", [this]() -> Device& { return *bus_; });
}

void DeviceFakes::start() {
  socket_ =
      checked_descriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), "socket");
  to_.sin_family = AF_INET;
  to_.sin_port = htons(static_cast<std::uint16_t>(lidar_port_.get()));
  if (::inet_pton(AF_INET, lidar_address_.get().c_str(), &to_.sin_addr) != 1) {
    throw std::runtime_error(
        fmt::format("param lidar_address: expected an IPv4 address, found "
                    "\"{}\"",
                    lidar_address_.get()));
  }
  encoder_.emplace(
      lidar_model_.get() == ModelKind::kVlp16 ? velodyne::vlp16() : velodyne::nominal_hdl64(),
      [this](std::span<const std::uint8_t> bytes, std::int64_t) {
        packets_.emplace_back(bytes.begin(), bytes.end());
      });

  line_ = checked_descriptor(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC),
                             "posix_openpt");
  if (::grantpt(line_.get()) < 0 || ::unlockpt(line_.get()) < 0) {
    throw_errno("unlockpt");
  }
  ::unlink(gnss_line_.get().c_str());  // Left by an earlier run.
  std::filesystem::create_symlink(::ptsname(line_.get()), gnss_line_.get());
  map_.emplace(origin_);

  bus_ = std::make_unique<FakeCanBus>(FakeCanBus::vehicle_end(can_.get()),
                                      FakeCanBus::ads_end(can_.get()),
                                      [this](const can_frame& frame) { return receive(frame); });
}

void DeviceFakes::stop() {
  ::unlink(gnss_line_.get().c_str());
  report("packets_sent", packets_sent_);
  report("fixes_sent", fixes_sent_);
  report("frames_sent", frames_sent_);
}

// The sensor's clock is synchronised: to the application's.
void DeviceFakes::on_sweep(const lidar::Sweep& sweep) {
  encoder_->add(sweep, sweep.header().taken_ns() / 1000);
  send_some();
}

void DeviceFakes::send_some() {
  for (std::size_t count = 0; count < kPacketsAtOnce && !packets_.empty(); ++count) {
    const Bytes& bytes = packets_.front();
    (void)::sendto(socket_.get(), bytes.data(), bytes.size(), 0,
                   reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
    packets_.pop_front();
    ++packets_sent_;
  }
  if (!packets_.empty()) {
    timer_.arm_in(kPause);
  }
}

void DeviceFakes::on_position(const gnss::Position& position) {
  const std::string bytes = encode_nmea(
      {.position = map_->geodetic_from_enu({position.x_m(), position.y_m(), 0.0}),
       .stddev_m = position.stddev_m(),
       .second_of_day = 1e-9 * static_cast<double>(position.header().taken_ns() % kDay_ns)});
  if (::write(line_.get(), bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size())) {
    ++fixes_sent_;
  }
}

void DeviceFakes::on_state(const can::Frame& message) {
  can_frame frame{};
  frame.can_id = message.address();
  frame.can_dlc = static_cast<__u8>(std::min<std::size_t>(message.data().size(), CAN_MAX_DLEN));
  std::copy_n(message.data().begin(), frame.can_dlc, frame.data);
  if (bus_->send(frame).empty()) {
    ++frames_sent_;
  }
}

bool DeviceFakes::receive(const can_frame& frame) {
  const fastcycle::Time taken = commands_.now();
  auto message = commands_.loan();
  message->mutable_header()->set_taken_ns(taken.time_since_epoch().count());
  message->set_address(frame.can_id);
  message->mutable_data()->assign(frame.data, frame.data + frame.can_dlc);
  commands_.publish(std::move(message), taken);
  return true;
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::DeviceFakes)
