#include "report/report_parts.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <variant>

namespace fastcycle::host {
namespace {

/// Serializes values.
class Writer {
 public:
  template <typename T>
  void add(T& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  void add_text(std::string& text) {
    std::uint64_t size = text.size();
    add(size);
    bytes += text;
  }
  std::string bytes;
};

/// Deserializes them.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  void add(T& value) {
    std::memcpy(&value, take(sizeof(value)).data(), sizeof(value));
  }
  void add_text(std::string& text) {
    std::uint64_t size = 0;
    add(size);
    text = take(size);
  }

 private:
  std::string_view take(std::uint64_t size) {
    if (size > bytes_.size()) {
      throw std::runtime_error("a part of the report is cut off");
    }
    const std::string_view taken = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return taken;
  }
  std::string_view bytes_;
};

// `pass` writes or reads a value, depending on the archive.

template <typename Archive, typename T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>)
void pass(Archive& archive, T& value) {
  archive.add(value);
}
template <typename Archive>
void pass(Archive& archive, std::string& text) {
  archive.add_text(text);
}
template <typename Archive>
void pass(Archive& archive, std::filesystem::path& path) {
  std::string text = path.string();
  archive.add_text(text);
  path = text;
}
template <typename Archive>
void pass(Archive& archive, base::HistogramSummary& summary) {
  archive.add(summary);
}
template <typename Archive, typename T, std::size_t count>
void pass(Archive& archive, std::array<T, count>& values) {
  for (T& value : values) {
    pass(archive, value);
  }
}

template <typename Archive, typename T>
void pass(Archive& archive, std::optional<T>& value);
template <typename Archive, typename T>
void pass(Archive& archive, std::vector<T>& values);

template <typename Archive, typename... Fields>
void pass_all(Archive& archive, Fields&... fields) {
  (pass(archive, fields), ...);
}

