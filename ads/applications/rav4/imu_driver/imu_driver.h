#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include <fastcycle/fastcycle.h>

#include "applications/rav4/drive/playback.h"
#include "common/npy.h"
#include "motion/motion.pb.h"

namespace rav4 {

/// A recorded three-axis sensor: a gyroscope or an accelerometer.
///
/// @threads  Confined.
class ImuStream {
 public:
  /// What of a message it fills.
  using Measurement = motion::Vector* (motion::Imu::*)();

  ImuStream(fastcycle::Context& context, std::string_view topic, Measurement measurement)
      : measurement_(measurement), publisher_(context.create_publisher<motion::Imu>(topic)) {}

  /// Reads `t` and `value` of the stream in `folder`.
  ///
  /// @errors  Throws `std::runtime_error` with expected and found.
  void open(const DriveClock& clock, const std::filesystem::path& folder);

  /// Publishes the rows that are due at `now`, in an application that started at `start`.
  void play(fastcycle::Time start, fastcycle::Time now);

  [[nodiscard]] std::optional<fastcycle::Duration> next_due() const {
    return playback_->next_due();
  }

 private:
  const Measurement measurement_;
  fastcycle::Publisher<motion::Imu> publisher_;
  std::optional<Playback> playback_;
  std::optional<ads::NumberTable> values_;
};

/// Publishes the recorded turn rates and accelerations of a drive, each at the time of its row.
///
/// Out:  `imu/accelerometer`, `imu/gyro`, one message for each recorded row
class ImuDriver final : public fastcycle::Component {
 public:
  explicit ImuDriver(fastcycle::Context& context);
  void start() override;

 private:
  void play();
  void schedule();

  fastcycle::Param<fastcycle::Path> data_;
  ImuStream accelerometer_;
  ImuStream gyro_;
  fastcycle::Timer timer_;
  fastcycle::Source source_;
};

}  // namespace rav4
