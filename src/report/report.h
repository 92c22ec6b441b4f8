#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/histogram.h"
#include "broker/subscription.h"
#include "component/component_core.h"
#include "fastcycle/component.h"
#include "faults/injector.h"
#include "host/application.h"
#include "host/unmatched.h"
#include "modes/chains.h"

namespace fastcycle::host {

/// Number of calls of a component's callback, and their run time in ns.
struct CallbackReport {
  std::string name = {};  ///< As in `KnownCallback`.
  std::string kind = {};
  base::HistogramSummary time = {};
};

/// Statistics of one component. Times are in nanoseconds.
struct ComponentReport {
  std::string name = {};
  detail::ComponentCore::State state{};
  std::uint64_t activations = 0;
  base::HistogramSummary callback = {};  ///< All its callbacks, including control.
  std::vector<CallbackReport> callbacks = {};
  base::HistogramSummary timer_lateness = {};
  std::uint64_t overruns = 0;
  std::uint64_t faults = 0;
  std::vector<std::string> fault_texts = {};  ///< Of the first faults.
  std::uint64_t restarts = 0;
  detail::VersionNews version = {};  ///< The code version at the end.
  /// Whether it was active at the end of the run; none if no mode names it.
  std::optional<bool> was_active = {};
  bool is_stuck = false;  ///< It had not returned from its own code when the application stopped.
  bool is_replayed = false;  ///< It did not run: its messages came from a recording.
  Health health = Health::kOk;
  std::string health_reason = {};
};

/// Statistics of one topic's messages for one subscriber.
struct SubscriberReport {
  std::string component = {};
  detail::Subscription::Kind kind{};
  std::size_t depth = 0;
  detail::Ledger ledger = {};
  base::HistogramSummary latency = {};  ///< From publish to callback, ns.

  /// Results of its quality of service.
  struct Quality {
    std::uint64_t deadlines_missed = 0;
    std::uint64_t messages_lost = 0;
    std::uint64_t liveliness_lost = 0;
    std::uint64_t liveliness_gained = 0;
  };
  std::optional<Quality> quality = {};  ///< None if it requested none.
  std::vector<UnmatchedReport> unmatched = {};
};

/// Results of the deadline that a publisher offered.
struct OfferedReport {
  std::string component = {};
  double deadline_ms = 0;
  std::uint64_t missed = 0;
};

struct TopicReport {
  std::string name = {};
  std::string type = {};
  std::uint64_t published = 0;
  std::uint64_t replayed = 0;   ///< Of these, by a replay, which each process has of its own.
  std::uint64_t allocated = 0;  ///< Messages allocated for it in all.
  double rate_hz = 0;           ///< Per second of application time.
  std::vector<OfferedReport> offered = {};
  std::vector<SubscriberReport> subscribers = {};
};

/// Statistics of a recording.
struct RecordingReport {
  std::vector<std::string> files = {};
  std::string problem = {};  ///< Last error of its files; empty if there was none.
  std::uint64_t activations_lost = 0;
  std::uint64_t reads_lost = 0;  ///< Of components.
  std::vector<record::RecordedTopic> topics = {};
};

/// Statistics of a replay.
struct ReplayReport {
  /// One stream of the recording.
  struct Stream {
    std::string topic = {};
    std::string component = {};  ///< It was fed in the name of this one; empty: not fed.
    std::string reason = {};     ///< Why not.
    std::uint64_t messages = 0;  ///< Fed; if not fed, those in the recording.
  };

  std::vector<std::string> files = {};
  double from_s = 0;  ///< Since the recorded run began.
  double to_s = 0;
  std::optional<double> worst_lateness_us = {};  ///< Live only.
  std::uint64_t parted_infos = 0;                ///< See `RecordingReader`.
  std::vector<Stream> streams = {};
};

/// The modes of an application during the run.
struct ModesReport {
  /// One switch to another mode.
  struct Switch {
    double time_s = 0;  ///< The application's time since its start.
    std::string from = {};
    std::string to = {};
    std::string why = {};
    std::string by = {};  ///< The requesting component; empty: external.
  };

