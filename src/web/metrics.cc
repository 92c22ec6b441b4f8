#include "web/metrics.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace fastcycle::web {
namespace {

namespace protocol = inspect::protocol;

constexpr double kNanosecond = 1e-9;

/// The labels of a series, with their values.
using Labels = std::vector<std::pair<std::string_view, std::string>>;

std::string escaped(std::string_view text) {
  std::string result;
  for (const char letter : text) {
    if (letter == '\\' || letter == '"') {
      result += '\\';
    }
    result += letter == '\n' ? "\\n" : std::string(1, letter);
  }
  return result;
}

std::string to_text(const Labels& labels) {
  std::string text;
  for (const auto& [name, value] : labels) {
    text += fmt::format("{}{}=\"{}\"", text.empty() ? "" : ",", name, escaped(value));
  }
  return text.empty() ? text : "{" + text + "}";
}

/// Histograms of several series can be added: their bounds are equal.
struct Buckets {
  std::map<std::uint64_t, std::uint64_t> below;  ///< By bound, in nanoseconds.
  std::uint64_t count = 0;
  double sum_ns = 0;

  void add(const protocol::Histogram& histogram) {
    for (const auto& bucket : histogram.buckets()) {
      below[bucket.bound_ns()] += bucket.count();
    }
    count += histogram.count();
    sum_ns += histogram.mean_ns() * static_cast<double>(histogram.count());
  }
};

/// Writes metric families, each with all of its series.
class Writer {
 public:
  explicit Writer(MetricsFormat format) : is_open_metrics_(format == MetricsFormat::kOpenMetrics) {}

  /// `name` without `_total`; `unit` is its suffix, or empty.
  void begin_counter(std::string_view name, std::string_view unit, std::string_view help) {
    begin(name, is_open_metrics_ ? "" : "_total", "counter", unit, help);
    suffix_ = "_total";
  }
  void begin_gauge(std::string_view name, std::string_view unit, std::string_view help) {
    begin(name, "", "gauge", unit, help);
  }
  void begin_histogram(std::string_view name, std::string_view help) {
    begin(name, "", "histogram", "seconds", help);
  }

  template <typename Number>
  void add(const Labels& labels, Number value) {
    text_ += fmt::format("{}{}{} {}\n", name_, suffix_, to_text(labels), value);
  }
  /// A state family: 1 for the present state, 0 for the others.
  template <typename Words>
  void add_states(const Labels& labels, std::string_view label, const Words& words,
                  std::string_view current) {
    for (const auto& word : words) {
      Labels its = labels;
      its.emplace_back(label, std::string(word));
      add(its, word == current ? 1 : 0);
    }
  }
  void add(const Labels& labels, const Buckets& buckets) {
    Labels its = labels;
    its.emplace_back("le", "");
    const auto add_bucket = [&](std::string bound, std::uint64_t count) {
      its.back().second = std::move(bound);
      text_ += fmt::format("{}_bucket{} {}\n", name_, to_text(its), count);
    };
    for (const auto& [bound, count] : buckets.below) {
      add_bucket(fmt::format("{}", static_cast<double>(bound) * kNanosecond), count);
    }
    add_bucket("+Inf", buckets.count);
    text_ += fmt::format("{0}_sum{1} {2}\n{0}_count{1} {3}\n", name_, to_text(labels),
                         buckets.sum_ns * kNanosecond, buckets.count);
  }

  [[nodiscard]] std::string end() && {
    if (is_open_metrics_) {
      text_ += "# EOF\n";
    }
    return std::move(text_);
  }

 private:
  void begin(std::string_view name, std::string_view suffix, std::string_view type,
             std::string_view unit, std::string_view help) {
    name_ = name;
    suffix_ = {};
    text_ += fmt::format("# HELP {0}{1} {2}\n# TYPE {0}{1} {3}\n", name, suffix, help, type);
    if (is_open_metrics_ && !unit.empty()) {
      text_ += fmt::format("# UNIT {} {}\n", name, unit);
    }
  }

