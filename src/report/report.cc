#include "report/report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "base/printable.h"
#include "component/peers.h"
#include "component/words.h"
#include "host/callbacks.h"
#include "replay/replay.h"

namespace fastcycle::host {

using base::HistogramSummary;
using detail::ComponentCore;
using detail::DropReason;
using nlohmann::ordered_json;

namespace {

double seconds(Duration span) {
  return std::chrono::duration<double>(span).count();
}

// ---- Reading the application ----

std::int64_t clock_ns(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

/// Start time of the process, in nanoseconds of CLOCK_BOOTTIME, to 10 ms; none if unknown.
std::optional<std::int64_t> process_start_ns() {
  std::ifstream file("/proc/self/stat");
  std::string text;
  std::getline(file, text);
  // The program's name is in brackets and may contain anything. The start time is field 22, counted
  // from 1; field 3 follows the name.
  const auto name_end = text.rfind(')');
  if (name_end == std::string::npos) {
    return std::nullopt;
  }
  std::istringstream fields(text.substr(name_end + 1));
  std::string skipped;
  for (int field = 3; field < 22; ++field) {
    fields >> skipped;
  }
  std::int64_t ticks = 0;
  if (!(fields >> ticks)) {
    return std::nullopt;
  }
  return ticks * (1'000'000'000 / sysconf(_SC_CLK_TCK));
}

std::optional<double> startup_ms(const detail::Topics& topics) {
  std::int64_t first_ns = std::numeric_limits<std::int64_t>::max();
  for (const auto& [name, topic] : topics.all()) {
    for (const auto& publisher : topic->publishers) {
      if (const std::int64_t ns = publisher->first_publish_ns(); ns != 0) {
        first_ns = std::min(first_ns, ns);
      }
    }
  }
  const auto start_ns = process_start_ns();
  if (!start_ns || first_ns == std::numeric_limits<std::int64_t>::max()) {
    return std::nullopt;
  }
  // The two clocks differ by the time that the machine slept.
  const std::int64_t slept_ns = clock_ns(CLOCK_BOOTTIME) - clock_ns(CLOCK_MONOTONIC);
  return static_cast<double>(first_ns + slept_ns - *start_ns) / 1e6;
}

double cpu_seconds(const rusage& usage) {
  const auto seconds_of = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
  };
  return seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
}

ComponentReport report_component(const ComponentCore& core, const Modes& modes,
                                 const std::vector<KnownCallback>& callbacks) {
  ComponentReport report;
  report.name = core.name;
  report.state = core.state.load();
  report.activations = core.statistics.activations.get();
  report.callback = core.statistics.callback.summary();
  for (const KnownCallback& callback : callbacks) {
    report.callbacks.push_back(
        {.name = callback.name, .kind = callback.kind, .time = callback.run_time->summary()});
  }
  report.timer_lateness = core.statistics.lateness.summary();
  report.overruns = core.statistics.overruns.get();
  report.is_stuck = core.is_stuck;
  if (core.is_left_alone) {
    return report;  // The rest belongs to its worker, which may still be running.
  }
  report.faults = core.fault_count;
  report.fault_texts = core.faults;
  report.restarts = core.renewals();
  report.version = core.versions->news();
  if (modes.is_switched(core.index)) {
    report.was_active = core.was_active_at_end;
  }
  report.health = core.health;
  report.health_reason = core.health_reason;
  return report;
}

/// Whether the component only follows another process here, which then reports it.
bool only_follows(const Peers* peers, const std::string& component) {
  return peers != nullptr && peers->runs_here(component) &&
         !peers->is_here(peers->process_of(component));
}

TopicReport report_topic(const detail::Topic& topic, double time_s,
                         const Application& application) {
  const Peers* const peers = application.peers();
  TopicReport report;
  report.name = topic.name;
  report.type = topic.type;
  for (const auto& publisher : topic.publishers) {
    // Else the publisher's process reports it.
    if (!publisher->is_imported && !only_follows(peers, publisher->owner.name)) {
      report.published += publisher->published();
      report.allocated += publisher->allocated();
      if (application.is_replay() && application.is_replayed(publisher->owner.name)) {
        report.replayed += publisher->published();
      }
    }
  }
  report.rate_hz = static_cast<double>(report.published) / time_s;
  for (const auto& subscription : topic.subscriptions) {
    if (subscription->kind == detail::Subscription::Kind::kTap ||
        only_follows(peers, subscription->component)) {
      continue;  // Its deliveries and losses are reported by its owner.
    }
    report.subscribers.push_back({.component = subscription->component,
                                  .kind = subscription->kind,
                                  .depth = subscription->depth,
                                  .ledger = subscription->ledger(),
                                  .latency = subscription->latency.summary(),
                                  .unmatched = find_unmatched(*subscription)});
    if (const detail::Quality* quality = subscription->quality.get()) {
      report.subscribers.back().quality = {.deadlines_missed = quality->deadlines_missed.get(),
                                           .messages_lost = quality->messages_lost.get(),
                                           .liveliness_lost = quality->liveliness_lost.get(),
                                           .liveliness_gained = quality->liveliness_gained.get()};
    }
  }
  return report;
}

void add_offered(RunReport& report, const ComponentCore& core) {
  for (const auto& offered : core.offered) {
    const auto topic =
        std::ranges::find(report.topics, offered->publisher.topic.name, &TopicReport::name);
    if (topic != report.topics.end()) {
      topic->offered.push_back({.component = core.name,
                                .deadline_ms = seconds(offered->period()) * 1e3,
                                .missed = offered->missed.get()});
    }
  }
}

void add_results(RunReport& report, const ComponentCore& core) {
  if (core.is_left_alone) {
    return;  // Its worker may be writing them.
  }
  for (const auto& [name, value] : core.results) {
    report.results.push_back({core.name, name, value});
  }
}

/// The results with unique names: a name that is taken gets the component's as a prefix.
std::vector<std::pair<std::string, const ReportValue*>> named(
    const std::vector<ResultReport>& results) {
  std::vector<std::pair<std::string, const ReportValue*>> all;
  std::set<std::string> taken;
  for (const ResultReport& result : results) {
    std::string name = result.name;
    while (!taken.insert(name).second) {
      name = result.component + "." + name;
    }
    all.emplace_back(std::move(name), &result.value);
  }
  return all;
}

ModesReport report_modes(const Application& application) {
  const Modes& modes = application.modes();
  ModesReport report{.at_end = modes.current(), .refused = modes.refused()};
  for (const ModeSwitch& made : modes.switches()) {
    report.switches.push_back({.time_s = seconds(made.stamp - application.start_time()),
                               .from = made.from,
                               .to = made.to,
                               .why = made.why,
                               .by = made.by});
  }
  return report;
}

ReplayReport report_replay(const Application& application, const Replay& replay) {
  ReplayReport report;
  for (const std::filesystem::path& file : replay.options().files) {
    report.files.push_back(file.string());
  }
  const Duration from = replay.begin() - replay.recording().begin();
  report.from_s = seconds(from);
  report.to_s = seconds(from + replay.length());
  if (!application.clock().is_simulated()) {
    report.worst_lateness_us = static_cast<double>(replay.worst_lateness().count()) / 1e3;
  }
  report.parted_infos = replay.recording().parted_infos();
  for (std::size_t i = 0; i < replay.plan().streams.size(); ++i) {
    const ReplayPlan::Stream& stream = replay.plan().streams[i];
    report.streams.push_back(
        {.topic = stream.topic,
         .component = stream.component,
         .reason = stream.reason,
         .messages = stream.is_fed() ? replay.fed()[i] : replay.recording().streams()[i].messages});
  }
  return report;
}

// ---- Words ----

const char* state_word(const ComponentReport& component) {
  if (component.is_replayed) {
    return "replayed";
  }
  if (component.is_stuck) {
    return "stuck";
  }
  return to_word(component.state);
}

/// Reasons for drops, with their counts.
template <typename Use>
void for_each_drop(const detail::Ledger& ledger, const Use& use) {
  for (std::size_t i = 0; i < ledger.dropped.size(); ++i) {
    if (ledger.dropped[i] > 0) {
      use(detail::to_word(static_cast<DropReason>(i)), ledger.dropped[i]);
    }
  }
}

// ---- JSON ----

ordered_json json_of(const RecordingReport& recording) {
  auto topics = ordered_json::object();
  for (const record::RecordedTopic& topic : recording.topics) {
    topics[topic.topic] = {{"published", topic.published},
                           {"recorded", topic.recorded},
                           {"bytes", topic.bytes},
                           {"lost",
                            {{"overflow", topic.overflow},
                             {"pool", topic.pool},
                             {"memory", topic.memory},
                             {"disk", topic.disk},
                             {"too_large", topic.too_large},
                             {"process", topic.process},
                             {"shutdown", topic.shutdown}}}};
  }
  return {{"files", recording.files},
          {"problem", recording.problem},
          {"activations_lost", recording.activations_lost},
          {"reads_lost", recording.reads_lost},
          {"topics", std::move(topics)}};
}

ordered_json json_of(const record::FlightDump& dump) {
  return {{"file", dump.file.string()},
          {"reason", dump.trigger.reason},
          {"component", dump.trigger.component},
          {"trigger_ns", dump.trigger.time_ns},
          {"triggers", dump.trigger_count},
          {"messages", dump.messages},
          {"missing", dump.missing},
          {"problem", dump.problem}};
}

ordered_json json_of(const record::FlightReport& flight_recorder) {
  auto dumps = ordered_json::array();
  for (const record::FlightDump& dump : flight_recorder.dumps) {
    dumps.push_back(json_of(dump));
  }
  return {{"file", flight_recorder.file.string()},
          {"capacity", flight_recorder.capacity},
          {"problem", flight_recorder.problem},
          {"messages", flight_recorder.messages},
          {"bytes", flight_recorder.bytes},
          {"lost",
           {{"overflow", flight_recorder.overflow},
            {"pool", flight_recorder.pool},
            {"too_large", flight_recorder.too_large},
            {"process", flight_recorder.process}}},
          {"activations_lost", flight_recorder.activations_lost},
          {"reads_lost", flight_recorder.reads_lost},
          {"dumps", std::move(dumps)},
          {"triggers_refused", flight_recorder.triggers_refused}};
}

/// JSON cannot represent values that are not finite.
ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json();
}

/// A time of a histogram that may be empty, in microseconds.
ordered_json microseconds(const HistogramSummary& summary, double ns) {
  return summary.count == 0 ? ordered_json() : number(ns / 1000.0);
}

ordered_json json_of_short(const HistogramSummary& summary) {
  return {{"p50", microseconds(summary, summary.p50)},
          {"p99", microseconds(summary, summary.p99)},
          {"max", microseconds(summary, summary.max)}};
}

ordered_json json_of(const HistogramSummary& summary) {
  return {{"mean", microseconds(summary, summary.mean)},
          {"std", microseconds(summary, summary.standard_deviation)},
          {"p50", microseconds(summary, summary.p50)},
          {"p99", microseconds(summary, summary.p99)},
          {"p999", microseconds(summary, summary.p999)},
          {"max", microseconds(summary, summary.max)}};
}

ordered_json json_of(const ReportValue& value) {
  return std::visit(
      [](const auto& it) -> ordered_json {
        if constexpr (std::is_same_v<std::decay_t<decltype(it)>, double>) {
          return number(it);
        } else {
          return it;
        }
      },
      value);
}

ordered_json json_of(const ReplayReport& replay) {
  auto fed = ordered_json::array();
  auto not_fed = ordered_json::array();
  for (const ReplayReport::Stream& stream : replay.streams) {
    if (stream.component.empty()) {
      not_fed.push_back(
          {{"topic", stream.topic}, {"reason", stream.reason}, {"messages", stream.messages}});
    } else {
      fed.push_back({{"topic", stream.topic},
                     {"component", stream.component},
                     {"messages", stream.messages}});
    }
  }
  return {{"files", replay.files},
          {"from_s", number(replay.from_s)},
          {"to_s", number(replay.to_s)},
          {"worst_lateness_us",
           replay.worst_lateness_us ? number(*replay.worst_lateness_us) : ordered_json()},
          {"parted_infos", replay.parted_infos},
          {"fed", std::move(fed)},
          {"not_fed", std::move(not_fed)}};
}

ordered_json json_of(const ModesReport& modes) {
  auto switches = ordered_json::array();
  for (const ModesReport::Switch& made : modes.switches) {
    switches.push_back({{"time_s", number(made.time_s)},
                        {"from", made.from},
                        {"to", made.to},
                        {"why", made.why},
                        {"by", made.by}});
  }
  return {{"at_end", modes.at_end}, {"switches", std::move(switches)}, {"refused", modes.refused}};
}

ordered_json json_of(const ProcessReport& process) {
  auto links = ordered_json::array();
  for (const ProcessReport::Link& link : process.links) {
    links.push_back({{"topic", link.topic},
                     {"to", link.to},
                     {"given", link.given},
                     {"copied", link.copied},
                     {"repaired", link.repaired},
                     {"unshared", link.unshared},
                     {"overflowed", link.overflowed},
                     {"over_quota", link.over_quota},
                     {"taken_back", link.taken_back}});
    if (!link.always_copied.empty()) {
      links.back()["always_copied"] = link.always_copied;
    }
  }
  return {
      {"cpu_s", process.has_reported ? number(process.cpu_s) : ordered_json()},
      {"rss_max_kib", process.has_reported ? ordered_json(process.rss_max_kib) : ordered_json()},
      {"restarts", process.restarts},
      {"links", std::move(links)}};
}

ordered_json json_of(const CallbackReport& callback) {
  const HistogramSummary& time = callback.time;
  return {{"name", callback.name},
          {"kind", callback.kind},
          {"count", time.count},
          {"time_us",
           {{"mean", microseconds(time, time.mean)},
            {"p50", microseconds(time, time.p50)},
            {"p99", microseconds(time, time.p99)},
            {"max", microseconds(time, time.max)}}}};
}

ordered_json json_of(const ComponentReport& component) {
  auto callbacks = ordered_json::array();
  for (const CallbackReport& callback : component.callbacks) {
    callbacks.push_back(json_of(callback));
  }
  ordered_json json = {{"state", state_word(component)},
                       {"activations", component.activations},
                       {"callback_us", json_of_short(component.callback)},
                       {"callbacks", std::move(callbacks)},
                       {"overruns", component.overruns},
                       {"faults", component.faults},
                       {"fault_texts", component.fault_texts},
                       {"restarts", component.restarts},
                       {"library", component.version.library},
                       {"build_id", component.version.build_id},
                       {"reloads", component.version.reloads},
                       {"rollbacks", component.version.rollbacks},
                       {"health", to_word(component.health)},
                       {"health_reason", component.health_reason},
                       {"timer_lateness_us", json_of_short(component.timer_lateness)}};
  if (component.was_active) {
    json["was_active"] = *component.was_active;
  }
  return json;
}

ordered_json json_of(const SubscriberReport& subscriber) {
  auto dropped = ordered_json::object();
  for_each_drop(subscriber.ledger,
                [&](const char* reason, std::uint64_t count) { dropped[reason] = count; });
  ordered_json json = {{"component", subscriber.component},
                       {"kind", to_word(subscriber.kind)},
                       {"depth", subscriber.depth},
                       {"published", subscriber.ledger.published},
                       {"delivered", subscriber.ledger.delivered},
                       {"dropped", dropped},
                       {"queued", subscriber.ledger.queued},
                       {"adds_up", subscriber.ledger.adds_up()},
                       {"latency_us", json_of(subscriber.latency)}};
  if (subscriber.quality) {
    json["quality"] = {{"deadlines_missed", subscriber.quality->deadlines_missed},
                       {"messages_lost", subscriber.quality->messages_lost},
                       {"liveliness_lost", subscriber.quality->liveliness_lost},
                       {"liveliness_gained", subscriber.quality->liveliness_gained}};
  }
  if (!subscriber.unmatched.empty()) {
    auto reasons = ordered_json::array();
    for (const UnmatchedReport& unmatched : subscriber.unmatched) {
      reasons.push_back(
          {{"reason", unmatched.reason},
           {"count", unmatched.count},
           {"topic", unmatched.topic},
           {"difference_ms",
            unmatched.difference_ms ? ordered_json(*unmatched.difference_ms) : ordered_json()},
           {"text", unmatched.text}});
    }
    json["unmatched"] = std::move(reasons);
  }
  return json;
}

ordered_json json_of(const TopicReport& topic) {
  auto subscribers = ordered_json::array();
  for (const SubscriberReport& subscriber : topic.subscribers) {
    subscribers.push_back(json_of(subscriber));
  }
  ordered_json json = {{"type", topic.type},
                       {"published", topic.published},
                       {"allocated", topic.allocated},
                       {"rate_hz", number(topic.rate_hz)},
                       {"subscribers", subscribers}};
  for (const OfferedReport& offered : topic.offered) {
    json["offered"].push_back({{"component", offered.component},
                               {"deadline_ms", number(offered.deadline_ms)},
                               {"missed", offered.missed}});
  }
  return json;
}

// ---- Text ----

constexpr std::size_t kColumns = 120;
constexpr std::size_t kNameColumns = 24;

/// The width of a UTF-8 text in columns: one per character.
std::size_t width(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
  }));
}

