#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "inspect/inspect.pb.h"

namespace fastcycle::tool::top {

/// Statistics of durations since the start of the run, in nanoseconds.
struct Times {
  double p50_ns = 0;
  double p99_ns = 0;
  double max_ns = 0;
};

/// One callback of a component.
struct CallbackRow {
  std::string name = {};  ///< The topic, service or purpose of the timer.
  std::string kind = {};  ///< What calls it.
  std::optional<Times> time = {};
};

struct ComponentRow {
  std::string name = {};
  std::string executor = {};
  std::string process = {};  ///< Empty: the process that serves the tools.
  std::string state = {};
  std::string health = {};
  std::string remark = {};                 ///< Its health message, else its last fault.
  std::optional<double> cpu_percent = {};  ///< Of one CPU, within callbacks. None: not known yet.
  std::optional<double> activations_hz = {};
  std::optional<Times> callback = {};  ///< None: there was none.
  std::optional<Times> lateness = {};  ///< Of its timers.
  std::vector<CallbackRow> callbacks = {};
  std::uint64_t activations = 0;
  std::uint64_t queued = 0;
  std::uint64_t overruns = 0;
  std::uint64_t faults = 0;
  std::uint64_t restarts = 0;
};

/// What was dropped, by reason.
using Drops = std::vector<std::pair<std::string, std::uint64_t>>;

struct SubscriberRow {
  std::string component = {};
  std::string kind = {};
  std::uint64_t delivered = 0;
  std::uint64_t queued = 0;
  std::uint64_t depth = 0;
  std::uint64_t dropped = 0;
  Drops drops = {};
  std::optional<Times> latency = {};  ///< From publish to callback.
};

struct TopicRow {
  std::string name = {};
  std::string type = {};
  std::vector<std::string> publishers = {};
  std::optional<double> rate_hz = {};
  std::optional<double> bytes_per_s = {};  ///< None where no size is known.
  std::optional<Times> latency = {};       ///< Of the subscriber whose p99 is the largest.
  std::uint64_t published = 0;
  std::uint64_t queued = 0;  ///< In the fullest queue,
  std::uint64_t depth = 0;   ///< which holds so many.
  std::uint64_t dropped = 0;
  std::optional<double> dropped_hz = {};
  Drops drops = {};
  std::vector<SubscriberRow> subscribers = {};
  bool is_service = false;
};

/// One component of a chain.
struct HopRow {
  std::string component = {};
  std::string topic = {};             ///< That it publishes; empty: the last hop publishes none.
  std::optional<Times> waiting = {};  ///< From the previous publish to the begin of its callback.
  std::optional<Times> running = {};  ///< From there to its own publish.
  std::uint64_t breaches = 0;         ///< To which it contributed most.
};

/// A latency chain.
struct ChainRow {
  std::string name = {};
  std::string from = {};
  std::string to = {};
  std::string on_breach = {};
  double deadline_ns = 0;
  std::optional<Times> age = {};  ///< At the time of the check.
  std::uint64_t count = 0;
  std::uint64_t breaches = 0;
  std::uint64_t dropped = 0;
  std::optional<double> breaches_hz = {};
  std::string contributor = {};  ///< The hop with the most breaches, in words; empty: none.
  std::vector<HopRow> hops = {};
};

/// The threads of one name in a process.
struct ThreadRow {
  std::string name = {};
  std::uint32_t count = 0;
  std::optional<double> cpu_percent = {};  ///< Of one CPU.
};

struct ProcessRow {
  std::string name = {};
  std::int64_t pid = 0;
  std::optional<double> cpu_percent = {};  ///< 100 is one CPU.
  double rss_bytes = 0;
  std::uint64_t open_files = 0;  ///< 0: unknown.
  std::vector<ThreadRow> threads = {};
  std::vector<std::string> components = {};
};

/// All that is shown of an application at one moment, as plain values.
///
/// @threads  Compatible.
struct Model {
  std::string application = {};
  std::int64_t pid = 0;
  std::string clock = {};
  std::string mode = {};
  std::string end = {};                    ///< Why the run ends; empty while it runs.
  double up_s = 0;                         ///< The application's time since its start.
  std::optional<double> cpu_percent = {};  ///< Of all its processes; 100 is one CPU.
  std::uint32_t cpus = 0;
  double rss_bytes = 0;  ///< Of all its processes; what they share counts in each.
  std::optional<double> messages_hz = {};
  std::uint64_t dropped = 0;
  std::uint64_t faults = 0;
  std::optional<double> interval_s = {};  ///< The interval that the rates cover.
  std::vector<ComponentRow> components = {};
  std::vector<TopicRow> topics = {};
  std::vector<ChainRow> chains = {};
  std::vector<ProcessRow> processes = {};  ///< Empty if it has only one.
};

/// The answers of an application to one query.
struct Snapshot {
  inspect::protocol::Overview overview = {};
  std::string chains = {};  ///< Its document of that name; empty if it has none.
};

/// The model of `now`. Rates are computed from the growth since `before`; without it there are
/// none, nor for counters that restarted in between (a component reconstructed, an application
/// restarted).
[[nodiscard]] Model model_of(const Snapshot* before, const Snapshot& now);

/// The model as one document; docs/reference/top.md describes each key.
[[nodiscard]] nlohmann::ordered_json to_json(const Model& model);

}  // namespace fastcycle::tool::top
