#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "inspect/inspect.pb.h"

namespace fastcycle::tool::top {

/// Of durations since the start of the run, in nanoseconds.
struct Times {
  double p50_ns = 0;
  double p99_ns = 0;
  double max_ns = 0;
};

struct ComponentRow {
  std::string name = {};
  std::string executor = {};
  std::string process = {};  ///< Empty: that of the tools.
  std::string state = {};
  std::string health = {};
  std::string remark = {};                 ///< What it says of its health, else its last fault.
  std::optional<double> cpu_percent = {};  ///< Of one CPU, within callbacks. None: not known yet.
  std::optional<double> activations_hz = {};
  std::optional<Times> callback = {};  ///< None: there was none.
  std::optional<Times> lateness = {};  ///< Of its timers.
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

/// One component on the way of a chain.
struct HopRow {
  std::string component = {};
  std::string topic = {};  ///< That it publishes; empty: the last one, which publishes none.
  std::optional<Times> waiting = {};  ///< From the publish before until its callback began.
  std::optional<Times> running = {};  ///< From there until its publish.
  std::uint64_t guilty = 0;           ///< Breaches that are due to it.
};

/// A latency chain.
struct ChainRow {
  std::string name = {};
  std::string from = {};
  std::string to = {};
  std::string on_breach = {};
  double deadline_ns = 0;
  std::optional<Times> age = {};  ///< When it was judged.
  std::uint64_t count = 0;
  std::uint64_t breaches = 0;
  std::uint64_t dropped = 0;
  std::optional<double> breaches_hz = {};
  std::string guilty = {};  ///< The hop that most breaches are due to, in words; empty: none.
  std::vector<HopRow> hops = {};
};

/// All that is shown of an application at one moment: plain values.
///
/// @threads  Compatible.
struct Model {
  std::string application = {};
  std::int64_t pid = 0;
  std::string clock = {};
  std::string mode = {};
  std::string end = {};                    ///< Why the run ends; empty while it runs.
  double up_s = 0;                         ///< The application's time since its start.
  std::optional<double> cpu_percent = {};  ///< Of the whole process; 100 is one CPU.
  std::uint32_t cpus = 0;
  double rss_bytes = 0;
  std::optional<double> messages_hz = {};
  std::uint64_t dropped = 0;
  std::uint64_t faults = 0;
  std::optional<double> interval_s = {};  ///< That the rates are of.
  std::vector<ComponentRow> components = {};
  std::vector<TopicRow> topics = {};
  std::vector<ChainRow> chains = {};
};

/// What an application says when it is asked.
struct Snapshot {
  inspect::protocol::Overview overview = {};
  std::string chains = {};  ///< Its document of that name; empty if it has none.
};

/// What `now` says. Rates come from what grew since `before`; there are none without it, and none
/// of what was counted anew in between (a component made anew, an application started again).
[[nodiscard]] Model model_of(const Snapshot* before, const Snapshot& now);

/// The model as one document; docs/reference/top.md says what each key means.
[[nodiscard]] nlohmann::ordered_json to_json(const Model& model);

}  // namespace fastcycle::tool::top
