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
#include "modes/chains.h"
#include "report/unmatched.h"

namespace fastcycle::host {

/// How often one callback of a component was called, and how long it took, ns.
struct CallbackReport {
  std::string name = {};  ///< As in `KnownCallback`.
  std::string kind = {};
  base::HistogramSummary time = {};
};

/// What one component did in a run. Times are in nanoseconds.
struct ComponentReport {
  std::string name = {};
  detail::ComponentCore::State state{};
  std::uint64_t activations = 0;
  base::HistogramSummary callback = {};  ///< All its callbacks together, those of control too.
  std::vector<CallbackReport> callbacks = {};
  base::HistogramSummary timer_lateness = {};
  std::uint64_t overruns = 0;
  std::uint64_t faults = 0;
  std::vector<std::string> fault_texts = {};  ///< Of the first faults.
  std::uint64_t restarts = 0;
  detail::VersionNews version = {};  ///< Whose code it ran at the end.
  /// Whether it was active when the run ended; none if no mode names it.
  std::optional<bool> was_active = {};
  bool is_stuck = false;  ///< It had not come back from its own code when the application stopped.
  bool is_replayed = false;  ///< It did not run: a recording was published in its place.
  Health health = Health::kOk;
  std::string health_reason = {};
};

/// What became of one topic's messages on the way to one subscriber.
struct SubscriberReport {
  std::string component = {};
  detail::Subscription::Kind kind{};
  std::size_t depth = 0;
  detail::Ledger ledger = {};
  base::HistogramSummary latency = {};  ///< From publish to callback, ns.

  /// What became of its quality of service.
  struct Quality {
    std::uint64_t deadlines_missed = 0;
    std::uint64_t messages_lost = 0;
    std::uint64_t liveliness_lost = 0;
    std::uint64_t liveliness_gained = 0;
  };
  std::optional<Quality> quality = {};  ///< None if it asked for none.
  std::vector<UnmatchedReport> unmatched = {};
};

/// What became of the deadline that a publisher promised.
struct OfferedReport {
  std::string component = {};
  double deadline_ms = 0;
  std::uint64_t missed = 0;
};

struct TopicReport {
  std::string name = {};
  std::string type = {};
  std::uint64_t published = 0;
  std::uint64_t allocated = 0;  ///< Messages that were ever made for it.
  double rate_hz = 0;           ///< Per second of the application's time.
  std::vector<OfferedReport> offered = {};
  std::vector<SubscriberReport> subscribers = {};
};

/// What became of a recording.
struct RecordingReport {
  std::vector<std::string> files = {};
  std::string problem = {};  ///< What went wrong with the files last; empty if nothing did.
  std::uint64_t activations_lost = 0;
  std::vector<record::RecordedTopic> topics = {};
};

/// What became of a replay.
struct ReplayReport {
  /// One stream of the recording.
  struct Stream {
    std::string topic = {};
    std::string component = {};  ///< In whose place it was fed; empty: it was not.
    std::string reason = {};     ///< Why not.
    std::uint64_t messages = 0;  ///< That were fed; of one that was not, those in the recording.
  };

  std::vector<std::string> files = {};
  double from_s = 0;  ///< Since the recorded run began.
  double to_s = 0;
  std::optional<double> worst_lateness_us = {};  ///< Live only.
  std::uint64_t parted_infos = 0;                ///< See `RecordingReader`.
  std::vector<Stream> streams = {};
};

/// The modes that an application went through.
struct ModesReport {
  /// One switch to another mode.
  struct Switch {
    double time_s = 0;  ///< The application's time since its start.
    std::string from = {};
    std::string to = {};
    std::string why = {};
    std::string by = {};  ///< The component that asked; empty: somebody outside.
  };

  std::string at_end = {};
  std::vector<Switch> switches = {};
  std::uint64_t refused = 0;  ///< That were asked for while too many waited.
};

/// One process of an application that has several.
struct ProcessReport {
  /// What became of a topic's messages on the way from it to another process.
  struct Link {
    std::string topic = {};
    std::string to = {};  ///< A process.
    std::uint64_t given = 0;
    std::uint64_t copied = 0;        ///< Had to be copied into the memory that is shared.
    std::uint64_t repaired = 0;      ///< Had some strings copied there.
    std::uint64_t unshared = 0;      ///< Lost: that memory was full.
    std::uint64_t overflowed = 0;    ///< Lost: as many waited as may.
    std::uint64_t over_quota = 0;    ///< Lost: the other process held as many as it may.
    std::uint64_t taken_back = 0;    ///< Held by the other process when it ended.
    std::string always_copied = {};  ///< Why all are copied; empty if they need not be.
  };

  std::string name = {};
  double cpu_s = 0;
  std::int64_t rss_max_kib = 0;
  std::uint64_t restarts = 0;
  std::vector<Link> links = {};
};

/// A value that a component reported.
struct ResultReport {
  std::string component;
  std::string name;
  ReportValue value;
};

/// What there is to say of a run: plain values, which outlive the application.
///
/// @threads  Compatible.
/// What a tool that watched the run adds to the report.
struct ToolReport {
  std::string name;   ///< The key in the JSON.
  std::string json;   ///< Its value.
  std::string table;  ///< The same for people.
};

struct RunReport {
  std::string application;
  std::string clock;  ///< "live" or "simulated".
  /// From the process's start to the first message; none if there was no message.
  std::optional<double> startup_ms;
  double time_s = 0;  ///< The application's time that passed.
  double wall_s = 0;  ///< The same on the wall, the stop included.
  double cpu_s = 0;   ///< Of the whole process since it began.
  std::int64_t rss_max_kib = 0;
  std::string end;  ///< Why the run ended.
  std::vector<ComponentReport> components;
  std::vector<TopicReport> topics;
  std::optional<ModesReport> modes;  ///< None if the application has none.
  std::vector<ChainReport> chains;
  std::optional<ReplayReport> replay;
  std::optional<RecordingReport> recording;
  std::optional<record::FlightReport> flight_recorder;
  std::vector<ProcessReport> processes;  ///< Empty if there is only one.
  std::vector<ResultReport> results;     ///< By component, in their order.
  std::vector<ToolReport> tools;
  std::vector<faults::FaultCount> faults;  ///< That were injected; empty if none were asked for.
};

/// Reads everything from `application`, after `Application::stop`. `wall` is how long the run took
/// on the machine's clock.
[[nodiscard]] RunReport make_report(const Application& application, Duration wall);

/// The report as JSON; docs/reference/report.md says what each key means.
[[nodiscard]] nlohmann::ordered_json to_json(const RunReport& report);

/// The report for people: at most 120 columns.
[[nodiscard]] std::string to_table(const RunReport& report);

/// Sums over the whole application, for a line that shows how it goes.
struct Progress {
  Duration time{};  ///< Since the timers started; in a replay, within the recording.
  std::optional<Duration> length{};  ///< Of the recording that is replayed.
  std::uint64_t published = 0;
  std::uint64_t dropped = 0;
  std::uint64_t faults = 0;
};

/// Reads the sums, also while the application runs: counters only.
///
/// @threads  Safe, between `Application::build` and the application's end.
[[nodiscard]] Progress progress_of(const Application& application);

}  // namespace fastcycle::host