  std::string at_end = {};
  std::vector<Switch> switches = {};
  std::uint64_t refused = 0;  ///< Refused since too many requests were waiting.
};

/// One of several processes of an application.
struct ProcessReport {
  /// Statistics of a topic's messages on the way to another process.
  struct Link {
    std::string topic = {};
    std::string to = {};  ///< A process.
    std::uint64_t given = 0;
    std::uint64_t copied = 0;        ///< Had to be copied into shared memory.
    std::uint64_t repaired = 0;      ///< Had some strings copied there.
    std::uint64_t unshared = 0;      ///< Lost: not in shared memory, which was full.
    std::uint64_t overflowed = 0;    ///< Lost: the queue was full.
    std::uint64_t over_quota = 0;    ///< Lost: the other process held its maximum.
    std::uint64_t taken_back = 0;    ///< Held by the other process when it ended.
    std::string always_copied = {};  ///< Why all are copied; empty if they are not.
  };

  std::string name = {};
  double cpu_s = 0;
  std::int64_t rss_max_kib = 0;
  std::uint64_t restarts = 0;
  bool has_reported = true;  ///< False if it ended without: all but `restarts` is unknown.
  std::vector<Link> links = {};
};

/// A value that a component reported.
struct ResultReport {
  std::string component;
  std::string name;
  ReportValue value;
};

/// An addition to the report by a tool that observed the run.
struct ToolReport {
  std::string name;   ///< The key in the JSON.
  std::string json;   ///< Its value.
  std::string table;  ///< The same as text.
};

/// The report of a run: plain values, which outlive the application.
///
/// @threads  Compatible.
struct RunReport {
  std::string application;
  std::string clock;  ///< "live" or "simulated".
  /// From the process's start to the first message; none if there was no message.
  std::optional<double> startup_ms;
  double time_s = 0;  ///< Application time that passed.
  double wall_s = 0;  ///< Wall-clock time, the stop included.
  double cpu_s = 0;   ///< Of the whole process since its start.
  std::int64_t rss_max_kib = 0;
  std::string end;  ///< Why the run ended.
  std::vector<ComponentReport> components;
  std::vector<TopicReport> topics;
  std::optional<ModesReport> modes;  ///< None if the application has none.
  std::vector<ChainReport> chains;
  std::optional<ReplayReport> replay;
  std::optional<RecordingReport> recording;
  std::optional<record::FlightReport> flight_recorder;
  std::vector<ProcessReport> processes;   ///< Empty if there is only one.
  std::vector<EarlierRuns> earlier_runs;  ///< Of the main process; empty once they are added.
  std::vector<ResultReport> results;      ///< By component, in order.
  std::vector<ToolReport> tools;
  std::vector<faults::FaultCount> faults;  ///< Injected ones; empty if there were none.
};

/// Reads everything from `application`, after `Application::stop`. `wall` is the wall-clock
/// duration of the run.
[[nodiscard]] RunReport make_report(const Application& application, Duration wall);

/// The report as JSON; see docs/reference/report.md for the keys.
[[nodiscard]] nlohmann::ordered_json to_json(const RunReport& report);

/// The report as text: at most 120 columns.
[[nodiscard]] std::string to_table(const RunReport& report);

/// Totals of the whole application, for a progress line.
struct Progress {
  Duration time{};  ///< Since the timers started; in a replay, within the recording.
  std::optional<Duration> length{};  ///< Of the replayed recording.
  std::uint64_t published = 0;
  std::uint64_t dropped = 0;
  std::uint64_t faults = 0;
};

/// Computes the totals, also while the application runs: reads only counters.
///
/// @threads  Safe, between `Application::build` and the application's end.
[[nodiscard]] Progress progress_of(const Application& application);

}  // namespace fastcycle::host
