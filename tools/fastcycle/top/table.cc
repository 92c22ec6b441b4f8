#include "top/table.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "top/text.h"

namespace fastcycle::tool::top {
namespace {

constexpr double kNoNumber = -1;  // Sorted behind all that there can be.

Field text_field(std::string text, Tone tone = Tone::kPlain) {
  return {std::move(text), 0, tone};
}

/// Nothing is shown quietly: what happens stands out.
Field number_field(double number, std::string text) {
  return {std::move(text), number, number > 0 ? Tone::kPlain : Tone::kQuiet};
}

Field optional_field(std::optional<double> number, std::string (*text)(double)) {
  return number ? number_field(*number, text(*number)) : Field{"-", kNoNumber, Tone::kQuiet};
}

Field time_field(const std::optional<Times>& times, double Times::* which) {
  return times ? number_field((*times).*which, time_text((*times).*which))
               : Field{"-", kNoNumber, Tone::kQuiet};
}

/// A count of what should not happen.
Field alarm_field(std::uint64_t count, Tone tone) {
  return {count_text(count), static_cast<double>(count), count > 0 ? tone : Tone::kQuiet};
}

Field state_field(const ComponentRow& row) {
  if (row.state == "failed") {
    return text_field(row.state, Tone::kBad);
  }
  if (row.state == "active" && !row.health.empty() && row.health != "ok") {
    return text_field(row.health, row.health == "failed" ? Tone::kBad : Tone::kWarning);
  }
  const Tone tone = row.state == "active"       ? Tone::kGood
                    : row.state == "restarting" ? Tone::kWarning
                                                : Tone::kQuiet;
  return text_field(row.state, tone);
}

Field cpu_field(const std::optional<double>& percent) {
  Field field = optional_field(percent, percent_text);
  if (percent && *percent >= 50) {
    field.tone = *percent >= 90 ? Tone::kBad : Tone::kWarning;
  }
  return field;
}

std::string drops_text(const Drops& drops) {
  std::string text;
  for (const auto& [reason, count] : drops) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", reason, count_text(count));
  }
  return text;
}

Field queue_field(const TopicRow& row) {
  if (row.depth == 0) {
    return {"-", kNoNumber, Tone::kQuiet};
  }
  const double share = static_cast<double>(row.queued) / static_cast<double>(row.depth);
  const Tone tone = share >= 1       ? Tone::kBad
                    : share >= 0.5   ? Tone::kWarning
                    : row.queued > 0 ? Tone::kPlain
                                     : Tone::kQuiet;
  return {fmt::format("{}/{}", count_text(row.queued), count_text(row.depth)), share, tone};
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(c < 0x80 ? std::tolower(c) : c); });
  return text;
}

}  // namespace

Table component_table(const Model& model) {
  Table table;
  table.headings = {{"COMPONENT", "its name", 14, 0, true},
                    {"STATE", "state, or health if not ok", 10, 0, true},
                    {"EXECUTOR", "executor that serves it", 9, 6, true},
                    {"CPU%", "time in its callbacks, share of one CPU", 5, 0, false},
                    {"ACT/s", "activations a second", 6, 1, false},
                    {"P50", "callback time, median since the start", 6, 3, false},
                    {"P99", "callback time, 99th percentile", 6, 0, false},
                    {"MAX", "callback time, longest", 6, 2, false},
                    {"LATE99", "lateness of its timers, 99th percentile", 7, 2, false},
                    {"LATEMX", "lateness of its timers, maximum", 7, 7, false},
                    {"QUEUED", "messages waiting for it", 7, 5, false},
                    {"OVERR", "ticks of its timers that were skipped", 6, 5, false},
                    {"FAULT", "exceptions and other faults", 6, 1, false},
                    {"RST", "restarts after a fault", 4, 2, false},
                    {"REMARK", "reported health, else its last fault", 16, 8, true}};
  for (const ComponentRow& row : model.components) {
    table.lines.push_back(
        {row.name,
         {text_field(row.name), state_field(row), text_field(row.executor),
          cpu_field(row.cpu_percent), optional_field(row.activations_hz, rate_text),
          time_field(row.callback, &Times::p50_ns), time_field(row.callback, &Times::p99_ns),
          time_field(row.callback, &Times::max_ns), time_field(row.lateness, &Times::p99_ns),
          time_field(row.lateness, &Times::max_ns),
          number_field(static_cast<double>(row.queued), count_text(row.queued)),
          alarm_field(row.overruns, Tone::kWarning), alarm_field(row.faults, Tone::kBad),
          alarm_field(row.restarts, Tone::kWarning), text_field(row.remark, Tone::kWarning)}});
  }
  return table;
}