/// A name at most `columns` wide. Shortened in the middle: names differ at their ends.
std::string shortened(const std::string& name, std::size_t columns) {
  if (name.size() <= columns) {
    return name;
  }
  const std::size_t tail = columns / 2;
  return name.substr(0, columns - tail - 1) + "…" + name.substr(name.size() - tail);
}

/// Three significant digits.
std::string three_digits(double value) {
  std::array<char, 32> text{};
  const double size = std::abs(value);
  const int decimals = size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2;
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string time_text(double ns) {
  if (!std::isfinite(ns)) {
    return "?";
  }
  if (ns == 0) {
    return "0";
  }
  if (ns < 1e3) {
    return three_digits(ns) + " ns";
  }
  if (ns < 1e6) {
    return three_digits(ns / 1e3) + " µs";
  }
  return ns < 1e9 ? three_digits(ns / 1e6) + " ms" : three_digits(ns / 1e9) + " s";
}

std::string time_text(const HistogramSummary& summary, double ns) {
  return summary.count == 0 ? "-" : time_text(ns);
}

std::string rate_text(double hz) {
  if (!std::isfinite(hz)) {
    return "-";
  }
  return hz < 1e4 ? three_digits(hz) + " Hz" : three_digits(hz / 1e3) + " kHz";
}

std::string value_text(const ReportValue& value) {
  return std::visit(
      [](const auto& it) -> std::string {
        using Value = std::decay_t<decltype(it)>;
        if constexpr (std::is_same_v<Value, bool>) {
          return it ? "true" : "false";
        } else if constexpr (std::is_same_v<Value, std::string>) {
          return base::on_one_line(it);
        } else if constexpr (std::is_same_v<Value, double>) {
          std::array<char, 32> text{};
          std::snprintf(text.data(), text.size(), "%.6g", it);
          return text.data();
        } else {
          return std::to_string(it);
        }
      },
      value);
}

/// Rows of cells, padded to aligned columns: the first left-aligned, the others right-aligned.
class Rows {
 public:
  void add(std::vector<std::string> cells) {
    widths_.resize(std::max(widths_.size(), cells.size()));
    for (std::size_t i = 0; i < cells.size(); ++i) {
      widths_[i] = std::max(widths_[i], width(cells[i]));
    }
    rows_.push_back(std::move(cells));
  }

  [[nodiscard]] std::string line(std::size_t row) const {
    std::string text;
    for (std::size_t i = 0; i < rows_[row].size(); ++i) {
      const std::string& cell = rows_[row][i];
      const std::string padding(widths_[i] - width(cell), ' ');
      text += i == 0 ? cell + padding : "  " + padding + cell;
    }
    return text;
  }

  [[nodiscard]] std::string text() const {
    std::string text;
    for (std::size_t row = 0; row < rows_.size(); ++row) {
      text += line(row) + "\n";
    }
    return text;
  }

 private:
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::size_t> widths_;
};

/// `text` wrapped at blanks; lines after the first are indented.
std::string wrapped(std::string text, const std::string& indent) {
  std::string lines;
  while (text.size() > kColumns) {
    auto end = text.rfind(' ', kColumns);
    if (end == std::string::npos || end <= indent.size()) {
      end = kColumns;
      while ((static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) {
        --end;  // Not within a character.
      }
    }
    lines += text.substr(0, text.find_last_not_of(' ', end - 1) + 1) + "\n";
    text = indent + text.substr(text[end] == ' ' ? end + 1 : end);
  }
  return lines + text + "\n";
}

std::string head_text(const RunReport& report) {
  std::string text = report.application + ": ran " + time_text(report.time_s * 1e9);
  if (report.clock == "simulated") {
    text += " of simulated time in " + time_text(report.wall_s * 1e9);
  }
  text += ", " + report.end + "\n  ";
  if (report.startup_ms) {
    text += "first message after " + time_text(*report.startup_ms * 1e6) + "   ";
  }
  text += "CPU " + time_text(report.cpu_s * 1e9) + "   memory " +
          three_digits(static_cast<double>(report.rss_max_kib) / 1024.0) + " MiB\n";
  return text;
}

std::string components_text(const RunReport& report) {
  Rows rows;
  rows.add({"COMPONENT", "STATE", "ACTIVATIONS", "CALLBACK p50", "p99", "max", "LATE p99",
            "OVERRUNS", "FAULTS"});
  for (const ComponentReport& component : report.components) {
    const HistogramSummary& callback = component.callback;
    rows.add({shortened(component.name, kNameColumns), state_word(component),
              std::to_string(component.activations), time_text(callback, callback.p50),
              time_text(callback, callback.p99), time_text(callback, callback.max),
              time_text(component.timer_lateness, component.timer_lateness.p99),
              std::to_string(component.overruns), std::to_string(component.faults)});
  }
  return rows.text();
}

std::string troubles_text(const RunReport& report) {
  std::string text;
  for (const ComponentReport& component : report.components) {
    for (const std::string& fault : component.fault_texts) {
      text += wrapped("  fault of " + component.name + ": " + base::on_one_line(fault), "    ");
    }
    if (component.faults > component.fault_texts.size()) {
      text += "  fault of " + component.name + ": " +
              std::to_string(component.faults - component.fault_texts.size()) + " more\n";
    }
    if (component.restarts > 0) {
      text += "  " + component.name + " was restarted " + std::to_string(component.restarts) +
              (component.restarts == 1 ? " time\n" : " times\n");
    }
    if (component.version.reloads > 0) {
      text += fmt::format(
          "  {} was reloaded {} {}, and rolled back {} {}; it ran {} at the end\n", component.name,
          component.version.reloads, component.version.reloads == 1 ? "time" : "times",
          component.version.rollbacks, component.version.rollbacks == 1 ? "time" : "times",
          component.version.library);
    }
    if (component.health != Health::kOk) {
      const std::string reason = base::on_one_line(component.health_reason);
      text += wrapped("  " + component.name + " reports that it is " + to_word(component.health) +
                          (reason.empty() ? "" : ": " + reason),
                      "    ");
    }
  }
  return text;
}

std::string ledger_text(const detail::Ledger& ledger) {
  std::string text =
      std::to_string(ledger.published) + " = " + std::to_string(ledger.delivered) + " delivered";
  for_each_drop(ledger, [&](const char* reason, std::uint64_t count) {
    text += " + " + std::to_string(count) + " " + reason;
  });
  if (ledger.queued > 0) {
    text += " + " + std::to_string(ledger.queued) + " queued";
  }
  if (!ledger.adds_up()) {
    text += "  DOES NOT ADD UP";
  }
  return text;
}

std::vector<std::string> subscriber_cells(const SubscriberReport& subscriber) {
  const HistogramSummary& latency = subscriber.latency;
  std::string name = "  " + shortened(subscriber.component, kNameColumns);
  if (subscriber.kind != detail::Subscription::Kind::kCallback) {
    name += std::string(" (") + to_word(subscriber.kind) + ")";
  }
  return {name,
          time_text(latency, latency.mean),
          time_text(latency, latency.standard_deviation),
          time_text(latency, latency.p50),
          time_text(latency, latency.p99),
          time_text(latency, latency.p999),
          time_text(latency, latency.max)};
}

std::string faults_text(const std::vector<faults::FaultCount>& faults) {
  Rows rows;
  rows.add({"INJECTED FAULT", "KIND", "OF", "TIMES"});
  for (const faults::FaultCount& fault : faults) {
    rows.add({fault.name, std::string(config::to_string(fault.kind)),
              shortened(fault.target, 2 * kNameColumns), std::to_string(fault.count)});
  }
  return rows.text();
}

std::string topic_head(const TopicReport& topic) {
  const std::string numbers = "  " + rate_text(topic.rate_hz) + "  " +
                              std::to_string(topic.published) + " published  " +
                              std::to_string(topic.allocated) + " made";
  const std::size_t columns = kColumns - width(numbers);
  const std::size_t type_columns = std::min(topic.type.size(), columns / 2 - 3);
  return shortened(topic.name, columns - type_columns - 3) + " (" +
         shortened(topic.type, type_columns) + ")" + numbers + "\n";
}

/// Appends the ledger to the line if there is room, else below it.
std::string with_ledger(const std::string& line, const detail::Ledger& ledger) {
  const std::string text = ledger_text(ledger);
  if (width(line) + 3 + width(text) <= kColumns) {
    return line + "   " + text + "\n";
  }
  return line + "\n" + wrapped("      " + text, "        ");
}

/// Violations of quality of service; empty if there were none.
std::string quality_text(const SubscriberReport& subscriber) {
  if (!subscriber.quality) {
    return {};
  }
  std::string text;
  const auto add = [&](std::uint64_t count, const char* one, const char* more) {
    if (count > 0) {
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, count == 1 ? one : more);
    }
  };
  add(subscriber.quality->deadlines_missed, "deadline missed", "deadlines missed");
  add(subscriber.quality->messages_lost, "message missing", "messages missing");
  add(subscriber.quality->liveliness_lost, "time a publisher was lost",
      "times a publisher was lost");
  return text.empty() ? "" : wrapped("      " + text, "        ");
}

/// Why messages of a synchronizer found no partners; empty if all did.
std::string unmatched_text(const SubscriberReport& subscriber) {
  std::string text;
  for (const UnmatchedReport& unmatched : subscriber.unmatched) {
    text += wrapped("      " + unmatched.text, "        ");
  }
  return text;
}

std::string offered_text(const TopicReport& topic) {
  std::string text;
  for (const OfferedReport& offered : topic.offered) {
    if (offered.missed > 0) {
      text +=
          wrapped(fmt::format("  {} did not keep its deadline of {}: {} missed", offered.component,
                              time_text(offered.deadline_ms * 1e6), offered.missed),
                  "    ");
    }
  }
  return text;
}

std::string topics_text(const RunReport& report) {
  Rows rows;
  rows.add({"TOPIC", "LATENCY mean", "sd", "p50", "p99", "p99.9", "max"});
  for (const TopicReport& topic : report.topics) {
    for (const SubscriberReport& subscriber : topic.subscribers) {
      rows.add(subscriber_cells(subscriber));
    }
  }
  std::string text = rows.line(0);
  const std::string ledger = "   PUBLISHED = DELIVERED + DROPPED + QUEUED";
  text += (width(text) + width(ledger) <= kColumns ? ledger : "   LEDGER") + "\n";
  std::size_t row = 1;
  for (const TopicReport& topic : report.topics) {
    text += topic_head(topic) + offered_text(topic);
    for (const SubscriberReport& subscriber : topic.subscribers) {
      text += with_ledger(rows.line(row++), subscriber.ledger) + quality_text(subscriber) +
              unmatched_text(subscriber);
    }
  }
  return text;
}

std::string modes_text(const ModesReport& modes) {
  constexpr std::size_t kShown = 10;
  std::string text =
      fmt::format("MODE {} at the end, after {} {}\n", modes.at_end, modes.switches.size(),
                  modes.switches.size() == 1 ? "switch" : "switches");
  const std::size_t skipped =
      modes.switches.size() > kShown ? modes.switches.size() - kShown : std::size_t{0};
  if (skipped > 0) {
    text += fmt::format("  the first {} are in the report only\n", skipped);
  }
  for (std::size_t i = skipped; i < modes.switches.size(); ++i) {
    const ModesReport::Switch& made = modes.switches[i];
    std::string line =
        fmt::format("  {:.6f} s  {} → {}, requested {}", made.time_s, made.from, made.to,
                    made.by.empty() ? std::string("from outside") : "by " + made.by);
    if (!made.why.empty()) {
      line += ": " + made.why;
    }
    text += wrapped(base::on_one_line(line), "      ");
  }
  if (modes.refused > 0) {
    text += fmt::format("  {} more were refused: too many were pending\n", modes.refused);
  }
  return text;
}

/// Details of a chain beside its row; empty if there were no breaches.
std::string breaches_text(const ChainReport& chain) {
  if (!chain.is_judged) {
    return "    not checked: this replay executes too little of the chain\n";
  }
  if (chain.breaches == 0) {
    return {};
  }
  std::string text = fmt::format("    {} of {} took longer than {}", chain.breaches, chain.count,
                                 time_text(chain.deadline_ms * 1e6));
  if (chain.dropped > 0) {
    text += fmt::format(", {} dropped", chain.dropped);
  }
  if (const HopReport* hop = chain.largest_contributor()) {
    text += fmt::format("; largest contributor to {}: {}, by {}", hop->breaches(), hop->component,
                        hop->larger_part());
  }
  return wrapped(text, "      ");
}

std::string chains_text(const std::vector<ChainReport>& chains) {
  Rows rows;
  rows.add({"CHAIN", "COUNT", "AGE p50", "p99", "max", "DEADLINE", "BREACHES"});
  for (const ChainReport& chain : chains) {
    rows.add({shortened(chain.name, kNameColumns), std::to_string(chain.count),
              time_text(chain.age, chain.age.p50), time_text(chain.age, chain.age.p99),
              time_text(chain.age, chain.age.max), time_text(chain.deadline_ms * 1e6),
              std::to_string(chain.breaches)});
  }
  std::string text = rows.line(0) + "\n";
  for (std::size_t i = 0; i < chains.size(); ++i) {
    text += rows.line(i + 1) + "\n" + breaches_text(chains[i]);
  }
  return text;
}

std::string replay_text(const ReplayReport& replay) {
  std::uint64_t messages = 0;
  std::size_t fed = 0;
  for (const ReplayReport::Stream& stream : replay.streams) {
    messages += stream.component.empty() ? 0 : stream.messages;
    fed += stream.component.empty() ? 0 : 1;
  }
  std::string text =
      fmt::format("REPLAYED {} messages of {} topics, {} s to {} s of the recording", messages, fed,
                  three_digits(replay.from_s), three_digits(replay.to_s));
  if (replay.worst_lateness_us) {
    text += ", at most " + time_text(*replay.worst_lateness_us * 1e3) + " late";
  }
  text += "\n";
  for (const std::string& file : replay.files) {
    text += wrapped("  " + file, "      ");
  }
  if (const std::size_t others = replay.streams.size() - fed; others > 0) {
    text += fmt::format("  {} more {} not fed; the report says why\n", others,
                        others == 1 ? "topic was" : "topics were");
  }
  if (replay.parted_infos > 0) {
    text +=
        fmt::format("  {} messages have no round and origin: a tool moved those far behind them\n",
                    replay.parted_infos);
  }
  return text;
}

std::string reasons_text(const record::RecordedTopic& topic) {
  std::string text;
  const auto add = [&](std::uint64_t count, std::string_view reason) {
    if (count > 0) {
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, reason);
    }
  };
  add(topic.overflow, "in its queue");
  add(topic.process, "between processes");
  add(topic.pool, "by an exhausted pool");
  add(topic.memory, "because memory was full");
  add(topic.disk, "because they could not be written or their file was removed");
  add(topic.too_large, "because they were too large");
  add(topic.shutdown, "before the start or after the stop");
  return text;
}

