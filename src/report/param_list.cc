#include "report/param_list.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <mutex>
#include <string_view>
#include <utility>

#include "base/printable.h"
#include "component/component_core.h"
#include "params/param_info.h"
#include "params/param_table.h"
#include "params/param_value.h"

namespace fastcycle::host {

using detail::ParamSpec;
using nlohmann::ordered_json;

namespace {

constexpr std::size_t kMostOfAValue = 40;
constexpr std::array kHeads{"param", "type", "unit",    "range",      "default",
                            "value", "from", "tunable", "description"};
using Row = std::array<std::string, kHeads.size()>;

const char* origin_word(ParamOrigin origin) {
  switch (origin) {
    case ParamOrigin::kFallback:
      return "default";
    case ParamOrigin::kOwn:
      return "file";
    case ParamOrigin::kShared:
      return "shared";
    case ParamOrigin::kChanged:
      return "changed";
  }
  return "";
}

ListedParam listed(const std::string& component, const DeclaredParam& param) {
  const ParamSpec& spec = param.spec();
  ListedParam result{.component = component,
                     .name = spec.name,
                     .type = type_of(spec),
                     .unit = spec.unit,
                     .min = {},
                     .max = {},
                     .names = spec.names,
                     .fallback = {},
                     .value = to_json(spec, param.committed),
                     .origin = origin_word(param.origin),
                     .place = param.origin == ParamOrigin::kChanged ? config::Place{} : param.place,
                     .is_tunable = spec.is_tunable,
                     .description = spec.description};
  if (spec.min && spec.has_own_min) {
    result.min = to_json(spec, *spec.min);
  }
  if (spec.max && spec.has_own_max) {
    result.max = to_json(spec, *spec.max);
  }
  if (spec.fallback) {
    result.has_fallback = true;
    result.fallback = to_json(spec, *spec.fallback);
  }
  return result;
}

/// Of a component in another process.
ListedParam listed(const std::string& component, const RemoteParam& param) {
  const ParamInfo& info = param.info;
  const auto value_of = [](const std::string& json) {
    return json.empty() ? ordered_json() : ordered_json::parse(json, nullptr, false);
  };
  return {.component = component,
          .name = info.param.substr(std::min(info.param.size(), component.size() + 1)),
          .type = info.type,
          .unit = info.unit,
          .min = value_of(info.min_json),
          .max = value_of(info.max_json),
          .names = info.names,
          .has_fallback = !param.default_json.empty(),
          .fallback = value_of(param.default_json),
          .value = value_of(info.json),
          .origin = origin_word(param.origin),
          .place = param.origin == ParamOrigin::kChanged ? config::Place{} : param.place,
          .is_tunable = info.is_tunable,
          .description = info.description};
}

std::string dumped(const ordered_json& value) {
  std::string text = value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (value.is_number_float() && text.ends_with(".0")) {
    text.resize(text.size() - 2);
  }
  return text;
}

bool begins_character(char byte) {
  return (static_cast<unsigned char>(byte) & 0xC0U) != 0x80U;
}

/// For a table: shortened if it is a long list.
std::string shown(const ordered_json& value) {
  std::string text = dumped(value);
  if (text.size() > kMostOfAValue) {
    std::size_t end = kMostOfAValue - 1;
    while (!begins_character(text[end])) {
      --end;
    }
    text.resize(end);
    text += "…";
  }
  return text;
}

std::string range_text(const ListedParam& param) {
  std::string text;
  for (const std::string& name : param.names) {
    text += (text.empty() ? "" : ", ") + name;
  }
  if (!param.min.is_null() && !param.max.is_null()) {
    return "[" + dumped(param.min) + ", " + dumped(param.max) + "]";
  }
  if (!param.min.is_null()) {
    return "≥ " + dumped(param.min);
  }
  return param.max.is_null() ? text : "≤ " + dumped(param.max);
}

Row row_of(const ListedParam& param) {
  std::string from = param.place.file;
  if (param.place.line > 0) {
    from += ":" + std::to_string(param.place.line);
  }
  return {param.full_name(),
          param.type,
          param.unit,
          range_text(param),
          param.has_fallback ? shown(param.fallback) : "",
          shown(param.value),
          from.empty() ? param.origin : from,
          param.is_tunable ? "yes" : "no",
          base::on_one_line(param.description)};
}

std::size_t width_of(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, begins_character));
}

std::string escaped(std::string_view cell) {
  std::string result;
  for (const char c : cell) {
    result += c == '|' ? "\\|" : std::string(1, c);
  }
  return result;
}

}  // namespace

std::vector<ListedParam> list_params(const Application& application) {
  std::vector<ListedParam> result;
  const std::lock_guard lock(application.params().mutex());
  for (const auto& component : application.components()) {
    for (const RemoteParam& param : application.params().list_elsewhere(component->index)) {
      result.push_back(listed(component->name, param));
    }
    for (const DeclaredParam& param : component->param_table.all()) {
      if (param.is_declared) {
        result.push_back(listed(component->name, param));
      }
    }
  }
  return result;
}

std::string to_table(const std::vector<ListedParam>& params) {
  std::vector<Row> rows{Row{}};
  std::ranges::copy(kHeads, rows.front().begin());
  for (const ListedParam& param : params) {
    rows.push_back(row_of(param));
  }
  std::array<std::size_t, kHeads.size()> widths{};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      widths[i] = std::max(widths[i], width_of(row[i]));
    }
  }
  std::string text;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      line += row[i] + std::string(widths[i] - width_of(row[i]) + 2, ' ');
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return text;
}

std::string to_markdown(const std::vector<ListedParam>& params) {
  std::string text = "|";
  for (const char* head : kHeads) {
    text += std::string(" ") + head + " |";
  }
  text += "\n|";
  for (std::size_t i = 0; i < kHeads.size(); ++i) {
    text += "---|";
  }
  text += "\n";
  for (const ListedParam& param : params) {
    text += "|";
    for (const std::string& cell : row_of(param)) {
      text += " " + escaped(cell) + " |";
    }
    text += "\n";
  }
  return text;
}

std::string to_json(const std::vector<ListedParam>& params) {
  ordered_json list = ordered_json::array();
  for (const ListedParam& param : params) {
    ordered_json entry = {
        {"component", param.component}, {"name", param.name}, {"type", param.type}};
    const auto add = [&](const char* key, const ordered_json& value) {
      if (!value.is_null() && !(value.is_string() && value.get_ref<const std::string&>().empty())) {
        entry[key] = value;
      }
    };
    add("unit", param.unit);
    add("min", param.min);
    add("max", param.max);
    if (!param.names.empty()) {
      entry["names"] = param.names;
    }
    if (param.has_fallback) {
      entry["default"] = param.fallback;
    }
    entry["value"] = param.value;
    entry["from"] = param.origin;
    if (!param.place.file.empty()) {
      entry["file"] = param.place.file;
      if (param.place.line > 0) {
        entry["line"] = param.place.line;
      }
      add("pointer", param.place.pointer);
    }
    entry["tunable"] = param.is_tunable;
    add("description", param.description);
    list.push_back(std::move(entry));
  }
  return list.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace fastcycle::host