Table topic_table(const Model& model) {
  Table table;
  table.headings = {
      {"TOPIC", "its name", 18, 0, true},
      {"TYPE", "of its messages", 20, 9, true},
      {"RATE", "messages a second", 6, 0, false},
      {"BYTES/s", "serialized size times rate, if a recorder or tool measured it", 8, 3, false},
      {"P50", "latency to the callback of its slowest subscriber, median", 6, 2, false},
      {"P99", "the same, 99th percentile", 6, 0, false},
      {"MAX", "the same, longest", 6, 5, false},
      {"SUBS", "subscribers", 4, 6, false},
      {"QUEUE", "messages in its fullest queue / its depth", 9, 1, false},
      {"LOST", "messages dropped, sum of all subscribers", 6, 0, false},
      {"LOST/s", "messages dropped a second", 7, 7, false},
      {"REASONS", "drops, by reason", 12, 1, true}};
  for (const TopicRow& row : model.topics) {
    Field lost_now = optional_field(row.dropped_hz, rate_text);
    lost_now.tone = lost_now.number > 0 ? Tone::kBad : Tone::kQuiet;
    table.lines.push_back(
        {row.name,
         {text_field(row.name, row.is_service ? Tone::kQuiet : Tone::kPlain),
          text_field(row.type, Tone::kQuiet), optional_field(row.rate_hz, rate_text),
          optional_field(row.bytes_per_s, size_text), time_field(row.latency, &Times::p50_ns),
          time_field(row.latency, &Times::p99_ns), time_field(row.latency, &Times::max_ns),
          number_field(static_cast<double>(row.subscribers.size()),
                       count_text(row.subscribers.size())),
          queue_field(row), alarm_field(row.dropped, Tone::kBad), std::move(lost_now),
          text_field(drops_text(row.drops), Tone::kBad)}});
  }
  return table;
}

Table chain_table(const Model& model) {
  Table table;
  table.headings = {{"CHAIN", "its name", 12, 0, true},
                    {"FROM", "first topic", 12, 9, true},
                    {"TO", "last topic", 12, 9, true},
                    {"DEADLN", "maximum age of a message at the end", 7, 1, false},
                    {"P50", "age at the end, median since the start", 6, 3, false},
                    {"P99", "age at the end, 99th percentile", 6, 0, false},
                    {"MAX", "age at the end, maximum", 6, 2, false},
                    {"COUNT", "messages that were checked", 6, 4, false},
                    {"BREACH", "messages that exceeded the maximum age", 7, 0, false},
                    {"BRCH/s", "the same, a second", 7, 5, false},
                    {"ON", "action on a breach", 7, 7, true},
                    {"DROPPED", "messages dropped because of a breach", 8, 6, false},
                    {"CONTRIBUTOR", "hop that causes most breaches", 16, 0, true}};
  for (const ChainRow& row : model.chains) {
    Field breaches_now = optional_field(row.breaches_hz, rate_text);
    breaches_now.tone = breaches_now.number > 0 ? Tone::kBad : Tone::kQuiet;
    Field longest = time_field(row.age, &Times::max_ns);
    Field usual = time_field(row.age, &Times::p99_ns);
    longest.tone = longest.number > row.deadline_ns ? Tone::kBad : longest.tone;
    usual.tone = usual.number > row.deadline_ns ? Tone::kBad : usual.tone;
    table.lines.push_back(
        {row.name,
         {text_field(row.name), text_field(row.from, Tone::kQuiet),
          text_field(row.to, Tone::kQuiet),
          number_field(row.deadline_ns, time_text(row.deadline_ns)),
          time_field(row.age, &Times::p50_ns), std::move(usual), std::move(longest),
          number_field(static_cast<double>(row.count), count_text(row.count)),
          alarm_field(row.breaches, Tone::kBad), std::move(breaches_now),
          text_field(row.on_breach, Tone::kQuiet), alarm_field(row.dropped, Tone::kBad),
          text_field(row.contributor, Tone::kBad)}});
  }
  return table;
}