/// What the log of the activations misses.
std::string missing_text(std::uint64_t activations, std::uint64_t reads) {
  std::string text;
  if (activations > 0) {
    text += fmt::format("  {} activations are missing: their rate was too high\n", activations);
  }
  if (reads > 0) {
    text += fmt::format(
        "  {} reads of components are missing: their rate was too high; `verify` ends there\n",
        reads);
  }
  return text;
}

std::string recording_text(const RecordingReport& recording) {
  record::RecordedTopic all;
  std::string losses;
  for (const record::RecordedTopic& topic : recording.topics) {
    all.recorded += topic.recorded;
    all.bytes += topic.bytes;
    if (topic.lost() > 0) {
      losses += wrapped(fmt::format("  {}: {} of {} lost: {}", topic.topic, topic.lost(),
                                    topic.published, reasons_text(topic)),
                        "      ");
    }
  }
  std::string text =
      fmt::format("RECORDED {} messages of {} topics, {:.1f} MB, {}\n", all.recorded,
                  recording.topics.size(), static_cast<double>(all.bytes) / 1e6,
                  losses.empty() && recording.activations_lost == 0 && recording.reads_lost == 0
                      ? "nothing lost"
                      : "with losses");
  for (const std::string& file : recording.files) {
    text += wrapped("  " + file, "      ");
  }
  if (!recording.problem.empty()) {
    text += wrapped("  incomplete: " + recording.problem, "      ");
  }
  return text + missing_text(recording.activations_lost, recording.reads_lost) + losses;
}

