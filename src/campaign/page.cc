#include "campaign/page.h"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

#include "base/html.h"

namespace fastcycle::campaign {
namespace {

using base::to_html;

constexpr std::string_view kStyle = R"(
:root { color-scheme: light dark; --fg: #1a1a1a; --bg: #fff; --dim: #767676; --line: #ddd;
  --pass: #2a78b8; --fail: #c8341f; }
@media (prefers-color-scheme: dark) {
  :root { --fg: #e8e8e8; --bg: #16181b; --dim: #9a9a9a; --line: #3a3d42; --pass: #6ab0e6;
    --fail: #ff7a63; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--fg); background: var(--bg);
  max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid var(--line); text-align: right; }
th:first-child, td:first-child { text-align: left; }
td.failed { color: var(--fail); font-weight: 600; }
pre { background: color-mix(in srgb, var(--fg) 7%, transparent); padding: .7rem; overflow-x: auto; }
.scroll { overflow-x: auto; }
svg text { fill: var(--fg); font: 12px system-ui, sans-serif; }
svg .axis { stroke: var(--line); }
svg .pass { fill: none; stroke: var(--pass); opacity: .55; }
svg .fail { stroke: var(--fail); stroke-width: 2; }
)";

/// Each fault of each seed: a circle where it passed, a cross where it failed.
std::string map_of(const Summary& summary, const FaultTable& table) {
  constexpr double kLeft = 260;
  constexpr double kWidth = 760;
  constexpr double kRow = 34;
  const double span =
      table.width_s * static_cast<double>(table.rows.empty() ? 1 : table.rows.front().cells.size());
  const double height = kRow * static_cast<double>(table.rows.size()) + 30;
  std::string svg = fmt::format(
      "<div class=\"scroll\"><svg role=\"img\" aria-label=\"What failed when\" width=\"{}\" "
      "height=\"{}\">\n",
      kLeft + kWidth + 20, height);
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const double y = kRow * (static_cast<double>(i) + 0.5);
    svg += fmt::format(
        "<text x=\"0\" y=\"{:.1f}\">{}</text><line class=\"axis\" x1=\"{}\" x2=\"{}\" "
        "y1=\"{:.1f}\" "
        "y2=\"{:.1f}\"/>\n",
        y + 4, to_html(table.rows[i].name), kLeft, kLeft + kWidth, y, y);
  }
  for (const bool is_failing : {false, true}) {
    for (const SeedResult& result : summary.results) {
      if (result.way.empty() == is_failing) {
        continue;
      }
      for (const DrawnFault& fault : result.faults) {
        const std::string name = fault.json.value("kind", "") + " " + target_of(fault.json);
        const auto row = std::ranges::find(table.rows, name, &FaultTable::Row::name);
        // Seeds of one time stand above each other, as far as there is room.
        const double shift = static_cast<double>(result.seed * 7 % 23) - 11;
        const double y = kRow * (static_cast<double>(row - table.rows.begin()) + 0.5) + shift;
        const double x = kLeft + (fault.json.value("from_s", 0.0) - table.begin_s) / span * kWidth;
        const std::string title =
            to_html(fmt::format("seed {}: {}{}{}", result.seed, in_words(fault.json),
                                is_failing ? ": " : "", result.how));
        svg += is_failing ? fmt::format(
                                "<path class=\"fail\" d=\"M{:.1f} {:.1f}l6 6m0 -6l-6 6\">"
                                "<title>{}</title></path>\n",
                                x - 3, y - 3, title)
                          : fmt::format(
                                "<circle class=\"pass\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\">"
                                "<title>{}</title></circle>\n",
                                x, y, title);
      }
    }
  }
  const std::size_t columns = table.rows.empty() ? 0 : table.rows.front().cells.size();
  for (std::size_t i = 0; i <= columns && columns > 0; i += 2) {
    const double time = table.begin_s + static_cast<double>(i) * table.width_s;
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{:.1f} s</text>\n",
                       kLeft + static_cast<double>(i) / static_cast<double>(columns) * kWidth - 10,
                       height - 8, time);
  }
  return svg + "</svg></div>\n";
}

std::string table_of(const FaultTable& table) {
  std::string html = "<div class=\"scroll\"><table><tr><th>fault</th><th>failed / ran</th>";
  const std::size_t columns = table.rows.empty() ? 0 : table.rows.front().cells.size();
  for (std::size_t i = 0; i < columns; ++i) {
    html += fmt::format("<th>from {:.1f} s</th>",
                        table.begin_s + static_cast<double>(i) * table.width_s);
  }
  html += "</tr>\n";
  const auto cell_of = [](const FaultTable::Cell& cell) {
    return cell.ran == 0
               ? std::string("<td>–</td>")
               : fmt::format("<td{}>{} / {}</td>", cell.failed > 0 ? " class=\"failed\"" : "",
                             cell.failed, cell.ran);
  };
  for (const FaultTable::Row& row : table.rows) {
    html += "<tr><td>" + to_html(row.name) + "</td>" + cell_of(row.all);
    for (const FaultTable::Cell& cell : row.cells) {
      html += cell_of(cell);
    }
    html += "</tr>\n";
  }
  return html + "</table></div>\n";
}

}  // namespace

std::string to_page(const Summary& summary) {
  const FaultTable table = make_table(summary);
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width\">"
      "<title>Fault campaign of {0}</title><style>{1}</style></head><body>\n"
      "<h1>Fault campaign of {0}</h1>\n<p>{2} of {3} seeds failed. Judged by ",
      to_html(summary.application), kStyle, summary.failed(), summary.results.size());
  for (std::size_t i = 0; i < summary.judges.size(); ++i) {
    html += (i == 0 ? "<code>" : ", <code>") + to_html(summary.judges[i]) + "</code>";
  }
  html +=
      ".</p>\n<h2>What failed when</h2>\n<p>Each fault of each seed stands where it began: a "
      "circle, or a cross if the seed failed.</p>\n";
  html += map_of(summary, table) + table_of(table);
  if (!summary.failures.empty()) {
    html += "<h2>Smallest failures</h2>\n";
  }
  for (std::size_t i = 0; i < summary.failures.size(); ++i) {
    const Failure& failure = summary.failures[i];
    html += fmt::format("<h3>{}. {}</h3>\n<ul>\n", i + 1, to_html(failure.how));
    if (failure.faults.empty()) {
      html += fmt::format("<li>{}</li>\n", kWithoutFaults);
    }
    for (const DrawnFault& fault : failure.faults) {
      html += "<li>" + to_html(in_words(fault.json)) + "</li>\n";
    }
    html += "</ul>\n<pre>" + to_html(failure.command) + "</pre>\n";
  }
  return html + "</body></html>\n";
}

}  // namespace fastcycle::campaign
