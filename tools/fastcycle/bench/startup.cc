// startup: from nothing to the first messages; what topics weigh; an application that idles.

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include "bench/modes.h"
#include "measure/clock.h"
#include "measure/statistics.h"
#include "measure/usage.h"

namespace fastcycle::tool::bench {
namespace {

using Numbers = std::vector<std::int64_t>;

/// Of all topics each component publishes its share, and subscribes to that of the next one.
struct Shape {
  std::int64_t components = 0;
  std::int64_t topics = 0;
  bool subscribes = true;
  bool ends_run = true;
};

Numbers share_of(std::int64_t component, const Shape& shape) {
  Numbers share;
  for (std::int64_t topic = component; topic < shape.topics; topic += shape.components) {
    share.push_back(topic);
  }
  return share;
}

std::string node_name(std::int64_t number) {
  return fmt::format("node_{}", number);
}

Json nodes_application(const Options& options, const Shape& shape) {
  Json nodes = Json::array();
  for (std::int64_t i = 0; i < shape.components; ++i) {
    Json node = component(node_name(i), "benchmark_node", "subscriber",
                          {{"publishes", share_of(i, shape)}, {"ends_run", shape.ends_run}});
    node["params"]["subscribes"] =
        shape.subscribes ? share_of((i + 1) % shape.components, shape) : Numbers();
    nodes.push_back(std::move(node));
  }
  return application(Json::array({executor(options, "subscriber", "park", 0)}), std::move(nodes));
}

/// The current memory of the process.
struct Memory {
  std::int64_t rss_kib = 0;
  std::int64_t heap_bytes = 0;