std::string flight_recorder_text(const record::FlightReport& flight_recorder) {
  const std::uint64_t lost = flight_recorder.overflow + flight_recorder.pool +
                             flight_recorder.too_large + flight_recorder.process;
  std::string text = fmt::format(
      "FLIGHT RECORDER kept {} messages, {:.1f} MB, in {}, {}\n", flight_recorder.messages,
      static_cast<double>(flight_recorder.bytes) / 1e6, flight_recorder.file.string(),
      lost + flight_recorder.activations_lost + flight_recorder.reads_lost == 0 ? "nothing lost"
                                                                                : "with losses");
  if (lost > 0) {
    text += fmt::format(
        "  {} lost in their queues, {} by exhausted pools, {} larger than half of the ring, {} "
        "between processes\n",
        flight_recorder.overflow, flight_recorder.pool, flight_recorder.too_large,
        flight_recorder.process);
  }
  text += missing_text(flight_recorder.activations_lost, flight_recorder.reads_lost);
  if (!flight_recorder.problem.empty()) {
    text += wrapped("  " + flight_recorder.problem, "      ");
  }
  for (const record::FlightDump& dump : flight_recorder.dumps) {
    std::string line = fmt::format("  {}: {} messages, {}", dump.file.string(), dump.messages,
                                   dump.trigger.reason);
    if (!dump.trigger.component.empty()) {
      line += " of " + dump.trigger.component;
    }
    if (!dump.problem.empty()) {
      line = "  a dump could not be written: " + dump.problem;
    }
    text += wrapped(base::on_one_line(line), "      ");
  }
  if (flight_recorder.triggers_refused > 0) {
    text += fmt::format("  {} more triggers without a dump\n", flight_recorder.triggers_refused);
  }
  return text;
}

