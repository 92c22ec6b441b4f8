#include "campaign/summary.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "base/html.h"
#include "base/printable.h"

namespace fastcycle::campaign {
namespace {

using nlohmann::ordered_json;

ordered_json json_of(const std::vector<DrawnFault>& faults) {
  auto list = ordered_json::array();
  for (const DrawnFault& fault : faults) {
    list.push_back(fault.json);
  }
  return list;
}

/// Equal for failures of one kind.
std::string signature(const Failure& failure) {
  std::vector<std::string> parts;
  for (const DrawnFault& fault : failure.faults) {
    parts.push_back(fmt::format(
        "{} {} {} {} {} {}", fault.json.value("kind", ""), target_of(fault.json),
        fault.json.value("subscriber", ""), fault.json.value("field", ""),
        fault.json.value("as", ""),
        fault.json.contains("messages") ? fault.json["messages"].size() : std::size_t{0}));
  }
  std::ranges::sort(parts);
  return failure.way + "\n" + fmt::format("{}", fmt::join(parts, "\n"));
}

std::string dumped(const ordered_json& json) {
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

/// XML has no place for control characters.
std::string to_xml(std::string_view text) {
  return base::to_html(base::on_one_line(std::string(text)));
}

}  // namespace

std::string to_line(const SeedResult& result) {
  ordered_json faults = ordered_json::array();
  for (const DrawnFault& fault : result.faults) {
    faults.push_back({{"source", fault.source}, {"fault", fault.json}});
  }
  return dumped({{"seed", result.seed},
                 {"way", result.way},
                 {"how", result.how},
                 {"wall_s", result.wall_s},
                 {"faults", std::move(faults)}});
}

SeedResult result_of(const std::string& line) {
  const ordered_json json = ordered_json::parse(line);
  SeedResult result{.seed = json.at("seed"),
                    .faults = {},
                    .way = json.at("way"),
                    .how = json.at("how"),
                    .wall_s = json.at("wall_s")};
  for (const ordered_json& fault : json.at("faults")) {
    result.faults.push_back({fault.at("fault"), fault.at("source")});
  }
  return result;
}

bool is_alike(const Failure& one, const Failure& other) {
  return signature(one) == signature(other);
}

bool fails_without_faults(const std::string& way, const std::vector<Failure>& failures) {
  return std::ranges::any_of(
      failures, [&](const Failure& one) { return one.faults.empty() && one.way == way; });
}

std::string target_of(const ordered_json& fault) {
  return fault.value("topic", fault.value("component", fault.value("process", "")));
}

std::string in_words(const ordered_json& fault) {
  std::string text = fault.value("kind", "") + " " + target_of(fault);
  if (fault.contains("subscriber")) {
    text += " for " + fault.value("subscriber", "");
  }
  if (fault.contains("field")) {
    text += " " + fault.value("field", "") + " as " + fault.value("as", "");
    if (fault.contains("value")) {
      text += " " + dumped(fault["value"]);
    }
  }
  if (fault.contains("by_ms")) {
    text += fmt::format(" by {} ms", fault["by_ms"].get<double>());
  }
  if (fault.contains("by_mb")) {
    text += fmt::format(" of {} MB", fault["by_mb"].get<std::uint64_t>());
  }
  if (fault.contains("messages")) {
    text += fault["messages"].size() == 1 ? ", message" : ", messages";
    for (std::size_t i = 0; i < std::min<std::size_t>(fault["messages"].size(), 12); ++i) {
      text += " " + dumped(fault["messages"][i]);
    }
    text += fault["messages"].size() > 12
                ? fmt::format(" and {} more", fault["messages"].size() - 12)
                : "";
  }
  if (fault.contains("from_s")) {
    text += fmt::format(", from {} s", fault["from_s"].get<double>());
  }
  if (fault.contains("to_s")) {
    text += fmt::format(" to {} s", fault["to_s"].get<double>());
  }
  if (fault.contains("probability")) {
    text += fmt::format(", probability {}", fault["probability"].get<double>());
  }
  return text;
}

std::size_t Summary::failed() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(results, [](const SeedResult& one) { return !one.way.empty(); }));
}

