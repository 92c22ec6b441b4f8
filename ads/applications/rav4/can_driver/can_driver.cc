#include "can_driver.h"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace rav4 {
namespace {

constexpr std::size_t kPayloadBytes = 8;
constexpr std::int64_t kLargestAddress = 0x1fff'ffff;
constexpr std::int64_t kLargestBus = 255;

}  // namespace

CanDriver::CanDriver(fastcycle::Context& context)
    : Component(context),
      data_(context.param<fastcycle::Path>(
          "data", {.description = "The drive's folder, in the layout of comma2k19"})),
      frames_(context.create_publisher<can::Frame>("can/frames")),
      timer_(context.create_timer([this] { play(); })),
      source_(context.create_source()) {}

void CanDriver::start() {
  const auto folder = data_.get() / "processed_log" / "CAN" / "raw_can";
  playback_ = Playback::read(DriveClock::read(data_.get()), folder);
  addresses_ = ads::read_npy_integers(folder / "address.npy");
  buses_ = ads::read_npy_integers(folder / "src.npy");
  payloads_ = ads::read_npy_bytes(folder / "data.npy", kPayloadBytes);
  check(folder);
  schedule();
}

void CanDriver::check(const std::filesystem::path& folder) const {
  const std::size_t rows = playback_->rows();
  if (addresses_.size() != rows || buses_.size() != rows || payloads_.rows() != rows) {
    throw std::runtime_error(fmt::format(
        "{}: expected as many rows in t, address, src and data, found {}, {}, {} and {}",
        folder.string(), rows, addresses_.size(), buses_.size(), payloads_.rows()));
  }
  for (std::size_t row = 0; row < rows; ++row) {
    if (addresses_[row] < 0 || addresses_[row] > kLargestAddress || buses_[row] < 0 ||
        buses_[row] > kLargestBus) {
      throw std::runtime_error(fmt::format(
          "{}: expected an address of 29 bits and a bus of 8, found {} and {} at row {}",
          folder.string(), addresses_[row], buses_[row], row));
    }
  }
}

void CanDriver::play() {
  while (const auto row = playback_->take_due(now() - start_time())) {
    publish(*row);
  }
  schedule();
}

void CanDriver::schedule() {
  if (const auto due = playback_->next_due()) {
    timer_.arm_at(start_time() + *due);
  } else {
    source_.finish();
  }
}

void CanDriver::publish(const Playback::Row& row) {
  const fastcycle::Time taken = start_time() + row.offset;
  auto frame = frames_.loan();
  frame->mutable_header()->set_taken_ns(nanoseconds_of(taken));
  frame->set_address(static_cast<std::uint32_t>(addresses_[row.index]));
  frame->set_bus(static_cast<std::uint32_t>(buses_[row.index]));
  const auto payload =
      payloads_.bytes.begin() + static_cast<std::ptrdiff_t>(row.index * kPayloadBytes);
  frame->mutable_data()->assign(payload, payload + kPayloadBytes);
  frames_.publish(std::move(frame), {.taken_at = taken});
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::CanDriver)
