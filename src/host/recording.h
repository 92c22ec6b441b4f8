#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/thread.h"
#include "broker/topics.h"
#include "config/description.h"
#include "config/problem.h"
#include "host/guest.h"
#include "record/flight_recorder.h"
#include "record/recorder.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

/// What `description` says, for a recorder.
[[nodiscard]] record::RecorderOptions recorder_options(
    const config::RecordDescription& description);

/// Warns of patterns that mean none of the topics.
void check_patterns(const config::RecordDescription& description, const detail::Topics& topics,
                    config::Problems& problems);

/// What `description` says, for a flight recorder.
[[nodiscard]] record::FlightOptions flight_options(
    const config::FlightRecorderDescription& description, const std::string& application);
void check_patterns(const config::FlightRecorderDescription& description,
                    const detail::Topics& topics, config::Problems& problems);

/// Records what an application publishes.
///
/// @threads  As `Guest`.
class RecorderGuest final : public Guest {
 public:
  RecorderGuest(Application& application, const config::RecordDescription& description);

  void tap(detail::Topics& topics) override { recorder_.tap(topics); }
  void start(const GuestView& view, std::vector<base::Refusal>& refusals) override;
  void round_ended(std::uint32_t step) override { recorder_.take(step); }
  void stop(const Application& application) override;

  [[nodiscard]] const record::Recorder& recorder() const noexcept { return recorder_; }

 private:
  record::Recorder recorder_;
};

/// Keeps the last messages of an application in a file that outlives the process.
///
/// @threads  As `Guest`; `dump` is Safe.
class FlightGuest final : public Guest {
 public:
  FlightGuest(Application& application, const config::FlightRecorderDescription& description);

  void tap(detail::Topics& topics) override { recorder_.tap(topics); }
  void open(config::Problems& problems) override;
  void start(const GuestView& view, std::vector<base::Refusal>& refusals) override;
  void round_ended(std::uint32_t step) override { recorder_.take(step); }
  void faulted(std::string_view component, std::string_view what) noexcept override;
  void stop(const Application& application) override;

  /// Asks for a dump. @realtime No lock, no allocation, no system call.
  void dump(std::string_view reason, std::string_view component, std::string_view detail) noexcept {
    recorder_.trigger(reason, component, detail);
  }
  [[nodiscard]] const record::FlightRecorder& recorder() const noexcept { return recorder_; }

 private:
  const Application& application_;
  const config::FlightRecorderDescription description_;
  record::FlightRecorder recorder_;
};

/// Records the application of `component`, which is being constructed; a mistake if it is recorded
/// already.
void record_for(detail::ComponentCore& component, const config::RecordDescription& description);

}  // namespace fastcycle::host