  const bool is_open_metrics_;
  std::string text_;
  std::string name_;
  std::string_view suffix_;
};

void write_other_processes(const protocol::Overview& overview, Writer& to) {
  if (overview.processes_size() == 0) {
    return;
  }
  const auto each = [&](auto value) {
    for (const protocol::Process& process : overview.processes()) {
      to.add({{"process", process.name()}}, value(process));
    }
  };
  using Process = protocol::Process;
  to.begin_counter("fastcycle_process_cpu_seconds", "seconds",
                   "CPU time of another process of the application.");
  each([](const Process& process) { return static_cast<double>(process.cpu_ns()) * kNanosecond; });
  to.begin_gauge("fastcycle_process_resident_memory_bytes", "bytes",
                 "Its resident memory; what processes share counts in each.");
  each([](const Process& process) { return process.rss_kib() * 1024; });
  to.begin_gauge("fastcycle_process_virtual_memory_bytes", "bytes", "Its address space.");
  each([](const Process& process) { return process.virtual_kib() * 1024; });
  to.begin_gauge("fastcycle_process_open_fds", "",
                 "Its open file descriptors; 0 where the kernel does not show them.");
  each([](const Process& process) { return process.open_files(); });
  to.begin_gauge("fastcycle_process_start_time_seconds", "seconds",
                 "When it began, in seconds since 1970.");
  each(
      [](const Process& process) { return static_cast<double>(process.start_ns()) * kNanosecond; });
}

void write_process(const protocol::Overview& overview, const ServedCounts& served, Writer& to) {
  to.begin_gauge("fastcycle_application_info", "", "Which application runs.");
  to.add({{"application", overview.application()},
          {"file", overview.file()},
          {"clock", overview.clock()}},
         1);
  to.begin_counter("process_cpu_seconds", "seconds", "CPU time of the whole process.");
  to.add({}, static_cast<double>(overview.cpu_ns()) * kNanosecond);
  to.begin_gauge("process_resident_memory_bytes", "bytes", "Resident memory of the process.");
  to.add({}, overview.rss_kib() * 1024);
  to.begin_gauge("process_virtual_memory_bytes", "bytes", "Address space of the process.");
  to.add({}, overview.virtual_kib() * 1024);
  to.begin_gauge("process_open_fds", "", "Open file descriptors of the process.");
  to.add({}, overview.open_files());
  if (overview.max_files() > 0) {
    to.begin_gauge("process_max_fds", "", "File descriptors that the process may have open.");
    to.add({}, overview.max_files());
  }
  to.begin_gauge("process_start_time_seconds", "seconds",
                 "When the process began, in seconds since 1970.");
  to.add({}, static_cast<double>(overview.process_start_ns()) * kNanosecond);
  to.begin_counter("fastcycle_thread_cpu_seconds", "seconds",
                   "CPU time of the threads of this name that there are now.");
  for (const protocol::Thread& thread : overview.threads()) {
    to.add({{"thread", thread.name()}}, static_cast<double>(thread.cpu_ns()) * kNanosecond);
  }
  for (const protocol::Process& process : overview.processes()) {
    for (const protocol::Thread& thread : process.threads()) {
      to.add({{"thread", thread.name()}, {"process", process.name()}},
             static_cast<double>(thread.cpu_ns()) * kNanosecond);
    }
  }
  to.begin_gauge("fastcycle_threads", "", "Threads of this name.");
  for (const protocol::Thread& thread : overview.threads()) {
    to.add({{"thread", thread.name()}}, thread.count());
  }
  for (const protocol::Process& process : overview.processes()) {
    for (const protocol::Thread& thread : process.threads()) {
      to.add({{"thread", thread.name()}, {"process", process.name()}}, thread.count());
    }
  }
  write_other_processes(overview, to);
  to.begin_gauge("fastcycle_time_seconds", "seconds",
                 "The time of the application; in a live run seconds since 1970.");
  to.add({}, static_cast<double>(overview.now_ns()) * kNanosecond);
  if (overview.modes_size() > 0) {
    to.begin_gauge("fastcycle_mode", "", "1 for the mode that the application is in.");
    to.add_states({}, "mode", overview.modes(), overview.mode());
  }
  to.begin_gauge("fastcycle_live_connections", "", "Connections to the live server.");
  to.add({}, served.connections);
  to.begin_counter("fastcycle_live_connections_refused", "",
                   "Connections that the live server refused.");
  to.add({}, served.connections_refused);
  to.begin_counter("fastcycle_live_messages_left_out", "",
                   "Messages that clients of the live server were too slow for.");
  to.add({}, served.messages_left_out);
}

void write_components(const protocol::Overview& overview, Writer& to) {
  const auto each = [&](const auto& add) {
    for (const protocol::Component& component : overview.components()) {
      add(component, Labels{{"component", component.name()}});
    }
  };
  const auto counter = [&](std::string_view name, std::string_view help, auto count) {
    to.begin_counter(name, "", help);
    each([&](const protocol::Component& component, const Labels& labels) {
      to.add(labels, (component.*count)());
    });
  };
  using Component = protocol::Component;
  to.begin_gauge("fastcycle_component_state", "", "1 for the state that the component is in.");
  each([&](const Component& component, const Labels& labels) {
    constexpr std::array<std::string_view, 9> kStates = {"declared", "constructed", "active",
                                                         "stopped",  "failed",      "replayed",
                                                         "standby",  "restarting",  "elsewhere"};
    to.add_states(labels, "state", kStates, component.state());
  });
  to.begin_gauge("fastcycle_component_health", "",
                 "1 for what the component says of itself; hangs: a call does not return.");
  each([&](const Component& component, const Labels& labels) {
    constexpr std::array<std::string_view, 4> kHealths = {"ok", "degraded", "failed", "hangs"};
    to.add_states(labels, "health", kHealths, component.health());
  });
  counter("fastcycle_component_activations", "Activations of the component.",
          &Component::activations);
  counter("fastcycle_component_faults", "Faults of the component.", &Component::faults);
  counter("fastcycle_component_restarts", "Restarts of the component after faults.",
          &Component::restarts);
  counter("fastcycle_component_skipped_ticks", "Ticks of its timers that were skipped.",
          &Component::overruns);
  to.begin_counter("fastcycle_component_busy_seconds", "seconds",
                   "Time within callbacks of the component.");
  each([&](const Component& component, const Labels& labels) {
    to.add(labels, static_cast<double>(component.busy_ns()) * kNanosecond);
  });
  to.begin_gauge("fastcycle_component_queued_messages", "",
                 "Messages that wait for the component.");
  each([&](const Component& component, const Labels& labels) {
    to.add(labels, component.queued());
  });
  const auto histogram = [&](std::string_view name, std::string_view help, auto which) {
    to.begin_histogram(name, help);
    each([&](const Component& component, const Labels& labels) {
      Buckets buckets;
      buckets.add((component.*which)());
      to.add(labels, buckets);
    });
  };
  histogram("fastcycle_component_callback_duration_seconds", "How long callbacks took.",
            &Component::callback);
  histogram("fastcycle_component_timer_lateness_seconds", "How late ticks of timers began.",
            &Component::lateness);
}

/// Totals of a component's subscriptions to a topic.
struct Subscriptions {
  std::uint64_t delivered = 0;
  std::uint64_t queued = 0;
  std::uint64_t depth = 0;
  std::map<std::string, std::uint64_t> dropped;
  Buckets latency;
};

void write_topics(const protocol::Overview& overview, Writer& to) {
  to.begin_counter("fastcycle_topic_published_messages", "",
                   "Messages that the component published on the topic.");
  for (const protocol::Topic& topic : overview.topics()) {
    std::map<std::string, std::uint64_t> published;
    for (const protocol::Publisher& publisher : topic.publishers()) {
      published[publisher.component()] += publisher.published();
    }
    for (const auto& [component, count] : published) {
      to.add({{"topic", topic.name()}, {"component", component}}, count);
    }
  }
  to.begin_gauge("fastcycle_topic_allocated_messages", "",
                 "Messages of the topic that there are in memory.");
  for (const protocol::Topic& topic : overview.topics()) {
    to.add({{"topic", topic.name()}}, topic.allocated());
  }

  std::map<std::pair<std::string, std::string>, Subscriptions> all;  // By topic and component.
  for (const protocol::Topic& topic : overview.topics()) {
    for (const protocol::Subscriber& subscriber : topic.subscribers()) {
      Subscriptions& its = all[{topic.name(), subscriber.component()}];
      its.delivered += subscriber.ledger().delivered();
      its.queued += subscriber.ledger().queued();
      its.depth += subscriber.depth();
      for (const protocol::Drop& drop : subscriber.ledger().drops()) {
        its.dropped[drop.reason()] += drop.count();
      }
      its.latency.add(subscriber.latency());
    }
  }
  const auto each = [&](const auto& add) {
    for (const auto& [names, its] : all) {
      add(its, Labels{{"topic", names.first}, {"component", names.second}});
    }
  };
  to.begin_counter("fastcycle_subscription_delivered_messages", "",
                   "Messages that the component got.");
  each([&](const Subscriptions& its, const Labels& labels) { to.add(labels, its.delivered); });
  to.begin_counter("fastcycle_subscription_dropped_messages", "",
                   "Messages that the component did not get, by the reason.");
  each([&](const Subscriptions& its, const Labels& labels) {
    for (const auto& [reason, count] : its.dropped) {
      Labels with_reason = labels;
      with_reason.emplace_back("reason", reason);
      to.add(with_reason, count);
    }
  });
  to.begin_gauge("fastcycle_subscription_queued_messages", "",
                 "Messages that wait for the component.");
  each([&](const Subscriptions& its, const Labels& labels) { to.add(labels, its.queued); });
  to.begin_gauge("fastcycle_subscription_queue_capacity_messages", "",
                 "Messages for which the queue has room.");
  each([&](const Subscriptions& its, const Labels& labels) { to.add(labels, its.depth); });
  to.begin_histogram("fastcycle_subscription_latency_seconds", "From publish to callback.");
  each([&](const Subscriptions& its, const Labels& labels) { to.add(labels, its.latency); });
}

void write_chains(const nlohmann::json& chains, Writer& to) {
  if (!chains.is_array() || chains.empty()) {
    return;
  }
  const auto counter = [&](std::string_view name, std::string_view help, const char* key) {
    to.begin_counter(name, "", help);
    for (const nlohmann::json& chain : chains) {
      to.add({{"chain", chain.value("name", "")}}, chain.value(key, std::uint64_t{0}));
    }
  };
  counter("fastcycle_chain_judged_messages", "Messages whose latency chain was judged.", "count");
  counter("fastcycle_chain_breached_messages", "Those that were older than the deadline.",
          "breaches");
  counter("fastcycle_chain_dropped_messages", "Those that were not delivered for it.", "dropped");
  to.begin_gauge("fastcycle_chain_deadline_seconds", "seconds", "How old a message may be.");
  for (const nlohmann::json& chain : chains) {
    to.add({{"chain", chain.value("name", "")}}, chain.value("deadline_ms", 0.0) * 1e-3);
  }
}

}  // namespace

MetricsFormat choose_format(std::string_view accept) {
  return accept.find("application/openmetrics-text") != std::string_view::npos
             ? MetricsFormat::kOpenMetrics
             : MetricsFormat::kText;
}

std::string_view content_type(MetricsFormat format) {
  return format == MetricsFormat::kOpenMetrics
             ? "application/openmetrics-text; version=1.0.0; charset=utf-8"
             : "text/plain; version=0.0.4; charset=utf-8";
}

std::string to_metrics(const protocol::Overview& overview, const nlohmann::json& chains,
                       const ServedCounts& served, MetricsFormat format) {
  Writer writer(format);
  write_process(overview, served, writer);
  write_components(overview, writer);
  write_topics(overview, writer);
  write_chains(chains, writer);
  return std::move(writer).end();
}

}  // namespace fastcycle::web