/// Empty if it lost nothing.
std::string losses_text(const ProcessReport::Link& link) {
  std::string reasons;
  const auto add = [&](std::uint64_t count, const char* reason) {
    if (count > 0) {
      reasons += fmt::format("{}{} ({})", reasons.empty() ? "" : ", ", count, reason);
    }
  };
  add(link.overflowed, "its queue was full");
  add(link.over_quota, "it held too many");
  add(link.unshared,
      "not in shared memory, which was full, or a library has an operator new of its own");
  return reasons.empty()
             ? ""
             : fmt::format("  {}: lost on the way to process {}: {}", link.topic, link.to, reasons);
}

std::string processes_text(const std::vector<ProcessReport>& processes) {
  Rows rows;
  rows.add({"PROCESS", "CPU", "MEMORY MiB", "RESTARTS", "GIVEN", "COPIED", "LOST"});
  std::string remarks;
  for (const ProcessReport& process : processes) {
    if (!process.has_reported) {
      rows.add({shortened(process.name, kNameColumns), "-", "-", std::to_string(process.restarts),
                "-", "-", "-"});
      continue;
    }
    ProcessReport::Link all;
    std::set<std::string> reported;
    for (const ProcessReport::Link& link : process.links) {
      all.given += link.given;
      all.copied += link.copied;
      all.unshared += link.unshared + link.overflowed + link.over_quota;
      if (link.copied > 0 && reported.insert(link.topic).second) {
        // The receiver may be gone before a copy is handed over.
        const std::string count = link.copied <= link.given
                                      ? fmt::format("{} of {}", link.copied, link.given)
                                      : std::to_string(link.copied);
        remarks +=
            wrapped(fmt::format("  {}: {} messages were copied for other processes{}{}", link.topic,
                                count, link.always_copied.empty() ? "" : ": ", link.always_copied),
                    "      ");
      }
      if (const std::string losses = losses_text(link); !losses.empty()) {
        remarks += wrapped(losses, "      ");
      }
    }
    rows.add({shortened(process.name, kNameColumns), time_text(process.cpu_s * 1e9),
              three_digits(static_cast<double>(process.rss_max_kib) / 1024.0),
              std::to_string(process.restarts), std::to_string(all.given),
              std::to_string(all.copied), std::to_string(all.unshared)});
  }
  return rows.text() + remarks;
}

