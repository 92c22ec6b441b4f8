#include "bench/table.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <fmt/format.h>

namespace fastcycle::tool::bench {

namespace {

/// Columns on a terminal: bytes that continue no other.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

/// The smallest value that at least that share of the values does not exceed.
double quantile(const std::vector<double>& sorted, double share) {
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
  return sorted[std::max<std::size_t>(rank, 1) - 1];
}

}  // namespace

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

std::string size_text(std::int64_t bytes) {
  constexpr std::int64_t kKiB = 1024;
  if (bytes >= kKiB * kKiB && bytes % (kKiB * kKiB) == 0) {
    return std::to_string(bytes / kKiB / kKiB) + " MiB";
  }
  if (bytes >= kKiB && bytes % kKiB == 0) {
    return std::to_string(bytes / kKiB) + " KiB";
  }
  return std::to_string(bytes) + " B";
}

void Table::add(std::pair<std::size_t, std::size_t> place, nlohmann::json row) {
  lines_[place].push_back(std::move(row));
}

std::string Table::cell(const Column& column, const Rounds& rounds) {
  std::vector<double> values;
  for (const nlohmann::json& row : rounds) {
    const auto found = row.find(column.key);
    if (found == row.end() || found->is_null()) {
      continue;
    }
    if (found->is_string()) {
      return found->get<std::string>();
    }
    values.push_back(found->get<double>());
  }
  if (values.empty()) {
    return "-";
  }
  if (column.key == "lost" || column.key == "damaged" || column.key == "overruns") {
    double sum = 0;
    for (const double value : values) {
      sum += value;
    }
    return fmt::format("{:.0f}", sum);
  }
  const double value = median(values);
  if (column.key == "size") {
    return size_text(static_cast<std::int64_t>(value));
  }
  std::string text = fmt::format("{:.{}f}", value, column.decimals);
  if (column.has_quartiles && values.size() > 1) {
    std::sort(values.begin(), values.end());
    text += fmt::format(" [{1:.{0}f}, {2:.{0}f}]", column.decimals, quantile(values, 0.25),
                        quantile(values, 0.75));
  }
  return text;
}

Table::Cells Table::cells() const {
  Cells lines(1);
  for (const Column& column : columns_) {
    lines[0].push_back(column.title);
  }
  for (const auto& [place, rounds] : lines_) {
    auto& line = lines.emplace_back();
    for (const Column& column : columns_) {
      line.push_back(cell(column, rounds));
    }
  }
  if (!is_upright_) {
    return lines;
  }
  Cells upright(columns_.size());
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      upright[i].push_back(line[i]);
    }
  }
  return upright;
}

std::string Table::to_text() const {
  const Cells lines = cells();
  std::vector<std::size_t> widths(lines.front().size());
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      widths[i] = std::max(widths[i], width(line[i]));
    }
  }
  std::string text;
  for (const auto& line : lines) {
    std::string row;
    for (std::size_t i = 0; i < line.size(); ++i) {
      const std::string padding(widths[i] - width(line[i]), ' ');
      const bool is_left = is_upright_ ? i == 0 : columns_[i].key == "peer";
      row += (i == 0 ? "" : "  ") + (is_left ? line[i] + padding : padding + line[i]);
    }
    row.erase(row.find_last_not_of(' ') + 1);
    text += row + "\n";
  }
  return text;
}

}  // namespace fastcycle::tool::bench