  static Memory now() {
    Memory memory;
    std::int64_t total_pages = 0;
    std::int64_t resident_pages = 0;
    std::ifstream("/proc/self/statm") >> total_pages >> resident_pages;
    memory.rss_kib = resident_pages * sysconf(_SC_PAGESIZE) / 1024;
    const struct mallinfo2 heap = mallinfo2();
    memory.heap_bytes = static_cast<std::int64_t>(heap.uordblks + heap.hblkhd);
    return memory;
  }
};

/// A run of nodes, with what the process held before it and while it ran.
struct Weighed {
  Finished finished;
  Memory before;
  Memory during;
};

Weighed weigh(Session& session, const Shape& shape) {
  Weighed weighed;
  const Json json = nodes_application(session.options(), shape);
  weighed.before = Memory::now();
  weighed.finished = session.run_application(
      json, {.before_stop = [&weighed] { weighed.during = Memory::now(); }});
  return weighed;
}

double milliseconds(std::int64_t from_ns, std::int64_t to_ns) {
  return static_cast<double>(to_ns - from_ns) / 1e6;
}

/// The stages of the start, from the JSON file to the last of the first messages.
std::string stages_json(const Weighed& weighed) {
  const Stages& stages = weighed.finished.stages;
  std::int64_t last_ns = stages.started_ns;
  for (const auto& [component, results] : weighed.finished.results) {
    last_ns = std::max(last_ns, weighed.finished.whole(component, "all_arrived_ns"));
  }
  return fmt::format(
      "\"startup_ms\":{:.3f},\"read_ms\":{:.3f},\"build_ms\":{:.3f},\"start_ms\":{:.3f},"
      "\"rss_before_kib\":{},\"rss_after_kib\":{}",
      milliseconds(stages.begin_ns, last_ns), milliseconds(stages.begin_ns, stages.read_ns),
      milliseconds(stages.read_ns, stages.built_ns),
      milliseconds(stages.built_ns, stages.started_ns), weighed.before.rss_kib,
      weighed.during.rss_kib);
}

std::int64_t heap_of(const Weighed& weighed) {
  std::uint64_t messages = 0;
  for (const host::TopicReport& topic : weighed.finished.report.topics) {
    messages += topic.allocated;
  }
  const std::int64_t message_bytes = weighed.finished.whole(node_name(0), "message_bytes");
  return weighed.during.heap_bytes - weighed.before.heap_bytes -
         static_cast<std::int64_t>(messages) * message_bytes;
}

/// Heap without messages: that of the components alone, with topics, and with subscriptions.
std::string weights_json(Session& session, const Weighed& whole, Shape shape) {
  shape.subscribes = false;
  const Weighed with_topics = weigh(session, shape);
  const auto topics = static_cast<double>(std::exchange(shape.topics, 0));
  const Weighed bare = weigh(session, shape);
  return fmt::format(
      "\"bytes_per_component\":{:.0f},\"bytes_per_topic\":{:.0f},\"bytes_per_subscription\":{:.0f},"
      "\"message_bytes\":{}",
      static_cast<double>(heap_of(bare)) / static_cast<double>(shape.components),
      static_cast<double>(heap_of(with_topics) - heap_of(bare)) / topics,
      static_cast<double>(heap_of(whole) - heap_of(with_topics)) / topics,
      whole.finished.whole(node_name(0), "message_bytes"));
}

/// The time of publish(), p50, of one topic with one subscriber, in an application with `shape`
/// beside it.
double publish_us(Session& session, Shape shape) {
  shape.ends_run = false;
  const Options& options = session.options();
  Json json = nodes_application(options, shape);
  Json its_source = source(options, 64);
  its_source["params"]["stamps_publish"] = true;
  write_samples_to(its_source, session.folder());
  json["executors"].push_back(executor(options, "publisher", "park", 1));
  json["components"].push_back(sink(options, "sink", 64));
  json["components"].push_back(std::move(its_source));
  static_cast<void>(session.run_application(json));
  return measure::summarize(measure::transfer_ns(measure::without_warmup(
                                session.samples_of("source"), options.warmup)))
      .p50_us;
}

/// The application with nothing to do, for the time of --for.
std::string idle_json(Session& session, Shape shape) {
  constexpr Duration kSettling{100'000'000};  // In nanoseconds; the first messages are the start's.
  shape.ends_run = false;
  malloc_trim(0);  // Memory freed by earlier applications.
  measure::Usage used;
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
  Memory memory;
  static_cast<void>(session.run_application(nodes_application(session.options(), shape),
                                            {.limit = session.options().idle + kSettling,
                                             .after_start =
                                                 [&] {
                                                   measure::sleep_until(measure::now_ns() +
                                                                        kSettling.count());
                                                   begin_ns = measure::now_ns();
                                                   used = measure::Usage::now();
                                                 },
                                             .before_stop =
                                                 [&] {
                                                   used = measure::Usage::now() - used;
                                                   end_ns = measure::now_ns();
                                                   memory = Memory::now();
                                                 }}));
  const double seconds = static_cast<double>(end_ns - begin_ns) / 1e9;
  return fmt::format(
      "\"idle_s\":{:.3f},\"idle_rss_kib\":{},\"idle_cpu_percent\":{:.4f},"
      "\"idle_switches_per_s\":{:.2f}",
      seconds, memory.rss_kib, used.cpu_us / seconds / 1e4,
      static_cast<double>(used.voluntary_switches + used.involuntary_switches) / seconds);
}

Finding measure_startup(Session& session) {
  const Options& options = session.options();
  const Shape shape{.components = options.components, .topics = options.topics};
  Finding finding{.row = session.row("fastcycle-park", 0)};
  const Weighed whole = weigh(session, shape);  // First: the libraries are not loaded yet.
  finding.row.n = shape.topics;
  finding.row.lost = whole.finished.sum("awaited");
  finding.row.interval_us = 0;
  finding.row.warmup = 0;
  std::string& more = finding.row.more;
  more = fmt::format("\"components\":{},\"topics\":{},", shape.components, shape.topics);
  more += stages_json(whole);
  more += "," + weights_json(session, whole, shape);
  more += fmt::format(",\"publish_us\":{:.3f}", publish_us(session, shape));
  more += fmt::format(",\"publish_alone_us\":{:.3f}", publish_us(session, {}));
  more += "," + idle_json(session, shape);
  return finding;
}

}  // namespace

Mode startup_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application =
      nodes_application(options, {.components = options.components, .topics = options.topics});
  mode.title =
      fmt::format("{} components and {} topics of one library, each topic with one subscriber",
                  options.components, options.topics);
  mode.is_upright = true;
  mode.columns = {
      {"from nothing to all first messages, ms", "startup_ms", 2},
      {"  the JSON file read and checked, ms", "read_ms", 2},
      {"  libraries loaded, all constructed and connected, ms", "build_ms", 2},
      {"  components started, ms", "start_ms", 2},
      {"subscribers that got no message", "lost", 0},
      {"resident before, KiB", "rss_before_kib", 0},
      {"resident after, KiB", "rss_after_kib", 0},
      {"heap a component, bytes", "bytes_per_component", 0},
      {"heap per topic, without its messages, bytes", "bytes_per_topic", 0},
      {"heap per subscription, without its messages, bytes", "bytes_per_subscription", 0},
      {"publish() beside them, p50, µs", "publish_us", 2},
      {"publish() in an application of its own, p50, µs", "publish_alone_us", 2},
      {"idle: seconds watched", "idle_s", 2},
      {"idle: resident, KiB", "idle_rss_kib", 0},
      {"idle: percent of one CPU", "idle_cpu_percent", 4},
      {"idle: context switches a second", "idle_switches_per_s", 2}};
  mode.points = {{.steps = {{.peer = "fastcycle-park",
                             .measure = [session] { return measure_startup(*session); }}}}};
  return mode;
}

}  // namespace fastcycle::tool::bench