std::string results_text(const RunReport& report) {
  std::size_t columns = 0;
  const auto results = named(report.results);
  for (const auto& [name, value] : results) {
    columns = std::max(columns, std::min(width(name), kColumns / 2));
  }
  std::string text = "RESULTS\n";
  for (const auto& [name, value] : results) {
    const std::string shown = shortened(base::on_one_line(name), kColumns / 2);
    const std::string padding(columns - std::min(columns, width(shown)), ' ');
    text += wrapped("  " + shown + padding + "  " + value_text(*value), "      ");
  }
  return text;
}

}  // namespace

RunReport make_report(const Application& application, Duration wall) {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  RunReport report;
  report.application = application.description().name;
  report.clock = application.clock().is_simulated() ? "simulated" : "live";
  report.startup_ms = startup_ms(application.topics());
  // An application that was never started has no time.
  report.time_s = std::max(0.0, seconds(application.end_time() - application.start_time()));
  report.wall_s = seconds(wall);
  report.cpu_s = cpu_seconds(usage);
  report.rss_max_kib = usage.ru_maxrss;
  report.end = to_word(application.end_reason());
  if (!application.modes().is_empty()) {
    report.modes = report_modes(application);
  }
  report.chains = application.chains().report();
  report.earlier_runs = application.earlier_runs();
  const Replay* replay = application.replay();
  if (replay != nullptr) {
    report.replay = report_replay(application, *replay);
  }
  std::map<std::string, std::vector<KnownCallback>> callbacks;
  application.look_at_topics([&](const detail::Topics& topics) {
    callbacks = find_callbacks(topics, application.components());
  });
  const Peers* const peers = application.peers();
  for (const auto& component : application.components()) {
    if (peers != nullptr && !peers->is_here(peers->process_of(component->name))) {
      continue;
    }
    const bool is_replayed = replay != nullptr && !replay->plan().runs(component->name);
    if (is_replayed && !replay->plan().stands_in_for(component->name)) {
      continue;
    }
    report.components.push_back(
        report_component(*component, application.modes(), callbacks[component->name]));
    report.components.back().is_replayed = is_replayed;
    add_results(report, *component);
  }
  for (const auto& [name, topic] : application.topics().all()) {
    report.topics.push_back(report_topic(*topic, report.time_s, application));
  }
  for (const auto& component : application.components()) {
    add_offered(report, *component);
  }
  if (const faults::Injector* injector = application.injector()) {
    report.faults = injector->counts();
  }
  if (const record::Recorder* recorder = application.recorder()) {
    RecordingReport& recording = report.recording.emplace();
    for (const auto& file : recorder->files()) {
      recording.files.push_back(file.string());
    }
    recording.problem = recorder->problem();
    recording.activations_lost = recorder->activations_lost();
    recording.reads_lost = recorder->reads_lost();
    recording.topics = recorder->topics();
  }
  if (const record::FlightRecorder* flight_recorder = application.flight_recorder()) {
    report.flight_recorder = flight_recorder->report();
  }
  return report;
}