template <typename Archive>
void pass(Archive& archive, ReportValue& value) {
  std::uint64_t index = value.index();
  archive.add(index);
  const auto with = [&](auto fresh) {
    if (auto* const held = std::get_if<decltype(fresh)>(&value)) {
      fresh = *held;
    }
    pass(archive, fresh);
    value = std::move(fresh);
  };
  switch (index) {
    case 0:
      with(bool{});
      break;
    case 1:
      with(std::int64_t{});
      break;
    case 2:
      with(double{});
      break;
    default:
      with(std::string());
      break;
  }
}
template <typename Archive>
void pass(Archive& archive, ResultReport& result) {
  pass_all(archive, result.component, result.name, result.value);
}
template <typename Archive>
void pass(Archive& archive, CallbackReport& report) {
  pass_all(archive, report.name, report.kind, report.time);
}
template <typename Archive>
void pass(Archive& archive, detail::VersionNews& version) {
  pass_all(archive, version.library, version.build_id, version.is_on_probation, version.reloads,
           version.rollbacks, version.last);
}
template <typename Archive>
void pass(Archive& archive, ComponentReport& report) {
  pass_all(archive, report.name, report.state, report.activations, report.callback,
           report.callbacks, report.timer_lateness, report.overruns, report.faults,
           report.fault_texts, report.restarts, report.version, report.was_active, report.is_stuck,
           report.is_replayed, report.health, report.health_reason);
}
template <typename Archive>
void pass(Archive& archive, UnmatchedReport& report) {
  pass_all(archive, report.reason, report.count, report.topic, report.difference_ms, report.text);
}
template <typename Archive>
void pass(Archive& archive, detail::Ledger& ledger) {
  pass_all(archive, ledger.published, ledger.delivered, ledger.dropped, ledger.queued);
}
template <typename Archive>
void pass(Archive& archive, SubscriberReport::Quality& quality) {
  pass_all(archive, quality.deadlines_missed, quality.messages_lost, quality.liveliness_lost,
           quality.liveliness_gained);
}
template <typename Archive>
void pass(Archive& archive, SubscriberReport& report) {
  pass_all(archive, report.component, report.kind, report.depth, report.ledger, report.latency,
           report.quality, report.unmatched);
}
template <typename Archive>
void pass(Archive& archive, OfferedReport& report) {
  pass_all(archive, report.component, report.deadline_ms, report.missed);
}
template <typename Archive>
void pass(Archive& archive, TopicReport& report) {
  pass_all(archive, report.name, report.type, report.published, report.replayed, report.allocated,
           report.rate_hz, report.offered, report.subscribers);
}
template <typename Archive>
void pass(Archive& archive, record::RecordedTopic& topic) {
  pass_all(archive, topic.topic, topic.published, topic.recorded, topic.bytes, topic.overflow,
           topic.pool, topic.memory, topic.disk, topic.too_large, topic.process, topic.shutdown);
}
template <typename Archive>
void pass(Archive& archive, RecordingReport& report) {
  pass_all(archive, report.files, report.problem, report.activations_lost, report.reads_lost,
           report.topics);
}
template <typename Archive>
void pass(Archive& archive, record::FlightTrigger& trigger) {
  pass_all(archive, trigger.time_ns, trigger.reason, trigger.component, trigger.detail);
}
template <typename Archive>
void pass(Archive& archive, record::FlightDump& dump) {
  pass_all(archive, dump.file, dump.trigger, dump.trigger_count, dump.messages, dump.missing,
           dump.problem);
}
template <typename Archive>
void pass(Archive& archive, record::FlightReport& report) {
  pass_all(archive, report.file, report.capacity, report.messages, report.bytes, report.overflow,
           report.pool, report.too_large, report.process, report.activations_lost,
           report.reads_lost, report.problem, report.dumps, report.triggers_refused);
}
template <typename Archive>
void pass(Archive& archive, ReplayReport::Stream& stream) {
  pass_all(archive, stream.topic, stream.component, stream.reason, stream.messages);
}
template <typename Archive>
void pass(Archive& archive, ReplayReport& report) {
  pass_all(archive, report.files, report.from_s, report.to_s, report.worst_lateness_us,
           report.parted_infos, report.streams);
}
template <typename Archive>
void pass(Archive& archive, ModesReport::Switch& report) {
  pass_all(archive, report.time_s, report.from, report.to, report.why, report.by);
}
template <typename Archive>
void pass(Archive& archive, ModesReport& report) {
  pass_all(archive, report.at_end, report.switches, report.refused);
}
template <typename Archive>
void pass(Archive& archive, HopReport& report) {
  pass_all(archive, report.component, report.topic, report.waiting, report.running,
           report.breaches_by_waiting, report.breaches_by_running);
}
template <typename Archive>
void pass(Archive& archive, ChainReport& report) {
  pass_all(archive, report.name, report.from, report.to, report.deadline_ms, report.on_breach,
           report.is_judged, report.count, report.breaches, report.dropped, report.age,
           report.hops);
}
template <typename Archive>
void pass(Archive& archive, ProcessReport::Link& link) {
  pass_all(archive, link.topic, link.to, link.given, link.copied, link.repaired, link.unshared,
           link.overflowed, link.over_quota, link.taken_back, link.always_copied);
}
template <typename Archive>
void pass(Archive& archive, ProcessReport& report) {
  pass_all(archive, report.name, report.cpu_s, report.rss_max_kib, report.restarts, report.links);
}
template <typename Archive>
void pass(Archive& archive, ChainNews& chain) {
  pass_all(archive, chain.chain, chain.count, chain.breaches, chain.dropped);
}
template <typename Archive>
void pass(Archive& archive, EarlierRuns& runs) {
  pass_all(archive, runs.component, runs.faults, runs.restarts, runs.reloads, runs.rollbacks,
           runs.last_end, runs.chains);
}
template <typename Archive>
void pass(Archive& archive, ToolReport& report) {
  pass_all(archive, report.name, report.json, report.table);
}
template <typename Archive>
void pass(Archive& archive, faults::FaultCount& fault) {
  pass_all(archive, fault.name, fault.kind, fault.target, fault.count, fault.messages);
}
template <typename Archive>
void pass(Archive& archive, RunReport& report) {
  pass_all(archive, report.application, report.clock, report.startup_ms, report.time_s,
           report.wall_s, report.cpu_s, report.rss_max_kib, report.end, report.components,
           report.topics, report.modes, report.chains, report.replay, report.recording,
           report.flight_recorder, report.processes, report.results, report.tools, report.faults,
           report.earlier_runs);
}

template <typename Archive, typename T>
void pass(Archive& archive, std::optional<T>& value) {
  bool has_value = value.has_value();
  archive.add(has_value);
  if (has_value) {
    if (!value) {
      value.emplace(T{});
    }
    pass(archive, *value);
  }
}

template <typename Archive, typename T>
void pass(Archive& archive, std::vector<T>& values) {
  std::uint64_t count = values.size();
  archive.add(count);
  if constexpr (std::is_same_v<Archive, Reader>) {
    values.clear();
    for (std::uint64_t i = 0; i < count; ++i) {
      values.emplace_back();  // One by one: a wrong count is limited by the end of the bytes.
      pass(archive, values.back());
    }
  } else {
    for (T& value : values) {
      pass(archive, value);
    }
  }
}

void join(TopicReport& into, TopicReport&& topic) {
  into.type = into.type.empty() ? topic.type : into.type;
  const std::uint64_t known = std::min(topic.replayed, into.replayed);
  const double share = topic.published == 0 ? 0.0
                                            : static_cast<double>(topic.published - known) /
                                                  static_cast<double>(topic.published);
  into.published += topic.published - known;
  into.replayed = std::max(topic.replayed, into.replayed);
  into.allocated += topic.allocated;
  into.rate_hz += topic.rate_hz * share;
  std::ranges::move(topic.offered, std::back_inserter(into.offered));
  std::ranges::move(topic.subscribers, std::back_inserter(into.subscribers));
}