Table process_table(const Model& model) {
  Table table;
  table.headings = {{"PROCESS", "its name", 14, 0, true},
                    {"PID", "its number", 8, 0, false},
                    {"CPU%", "time of all its threads, share of one CPU", 5, 0, false},
                    {"RSS", "resident memory; shared messages count in each process", 7, 0, false},
                    {"THREADS", "threads", 7, 2, false},
                    {"FILES", "open descriptors", 6, 3, false},
                    {"COMPONENTS", "components that run in it", 16, 1, true}};
  for (const ProcessRow& row : model.processes) {
    std::uint64_t threads = 0;
    for (const ThreadRow& thread : row.threads) {
      threads += thread.count;
    }
    std::string components;
    for (const std::string& component : row.components) {
      components += (components.empty() ? "" : ", ") + component;
    }
    table.lines.push_back(
        {row.name,
         {text_field(row.name),
          {fmt::format("{}", row.pid), static_cast<double>(row.pid), Tone::kQuiet},
          cpu_field(row.cpu_percent),
          number_field(row.rss_bytes, size_text(row.rss_bytes)),
          number_field(static_cast<double>(threads), count_text(threads)),
          row.open_files == 0
              ? Field{"-", kNoNumber, Tone::kQuiet}
              : number_field(static_cast<double>(row.open_files), count_text(row.open_files)),
          text_field(std::move(components), Tone::kQuiet)}});
  }
  return table;
}

void keep_matching(Table& table, const std::string& filter) {
  if (filter.empty()) {
    return;
  }
  const std::string wanted = lower(filter);
  std::erase_if(table.lines, [&](const Line& line) {
    for (std::size_t i = 0; i < line.fields.size(); ++i) {
      if (table.headings[i].is_text &&
          lower(line.fields[i].text).find(wanted) != std::string::npos) {
        return false;
      }
    }
    return true;
  });
}

void sort_by(Table& table, std::size_t column, bool is_reversed) {
  if (column >= table.headings.size()) {
    return;
  }
  const bool is_text = table.headings[column].is_text;
  const auto comes_first = [&](const Line& a, const Line& b) {
    const Field& left = a.fields[column];
    const Field& right = b.fields[column];
    return is_text ? left.text < right.text : left.number > right.number;
  };
  std::vector<std::size_t> order(table.lines.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) {
    const Line& first = table.lines[is_reversed ? b : a];
    const Line& second = table.lines[is_reversed ? a : b];
    // Equal lines keep their order.
    return comes_first(first, second) || (!comes_first(second, first) && a < b);
  });
  std::vector<Line> lines;
  lines.reserve(order.size());
  for (const std::size_t line : order) {
    lines.push_back(std::move(table.lines[line]));
  }
  table.lines = std::move(lines);
}

std::vector<std::size_t> columns_that_fit(const Table& table, int width) {
  std::vector<std::size_t> columns(table.headings.size());
  std::iota(columns.begin(), columns.end(), std::size_t{0});
  const auto wanted = [&] {
    int sum = -1;
    for (const std::size_t column : columns) {
      sum += table.headings[column].width + 1;
    }
    return sum;
  };
  while (wanted() > width && columns.size() > 1) {
    // The last of those with the largest rank; in the end the last of all.
    auto least = columns.end() - 1;
    for (auto column = columns.begin(); column != columns.end(); ++column) {
      if (table.headings[*column].rank >= table.headings[*least].rank &&
          (table.headings[*column].rank > table.headings[*least].rank || column > least)) {
        least = column;
      }
    }
    columns.erase(least);
  }
  return columns;
}

}  // namespace fastcycle::tool::top
