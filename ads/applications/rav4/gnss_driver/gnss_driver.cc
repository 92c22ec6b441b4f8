#include "gnss_driver.h"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace rav4 {
namespace {

// The columns of a recorded fix.
constexpr std::size_t kLatitude = 0;
constexpr std::size_t kLongitude = 1;
constexpr std::size_t kSpeed = 2;
constexpr std::size_t kUtc = 3;
constexpr std::size_t kAltitude = 4;
constexpr std::size_t kCourse = 5;
constexpr std::size_t kColumns = 6;

}  // namespace

GnssDriver::GnssDriver(fastcycle::Context& context)
    : Component(context),
      data_(context.param<fastcycle::Path>(
          "data", {.description = "The drive's folder, in the layout of comma2k19"})),
      fixes_(context.create_publisher<gnss::Fix>("gnss/fix")),
      timer_(context.create_timer([this] { play(); })),
      source_(context.create_source()) {}

void GnssDriver::start() {
  const auto folder = data_.get() / "processed_log" / "GNSS" / "live_gnss_ublox";
  playback_ = Playback::read(DriveClock::read(data_.get()), folder);
  values_ = ads::read_npy_numbers(folder / "value.npy", kColumns);
  if (values_->rows() != playback_->rows()) {
    throw std::runtime_error(
        fmt::format("{}: expected as many rows in t and value, found {} and {}", folder.string(),
                    playback_->rows(), values_->rows()));
  }
}

void GnssDriver::activate() {
  while (was_active_ && playback_->take_due(now() - start_time())) {
    // Fixes that arrived while it was inactive are dropped.
  }
  schedule();
}

void GnssDriver::deactivate() {
  was_active_ = true;
}

void GnssDriver::play() {
  while (const auto row = playback_->take_due(now() - start_time())) {
    publish(*row);
  }
  schedule();
}

void GnssDriver::schedule() {
  if (const auto due = playback_->next_due()) {
    timer_.arm_at(start_time() + *due);
  } else {
    source_.finish();
  }
}

void GnssDriver::publish(const Playback::Row& row) {
  const fastcycle::Time taken = start_time() + row.offset;
  auto fix = fixes_.loan();
  fix->mutable_header()->set_taken_ns(nanoseconds_of(taken));
  fix->mutable_header()->set_frame("wgs84");
  fix->set_latitude_deg(values_->at(row.index, kLatitude));
  fix->set_longitude_deg(values_->at(row.index, kLongitude));
  fix->set_altitude_m(values_->at(row.index, kAltitude));
  fix->set_speed_mps(values_->at(row.index, kSpeed));
  fix->set_course_deg(values_->at(row.index, kCourse));
  fix->set_utc_ms(values_->at(row.index, kUtc));
  fixes_.publish(std::move(fix), {.taken_at = taken});
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::GnssDriver)