ordered_json to_json(const RunReport& report) {
  auto components = ordered_json::object();
  for (const ComponentReport& component : report.components) {
    components[component.name] = json_of(component);
  }
  // Not by the merged names below, which do not tell who reported a result.
  for (const ResultReport& result : report.results) {
    components[result.component]["results"][result.name] = json_of(result.value);
  }
  auto topics = ordered_json::object();
  for (const TopicReport& topic : report.topics) {
    topics[topic.name] = json_of(topic);
  }
  auto results = ordered_json::object();
  for (const auto& [name, value] : named(report.results)) {
    results[name] = json_of(*value);
  }
  ordered_json json = {
      {"application", report.application},
      {"clock", report.clock},
      {"startup_ms", report.startup_ms ? number(*report.startup_ms) : ordered_json()},
      {"time_s", number(report.time_s)},
      {"wall_s", number(report.wall_s)},
      {"cpu_s", number(report.cpu_s)},
      {"rss_max_kib", report.rss_max_kib},
      {"end", report.end},
      {"components", components},
      {"topics", topics},
      {"results", results}};
  if (report.modes) {
    json["modes"] = json_of(*report.modes);
  }
  if (!report.chains.empty()) {
    json["chains"] = to_json(report.chains);
  }
  if (report.replay) {
    json["replay"] = json_of(*report.replay);
  }
  if (report.recording) {
    json["recording"] = json_of(*report.recording);
  }
  if (report.flight_recorder) {
    json["flight_recorder"] = json_of(*report.flight_recorder);
  }
  for (const faults::FaultCount& fault : report.faults) {
    json["faults"].push_back({{"name", fault.name},
                              {"kind", config::to_string(fault.kind)},
                              {"target", fault.target},
                              {"count", fault.count},
                              {"messages", fault.messages}});
  }
  if (!report.processes.empty()) {
    auto processes = ordered_json::object();
    for (const ProcessReport& process : report.processes) {
      processes[process.name] = json_of(process);
    }
    json["processes"] = std::move(processes);
  }
  for (const ToolReport& tool : report.tools) {
    json[tool.name] = nlohmann::ordered_json::parse(tool.json);
  }
  return json;
}