FaultTable make_table(const Summary& summary, std::size_t columns) {
  FaultTable table;
  double first = std::numeric_limits<double>::max();
  double last = 0;
  for (const SeedResult& result : summary.results) {
    for (const DrawnFault& fault : result.faults) {
      first = std::min(first, fault.json.value("from_s", 0.0));
      last = std::max(last, fault.json.value("from_s", 0.0));
    }
  }
  table.begin_s = std::min(first, last);
  table.width_s = std::max((last - table.begin_s) / static_cast<double>(columns), 1e-3);
  std::map<std::string, FaultTable::Row> rows;
  for (const SeedResult& result : summary.results) {
    for (const DrawnFault& fault : result.faults) {
      const std::string name = fault.json.value("kind", "") + " " + target_of(fault.json);
      FaultTable::Row& row = rows[name];
      row.name = name;
      row.cells.resize(columns);
      const double place = (fault.json.value("from_s", 0.0) - table.begin_s) / table.width_s;
      FaultTable::Cell& cell = row.cells[std::min(static_cast<std::size_t>(place), columns - 1)];
      for (FaultTable::Cell* const one : {&cell, &row.all}) {
        ++one->ran;
        one->failed += result.way.empty() ? 0 : 1;
      }
    }
  }
  for (auto& [name, row] : rows) {
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string to_text(const Summary& summary) {
  std::string text = fmt::format("{} of {} seeds failed", summary.failed(), summary.results.size());
  if (summary.results.size() < summary.seeds) {
    text += fmt::format(" (of {} that were asked for)", summary.seeds);
  }
  if (!summary.results.empty()) {
    text += fmt::format(", {:.3f} s a seed",
                        summary.wall_s / static_cast<double>(summary.results.size()));
  }
  text += "\n\n";
  const FaultTable table = make_table(summary);
  std::size_t width = 5;
  for (const FaultTable::Row& row : table.rows) {
    width = std::max(width, row.name.size());
  }
  const auto shown = [](const FaultTable::Cell& cell) {
    return cell.ran == 0 ? std::string("-") : fmt::format("{}/{}", cell.failed, cell.ran);
  };
  text += fmt::format("{:<{}}  {:>9}", "FAULT", width, "FAILED/RAN");
  for (std::size_t i = 0; !table.rows.empty() && i < table.rows.front().cells.size(); ++i) {
    text += fmt::format(
        "  {:>7}", fmt::format("{:.1f} s", table.begin_s + static_cast<double>(i) * table.width_s));
  }
  text += "\n";
  for (const FaultTable::Row& row : table.rows) {
    text += fmt::format("{:<{}}  {:>10}", row.name, width, shown(row.all));
    for (const FaultTable::Cell& cell : row.cells) {
      text += fmt::format("  {:>7}", shown(cell));
    }
    text += "\n";
  }
  for (std::size_t i = 0; i < summary.failures.size(); ++i) {
    const Failure& failure = summary.failures[i];
    text += fmt::format("\nfailure {}: {} (seed {}, {} runs to shrink it{})\n", i + 1, failure.how,
                        failure.seed, failure.runs,
                        failure.is_smallest ? "" : "; it may become smaller still");
    if (failure.faults.empty()) {
      text += fmt::format("  {}\n", kWithoutFaults);
    }
    for (const DrawnFault& fault : failure.faults) {
      text += "  " + in_words(fault.json) + "\n";
    }
    text += "  " + failure.command + "\n";
    if (!failure.log.empty()) {
      text += "  log: " + failure.log + "\n";
    }
  }
  return text;
}

ordered_json to_json(const Summary& summary) {
  auto results = ordered_json::array();
  for (const SeedResult& result : summary.results) {
    results.push_back({{"seed", result.seed},
                       {"passed", result.way.empty()},
                       {"way", result.way},
                       {"how", result.how},
                       {"wall_s", result.wall_s},
                       {"faults", json_of(result.faults)}});
  }
  auto failures = ordered_json::array();
  for (const Failure& failure : summary.failures) {
    failures.push_back({{"seed", failure.seed},
                        {"way", failure.way},
                        {"how", failure.how},
                        {"faults", json_of(failure.faults)},
                        {"fails_without_faults", failure.faults.empty()},
                        {"runs", failure.runs},
                        {"is_smallest", failure.is_smallest},
                        {"overlay", failure.overlay},
                        {"log", failure.log},
                        {"command", failure.command}});
  }
  return {{"application", summary.application}, {"plan", summary.plan},
          {"judges", summary.judges},           {"seeds", summary.seeds},
          {"ran", summary.results.size()},      {"failed", summary.failed()},
          {"wall_s", summary.wall_s},           {"failures", std::move(failures)},
          {"results", std::move(results)}};
}

std::string to_junit(const Summary& summary) {
  std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  text += fmt::format(
      "<testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"0\" skipped=\"{}\" "
      "time=\"{:.3f}\">\n",
      to_xml("campaign of " + summary.application), summary.seeds, summary.failed(),
      summary.seeds - std::min<std::uint64_t>(summary.seeds, summary.results.size()),
      summary.wall_s);
  for (const SeedResult& result : summary.results) {
    text += fmt::format("  <testcase classname=\"campaign\" name=\"seed {}\" time=\"{:.3f}\"",
                        result.seed, result.wall_s);
    if (result.way.empty()) {
      text += "/>\n";
      continue;
    }
    std::string message = result.how;
    if (fails_without_faults(result.way, summary.failures)) {
      message += fmt::format("; {}", kWithoutFaults);
    }
    text += fmt::format(">\n    <failure message=\"{}\">", to_xml(message));
    for (const DrawnFault& fault : result.faults) {
      text += to_xml(in_words(fault.json)) + "\n";
    }
    text += "</failure>\n  </testcase>\n";
  }
  return text + "</testsuite>\n";
}

}  // namespace fastcycle::campaign