// All have the streams of the recording; a process may be fed fewer of them than another.
void join(ReplayReport& into, ReplayReport&& replay) {
  into.worst_lateness_us = std::max(into.worst_lateness_us, replay.worst_lateness_us);
  for (std::size_t i = 0; i < std::min(into.streams.size(), replay.streams.size()); ++i) {
    ReplayReport::Stream& known = into.streams[i];
    ReplayReport::Stream& stream = replay.streams[i];
    const bool is_fed = !stream.component.empty();
    if (is_fed && (known.component.empty() || stream.messages > known.messages)) {
      known = std::move(stream);
    }
  }
}

}  // namespace

std::string to_bytes(const RunReport& report) {
  Writer writer;
  RunReport copy = report;
  pass(writer, copy);
  return std::move(writer.bytes);
}

RunReport report_from_bytes(std::string_view bytes) {
  Reader reader(bytes);
  RunReport report;
  pass(reader, report);
  return report;
}

namespace {

/// Adds what the components did in processes that have ended. Returns whether one of them was not
/// restarted, and so has no report of its own.
bool add_earlier_runs(RunReport& whole, const config::ApplicationDescription& application) {
  bool is_any_gone = false;
  for (EarlierRuns& runs : whole.earlier_runs) {
    auto known = std::ranges::find(whole.components, runs.component, &ComponentReport::name);
    if (known == whole.components.end()) {
      whole.components.push_back({.name = runs.component,
                                  .state = detail::ComponentCore::State::kFailed,
                                  .health = Health::kFailed,
                                  .health_reason = runs.last_end});
      known = whole.components.end() - 1;
      is_any_gone = true;
    }
    known->faults += runs.faults;
    known->fault_texts.insert(known->fault_texts.begin(), runs.last_end);
    known->restarts += runs.restarts;
    known->version.reloads += runs.reloads;
    known->version.rollbacks += runs.rollbacks;
    for (const ChainNews& before : runs.chains) {
      const auto chain = std::ranges::find(whole.chains, application.chains.at(before.chain).name,
                                           &ChainReport::name);
      if (chain != whole.chains.end()) {
        chain->count += before.count;
        chain->breaches += before.breaches;
        chain->dropped += before.dropped;
      }
    }
  }
  whole.earlier_runs.clear();
  return is_any_gone;
}

}  // namespace

RunReport put_together(std::vector<RunReport> parts,
                       const config::ApplicationDescription& application) {
  RunReport whole = std::move(parts.front());
  std::map<std::string, TopicReport> topics;
  for (TopicReport& topic : whole.topics) {
    topics[topic.name] = std::move(topic);
  }
  for (auto part = parts.begin() + 1; part != parts.end(); ++part) {
    whole.cpu_s += part->cpu_s;
    whole.rss_max_kib += part->rss_max_kib;
    if (part->startup_ms && (!whole.startup_ms || *part->startup_ms < *whole.startup_ms)) {
      whole.startup_ms = part->startup_ms;
    }
    std::ranges::move(part->components, std::back_inserter(whole.components));
    std::ranges::move(part->results, std::back_inserter(whole.results));
    std::ranges::move(part->processes, std::back_inserter(whole.processes));
    std::ranges::move(part->tools, std::back_inserter(whole.tools));
    if (part->replay && whole.replay) {
      join(*whole.replay, std::move(*part->replay));
    } else if (part->replay) {
      whole.replay = std::move(part->replay);
    }
    // Each process counts the faults in messages to its own components.
    for (const faults::FaultCount& fault : part->faults) {
      const auto known = std::ranges::find(whole.faults, fault.name, &faults::FaultCount::name);
      if (known == whole.faults.end()) {
        whole.faults.push_back(fault);
      } else if (fault.count > known->count) {
        *known = fault;
      }
    }
    for (TopicReport& topic : part->topics) {
      const auto [known, is_new] = topics.try_emplace(topic.name, topic);
      if (!is_new) {
        join(known->second, std::move(topic));
      }
    }
    for (ChainReport& chain : part->chains) {
      const auto known = std::ranges::find(whole.chains, chain.name, &ChainReport::name);
      if (known == whole.chains.end()) {
        whole.chains.push_back(std::move(chain));
      } else if (chain.count > known->count) {  // It is judged where it ends.
        *known = std::move(chain);
      }
    }
  }
  const bool is_any_gone = add_earlier_runs(whole, application);
  whole.topics.clear();
  for (auto& [name, topic] : topics) {
    for (const SubscriberReport& subscriber : topic.subscribers) {
      if (is_any_gone) {  // Its process does not report what it published.
        topic.published = std::max(topic.published, subscriber.ledger.published);
      }
    }
    topic.rate_hz = whole.time_s > 0 ? static_cast<double>(topic.published) / whole.time_s : 0.0;
    if (topic.published > 0 || !topic.subscribers.empty()) {
      whole.topics.push_back(std::move(topic));
    }
  }
  const auto place = [&](const std::string& component) {
    return std::ranges::find(application.components, component,
                             &config::ComponentDescription::name) -
           application.components.begin();
  };
  std::ranges::sort(whole.components, {},
                    [&](const ComponentReport& component) { return place(component.name); });
  std::ranges::sort(whole.results, {}, [&](const ResultReport& result) {
    return std::pair(place(result.component), result.name);
  });
  return whole;
}

}  // namespace fastcycle::host