std::string to_table(const RunReport& report) {
  std::string text = head_text(report) + "\n" + components_text(report) + troubles_text(report);
  if (!report.faults.empty()) {
    text += "\n" + faults_text(report.faults);
  }
  if (!report.topics.empty()) {
    text += "\n" + topics_text(report);
  }
  if (report.modes) {
    text += "\n" + modes_text(*report.modes);
  }
  if (!report.chains.empty()) {
    text += "\n" + chains_text(report.chains);
  }
  if (report.replay) {
    text += "\n" + replay_text(*report.replay);
  }
  if (report.recording) {
    text += "\n" + recording_text(*report.recording);
  }
  if (report.flight_recorder) {
    text += "\n" + flight_recorder_text(*report.flight_recorder);
  }
  if (!report.processes.empty()) {
    text += "\n" + processes_text(report.processes);
  }
  if (!report.results.empty()) {
    text += "\n" + results_text(report);
  }
  for (const ToolReport& tool : report.tools) {
    text += tool.table;
  }
  return text;
}

Progress progress_of(const Application& application) {
  Progress progress;
  progress.time = application.clock().now() - application.start_time();
  if (const Replay* replay = application.replay()) {
    progress.time = replay->position(application.clock().now());
    progress.length = replay->recording().end() - replay->recording().begin();
  }
  for (const auto& component : application.components()) {
    progress.faults += component->statistics.faults.get();
  }
  application.look_at_topics([&](const detail::Topics& topics) {
    for (const auto& [name, topic] : topics.all()) {
      for (const auto& publisher : topic->publishers) {
        progress.published += publisher->published();
      }
      for (const auto& subscription : topic->subscriptions) {
        progress.dropped += subscription->ledger().dropped_total();
      }
    }
  });
  return progress;
}

}  // namespace fastcycle::host
