#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "broker/topics.h"
#include "config/description.h"
#include "config/problem.h"
#include "host/observer.h"
#include "record/flight_recorder.h"
#include "record/recorder.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

/// The options of `description` for a recorder.
[[nodiscard]] record::RecorderOptions recorder_options(
    const config::RecordDescription& description);

/// Warns of patterns that match no topic.
void check_patterns(const config::RecordDescription& description, const detail::Topics& topics,
                    config::Problems& problems);

/// The options of `description` for a flight recorder.
[[nodiscard]] record::FlightOptions flight_options(
    const config::FlightRecorderDescription& description, const std::string& application);
void check_patterns(const config::FlightRecorderDescription& description,
                    const detail::Topics& topics, config::Problems& problems);

/// Facts about the run for a recording, queried when it begins, and when it has ended.
struct RunFacts {
  std::function<record::Explanation()> at_start;
  std::function<std::map<std::string, std::string>()> at_end;
};

/// Records the messages of an application: owns its recorder.
///
/// @threads  As `Observer`.
class RecorderObserver final : public Observer {
 public:
  /// `clock` and `log` outlive this.
  RecorderObserver(const config::RecordDescription& description, const base::Clock& clock,
                   detail::LogSource& log, RunFacts facts);

  void tap(detail::Topics& topics) override { recorder_.tap(topics); }
  void start(const ObserverView& view, std::vector<base::Refusal>& refusals) override;
  void round_ended(std::uint32_t step) override { recorder_.take(step); }
  [[nodiscard]] bool wants_reads() const override { return has_activations_; }
  void stop(const Application& application) override;

  [[nodiscard]] const record::Recorder& recorder() const noexcept { return recorder_; }

 private:
  const RunFacts facts_;
  const bool has_activations_;
  record::Recorder recorder_;
};

/// Keeps the last messages of an application in a file that outlives the process: owns its flight
/// recorder.
///
/// @threads  As `Observer`; `dump` is Safe.
class FlightObserver final : public Observer {
 public:
  /// `application` is its name; `clock` and `log` outlive this.
  FlightObserver(const config::FlightRecorderDescription& description,
                 const std::string& application, const base::Clock& clock, detail::LogSource& log,
                 std::function<record::Explanation()> explain);

  void tap(detail::Topics& topics) override { recorder_.tap(topics); }
  void open(config::Problems& problems) override;
  void start(const ObserverView& view, std::vector<base::Refusal>& refusals) override;
  void round_ended(std::uint32_t step) override { recorder_.take(step); }
  [[nodiscard]] bool wants_reads() const override { return true; }
  void faulted(std::string_view component, std::string_view what) noexcept override;
  void stop(const Application& application) override;

  /// Requests a dump. @realtime No lock, no allocation, no system call.
  void dump(std::string_view reason, std::string_view component, std::string_view detail) noexcept {
    recorder_.trigger(reason, component, detail);
  }
  [[nodiscard]] const record::FlightRecorder& recorder() const noexcept { return recorder_; }

 private:
  const std::function<record::Explanation()> explain_;
  const config::FlightRecorderDescription description_;
  record::FlightRecorder recorder_;
};

/// Records the application of `component`, which is being constructed; an error if it is recorded
/// already.
void record_for(detail::ComponentCore& component, const config::RecordDescription& description);

}  // namespace fastcycle::host
