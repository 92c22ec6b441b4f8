#include "imu_driver.h"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace rav4 {
namespace {

constexpr std::size_t kAxes = 3;

}  // namespace

void ImuStream::open(const DriveClock& clock, const std::filesystem::path& folder) {
  playback_ = Playback::read(clock, folder);
  values_ = ads::read_npy_numbers(folder / "value.npy", kAxes);
  if (values_->rows() != playback_->rows()) {
    throw std::runtime_error(
        fmt::format("{}: expected as many rows in t and value, found {} and {}", folder.string(),
                    playback_->rows(), values_->rows()));
  }
}

void ImuStream::play(fastcycle::Time start, fastcycle::Time now) {
  while (const auto row = playback_->take_due(now - start)) {
    const fastcycle::Time taken = start + row->offset;
    auto imu = publisher_.loan();
    imu->mutable_header()->set_taken_ns(nanoseconds_of(taken));
    imu->mutable_header()->set_frame("device");  // x forward, y to the right, z down.
    motion::Vector& vector = *((*imu).*measurement_)();
    vector.set_x(values_->at(row->index, 0));
    vector.set_y(values_->at(row->index, 1));
    vector.set_z(values_->at(row->index, 2));
    publisher_.publish(std::move(imu), {.taken_at = taken});
  }
}

ImuDriver::ImuDriver(fastcycle::Context& context)
    : Component(context),
      data_(context.param<fastcycle::Path>(
          "data", {.description = "The drive's folder, in the layout of comma2k19"})),
      accelerometer_(context, "imu/accelerometer", &motion::Imu::mutable_acceleration_mps2),
      gyro_(context, "imu/gyro", &motion::Imu::mutable_angular_rate_radps),
      timer_(context.create_timer([this] { play(); })),
      source_(context.create_source()) {}

void ImuDriver::start() {
  const auto folder = data_.get() / "processed_log" / "IMU";
  const DriveClock clock = DriveClock::read(data_.get());
  accelerometer_.open(clock, folder / "accelerometer");
  gyro_.open(clock, folder / "gyro");
  schedule();
}

void ImuDriver::play() {
  accelerometer_.play(start_time(), now());
  gyro_.play(start_time(), now());
  schedule();
}

void ImuDriver::schedule() {
  if (const auto due = earlier(accelerometer_.next_due(), gyro_.next_due())) {
    timer_.arm_at(start_time() + *due);
  } else {
    source_.finish();
  }
}

}  // namespace rav4

FASTCYCLE_COMPONENT(rav4::ImuDriver)
