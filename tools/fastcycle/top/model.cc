#include "top/model.h"

#include <algorithm>
#include <unordered_map>

#include <nlohmann/json.hpp>

namespace fastcycle::tool::top {
namespace {

using inspect::protocol::Overview;
using nlohmann::json;
using nlohmann::ordered_json;

/// What messages and documents call the process that serves the tools.
const std::string kMainProcess = "main";

/// The interval between two snapshots of the same run.
struct Interval {
  double seconds = 0;  ///< 0: there are no rates.

  /// How fast `before` grew to `now`; none if it did not grow from there.
  template <typename T>
  [[nodiscard]] std::optional<double> rate(const T* before, T now) const {
    if (seconds <= 0 || before == nullptr || now < *before) {
      return std::nullopt;
    }
    return static_cast<double>(now - *before) / seconds;
  }
};

Interval interval_of(const Overview* before, const Overview& now) {
  const bool is_same_run =
      before != nullptr && before->pid() == now.pid() && before->application() == now.application();
  return {is_same_run ? static_cast<double>(now.monotonic_ns() - before->monotonic_ns()) / 1e9 : 0};
}

/// `messages` by name.
template <typename Messages>
auto by_name(const Messages& messages) {
  std::unordered_map<std::string, decltype(&messages.Get(0))> found;
  for (const auto& message : messages) {
    found.emplace(message.name(), &message);
  }
  return found;
}

template <typename Map>
auto find(const Map& map, const std::string& name) {
  const auto entry = map.find(name);
  return entry == map.end() ? nullptr : entry->second;
}

std::optional<double> percent(std::optional<double> ns_per_s) {
  return ns_per_s ? std::optional(*ns_per_s / 1e7) : std::nullopt;
}

std::optional<Times> times_of(const inspect::protocol::Histogram& histogram) {
  if (histogram.count() == 0) {
    return std::nullopt;
  }
  return Times{histogram.p50_ns(), histogram.p99_ns(), histogram.max_ns()};
}

/// The row of a process: `Overview` and `Process` have the same fields for it.
template <typename Process>
ProcessRow process_row(std::string name, const Process* before, const Process& now,
                       const Interval& interval) {
  ProcessRow row{.name = std::move(name),
                 .pid = now.pid(),
                 .rss_bytes = static_cast<double>(now.rss_kib()) * 1024,
                 .open_files = now.open_files()};
  const bool is_same = before != nullptr && before->pid() == now.pid();
  if (is_same) {
    const std::int64_t cpu = before->cpu_ns();
    row.cpu_percent = percent(interval.rate(&cpu, now.cpu_ns()));
  }
  std::unordered_map<std::string, std::int64_t> earlier;
  if (is_same) {
    for (const inspect::protocol::Thread& thread : before->threads()) {
      earlier.emplace(thread.name(), thread.cpu_ns());
    }
  }
  for (const inspect::protocol::Thread& thread : now.threads()) {
    const auto cpu = earlier.find(thread.name());
    row.threads.push_back(
        {.name = thread.name(),
         .count = thread.count(),
         .cpu_percent = cpu == earlier.end()
                            ? std::nullopt
                            : percent(interval.rate(&cpu->second, thread.cpu_ns()))});
  }
  return row;
}

/// The processes, if there are several, and their sums.
void add_processes(Model& model, const Overview* before, const Overview& now,
                   const Interval& interval) {
  if (now.processes_size() == 0) {
    return;
  }
  model.processes.push_back(process_row(kMainProcess, before, now, interval));
  const Overview nothing;
  const auto earlier = by_name((before == nullptr ? nothing : *before).processes());
  for (const auto& process : now.processes()) {
    model.processes.push_back(
        process_row(process.name(), find(earlier, process.name()), process, interval));
  }
  for (ProcessRow& row : model.processes) {
    for (const ComponentRow& component : model.components) {
      if ((component.process.empty() ? kMainProcess : component.process) == row.name) {
        row.components.push_back(component.name);
      }
    }
  }
  model.cpu_percent.reset();
  model.rss_bytes = 0;
  for (const ProcessRow& row : model.processes) {
    model.rss_bytes += row.rss_bytes;
    if (row.cpu_percent) {
      model.cpu_percent = model.cpu_percent.value_or(0) + *row.cpu_percent;
    }
  }
}

ComponentRow component_row(const inspect::protocol::Component* before,
                           const inspect::protocol::Component& now, const Interval& interval) {
  ComponentRow row{.name = now.name(),
                   .executor = now.executor(),
                   .process = now.process(),
                   .state = now.state(),
                   .health = now.health(),
                   .remark = now.health_reason().empty() ? now.last_fault() : now.health_reason(),
                   .callback = times_of(now.callback()),
                   .lateness = times_of(now.lateness()),
                   .activations = now.activations(),
                   .queued = now.queued(),
                   .overruns = now.overruns(),
                   .faults = now.faults(),
                   .restarts = now.restarts()};
  for (const inspect::protocol::Callback& callback : now.callbacks()) {
    row.callbacks.push_back(
        {.name = callback.name(), .kind = callback.kind(), .time = times_of(callback.time())});
  }
  if (now.state() == "elsewhere") {
    row.remark = "in the process " + now.process();
  }
  if (now.is_on_probation()) {
    row.remark = now.library() + ", on probation" + (row.remark.empty() ? "" : "; " + row.remark);
  }
  if (before != nullptr) {
    const std::int64_t busy = before->busy_ns();
    const std::uint64_t activations = before->activations();
    row.cpu_percent = percent(interval.rate(&busy, now.busy_ns()));
    row.activations_hz = interval.rate(&activations, now.activations());
  }
  return row;
}

void add(Drops& drops, const std::string& reason, std::uint64_t count) {
  const auto same = std::find_if(drops.begin(), drops.end(),
                                 [&](const auto& drop) { return drop.first == reason; });
  if (same == drops.end()) {
    drops.emplace_back(reason, count);
  } else {
    same->second += count;
  }
}

SubscriberRow subscriber_row(const inspect::protocol::Subscriber& subscriber) {
  SubscriberRow row{.component = subscriber.component(),
                    .kind = subscriber.kind(),
                    .delivered = subscriber.ledger().delivered(),
                    .queued = subscriber.ledger().queued(),
                    .depth = subscriber.depth(),
                    .dropped = subscriber.ledger().dropped(),
                    .latency = times_of(subscriber.latency())};
  for (const inspect::protocol::Drop& drop : subscriber.ledger().drops()) {
    add(row.drops, drop.reason(), drop.count());
  }
  return row;
}

/// Whether more of `a` is full than of `b`.
bool is_fuller(const SubscriberRow& a, const TopicRow& b) {
  const auto share = [](std::uint64_t queued, std::uint64_t depth) {
    return static_cast<double>(queued) / static_cast<double>(std::max<std::uint64_t>(depth, 1));
  };
  return share(a.queued, a.depth) > share(b.queued, b.depth) || b.depth == 0;
}

TopicRow topic_row(const inspect::protocol::Topic* before, const inspect::protocol::Topic& now,
                   const Interval& interval) {
  TopicRow row{.name = now.name(),
               .type = now.type(),
               .latency = times_of(now.latency()),
               .published = now.published(),
               .dropped = now.dropped(),
               .is_service = now.is_service()};
  for (const inspect::protocol::Publisher& publisher : now.publishers()) {
    row.publishers.push_back(publisher.component());
  }
  for (const inspect::protocol::Subscriber& subscriber : now.subscribers()) {
    row.subscribers.push_back(subscriber_row(subscriber));
    const SubscriberRow& added = row.subscribers.back();
    if (is_fuller(added, row)) {
      row.queued = added.queued;
      row.depth = added.depth;
    }
    for (const auto& [reason, count] : added.drops) {
      add(row.drops, reason, count);
    }
  }
  if (before != nullptr) {
    const std::uint64_t published = before->published();
    const std::uint64_t dropped = before->dropped();
    row.rate_hz = interval.rate(&published, now.published());
    row.dropped_hz = interval.rate(&dropped, now.dropped());
  }
  if (row.rate_hz && now.message_bytes() > 0) {
    row.bytes_per_s = *row.rate_hz * static_cast<double>(now.message_bytes());
  }
  return row;
}

std::string text_at(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

double number_at(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : 0;
}

std::uint64_t count_at(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
}

/// Microseconds by the names p50, p99 and max; null if there was nothing.
std::optional<Times> times_at(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_object()) {
    return std::nullopt;
  }
  return Times{number_at(*found, "p50") * 1e3, number_at(*found, "p99") * 1e3,
               number_at(*found, "max") * 1e3};
}

HopRow hop_row(const json& hop) {
  return {.component = text_at(hop, "component"),
          .topic = text_at(hop, "topic"),
          .waiting = times_at(hop, "waiting_us"),
          .running = times_at(hop, "running_us"),
          .breaches = count_at(hop, "breaches")};
}

ChainRow chain_row(const json& chain) {
  ChainRow row{.name = text_at(chain, "name"),
               .from = text_at(chain, "from"),
               .to = text_at(chain, "to"),
               .on_breach = text_at(chain, "on_breach"),
               .deadline_ns = number_at(chain, "deadline_ms") * 1e6,
               .age = count_at(chain, "count") > 0 ? times_at(chain, "age_us") : std::nullopt,
               .count = count_at(chain, "count"),
               .breaches = count_at(chain, "breaches"),
               .dropped = count_at(chain, "dropped")};
  if (const auto largest = chain.find("largest_contributor");
      largest != chain.end() && largest->is_object()) {
    row.contributor = text_at(*largest, "component") + " " + text_at(*largest, "part");
  }
  if (const auto hops = chain.find("hops"); hops != chain.end() && hops->is_array()) {
    for (const json& hop : *hops) {
      row.hops.push_back(hop_row(hop));
    }
  }
  return row;
}

std::vector<ChainRow> chain_rows(const std::string& document) {
  std::vector<ChainRow> rows;
  const json chains = json::parse(document, nullptr, false);
  if (chains.is_array()) {
    for (const json& chain : chains) {
      rows.push_back(chain_row(chain));
    }
  }
  return rows;
}

void add_chains(Model& model, const Snapshot* before, const Snapshot& now,
                const Interval& interval) {
  model.chains = chain_rows(now.chains);
  const std::vector<ChainRow> earlier =
      before == nullptr ? std::vector<ChainRow>() : chain_rows(before->chains);
  for (ChainRow& row : model.chains) {
    for (const ChainRow& same : earlier) {
      if (same.name == row.name) {
        row.breaches_hz = interval.rate(&same.breaches, row.breaches);
      }
    }
  }
}

/// A number if there is one, else null.
ordered_json or_null(const std::optional<double>& number) {
  return number ? ordered_json(*number) : ordered_json(nullptr);
}

ordered_json times_json(const std::optional<Times>& times) {
  if (!times) {
    return nullptr;
  }
  return {{"p50", times->p50_ns / 1e3}, {"p99", times->p99_ns / 1e3}, {"max", times->max_ns / 1e3}};
}

ordered_json drops_json(const Drops& drops) {
  ordered_json counts = ordered_json::object();
  for (const auto& [reason, count] : drops) {
    counts[reason] = count;
  }
  return counts;
}

ordered_json component_json(const ComponentRow& row) {
  ordered_json callbacks = ordered_json::array();
  for (const CallbackRow& callback : row.callbacks) {
    callbacks.push_back(
        {{"kind", callback.kind}, {"name", callback.name}, {"time_us", times_json(callback.time)}});
  }
  return {{"name", row.name},
          {"executor", row.executor},
          {"process", row.process.empty() ? "main" : row.process},
          {"state", row.state},
          {"health", row.health},
          {"remark", row.remark},
          {"cpu_percent", or_null(row.cpu_percent)},
          {"activations", row.activations},
          {"activations_hz", or_null(row.activations_hz)},
          {"callback_us", times_json(row.callback)},
          {"lateness_us", times_json(row.lateness)},
          {"callbacks", std::move(callbacks)},
          {"queued", row.queued},
          {"overruns", row.overruns},
          {"faults", row.faults},
          {"restarts", row.restarts}};
}

ordered_json topic_json(const TopicRow& row) {
  ordered_json subscribers = ordered_json::array();
  for (const SubscriberRow& subscriber : row.subscribers) {
    subscribers.push_back({{"component", subscriber.component},
                           {"kind", subscriber.kind},
                           {"delivered", subscriber.delivered},
                           {"queued", subscriber.queued},
                           {"depth", subscriber.depth},
                           {"dropped", drops_json(subscriber.drops)},
                           {"latency_us", times_json(subscriber.latency)}});
  }
  return {{"name", row.name},
          {"type", row.type},
          {"publishers", row.publishers},
          {"published", row.published},
          {"rate_hz", or_null(row.rate_hz)},
          {"bytes_per_s", or_null(row.bytes_per_s)},
          {"latency_us", times_json(row.latency)},
          {"dropped", drops_json(row.drops)},
          {"subscribers", std::move(subscribers)}};
}

ordered_json chain_json(const ChainRow& row) {
  ordered_json hops = ordered_json::array();
  for (const HopRow& hop : row.hops) {
    hops.push_back({{"component", hop.component},
                    {"topic", hop.topic.empty() ? ordered_json(nullptr) : ordered_json(hop.topic)},
                    {"waiting_us", times_json(hop.waiting)},
                    {"running_us", times_json(hop.running)},
                    {"breaches", hop.breaches}});
  }
  return {{"name", row.name},
          {"from", row.from},
          {"to", row.to},
          {"deadline_ms", row.deadline_ns / 1e6},
          {"on_breach", row.on_breach},
          {"count", row.count},
          {"breaches", row.breaches},
          {"breaches_hz", or_null(row.breaches_hz)},
          {"dropped", row.dropped},
          {"age_us", times_json(row.age)},
          {"largest_contributor",
           row.contributor.empty() ? ordered_json(nullptr) : ordered_json(row.contributor)},
          {"hops", std::move(hops)}};
}

ordered_json process_json(const ProcessRow& row) {
  ordered_json threads = ordered_json::array();
  for (const ThreadRow& thread : row.threads) {
    threads.push_back({{"name", thread.name},
                       {"count", thread.count},
                       {"cpu_percent", or_null(thread.cpu_percent)}});
  }
  return {{"name", row.name},
          {"pid", row.pid},
          {"cpu_percent", or_null(row.cpu_percent)},
          {"rss_bytes", row.rss_bytes},
          {"open_files", row.open_files == 0 ? ordered_json() : ordered_json(row.open_files)},
          {"threads", std::move(threads)},
          {"components", row.components}};
}

}  // namespace

Model model_of(const Snapshot* snapshot_before, const Snapshot& snapshot_now) {
  const Overview* const before = snapshot_before == nullptr ? nullptr : &snapshot_before->overview;
  const Overview& now = snapshot_now.overview;
  const Interval interval = interval_of(before, now);
  Model model{
      .application = now.application(),
      .pid = now.pid(),
      .clock = now.clock(),
      .mode = now.mode(),
      .end = now.end() == "running" ? "" : now.end(),
      .up_s = now.start_ns() == 0 ? 0 : static_cast<double>(now.now_ns() - now.start_ns()) / 1e9,
      .cpus = now.cpus(),
      .rss_bytes = static_cast<double>(now.rss_kib()) * 1024};
  if (interval.seconds > 0) {
    model.interval_s = interval.seconds;
    const std::int64_t cpu = before->cpu_ns();
    model.cpu_percent = percent(interval.rate(&cpu, now.cpu_ns()));
  }

  const Overview nothing;
  const Overview& earlier = before == nullptr ? nothing : *before;
  const auto components = by_name(earlier.components());
  for (const auto& component : now.components()) {
    model.components.push_back(
        component_row(find(components, component.name()), component, interval));
    model.faults += component.faults();
  }
  const auto topics = by_name(earlier.topics());
  for (const auto& topic : now.topics()) {
    model.topics.push_back(topic_row(find(topics, topic.name()), topic, interval));
    model.dropped += topic.dropped();
    if (model.topics.back().rate_hz) {
      model.messages_hz = model.messages_hz.value_or(0) + *model.topics.back().rate_hz;
    }
  }
  add_chains(model, snapshot_before, snapshot_now, interval);
  add_processes(model, before, now, interval);
  return model;
}

ordered_json to_json(const Model& model) {
  ordered_json chains = ordered_json::array();
  for (const ChainRow& row : model.chains) {
    chains.push_back(chain_json(row));
  }
  ordered_json processes = ordered_json::array();
  for (const ProcessRow& row : model.processes) {
    processes.push_back(process_json(row));
  }
  ordered_json components = ordered_json::array();
  for (const ComponentRow& row : model.components) {
    components.push_back(component_json(row));
  }
  ordered_json topics = ordered_json::array();
  for (const TopicRow& row : model.topics) {
    topics.push_back(topic_json(row));
  }
  return {{"application", model.application},
          {"pid", model.pid},
          {"clock", model.clock},
          {"mode", model.mode.empty() ? ordered_json(nullptr) : ordered_json(model.mode)},
          {"end", model.end.empty() ? ordered_json(nullptr) : ordered_json(model.end)},
          {"up_s", model.up_s},
          {"interval_s", or_null(model.interval_s)},
          {"cpu_percent", or_null(model.cpu_percent)},
          {"rss_bytes", model.rss_bytes},
          {"messages_hz", or_null(model.messages_hz)},
          {"dropped", model.dropped},
          {"faults", model.faults},
          {"components", std::move(components)},
          {"topics", std::move(topics)},
          {"chains", std::move(chains)},
          {"processes", std::move(processes)}};
}

}  // namespace fastcycle::tool::top
