#include "campaign/judge.h"

#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "config/nearest.h"
#include "config/problem.h"

namespace fastcycle::campaign {
namespace {

using nlohmann::ordered_json;

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  return first == std::string_view::npos
             ? std::string()
             : std::string(text.substr(first, text.find_last_not_of(" \t") - first + 1));
}

/// The value at a dotted path below `json`; keys may contain dots themselves.
const ordered_json* find_below(const ordered_json& json, std::string_view path) {
  if (!json.is_object()) {
    return nullptr;
  }
  if (const auto found = json.find(std::string(path)); found != json.end()) {
    return &*found;
  }
  for (auto dot = path.find('.'); dot != std::string_view::npos; dot = path.find('.', dot + 1)) {
    if (const auto found = json.find(std::string(path.substr(0, dot))); found != json.end()) {
      if (const ordered_json* const below = find_below(*found, path.substr(dot + 1))) {
        return below;
      }
    }
  }
  return nullptr;
}

/// The results that the report has of one component; null if there are none.
const ordered_json* results_of(const ordered_json& report, const std::string& component) {
  const auto components = report.find("components");
  if (components == report.end() || !components->contains(component)) {
    return nullptr;
  }
  const ordered_json& its = (*components)[component];
  const auto results = its.find("results");
  return results == its.end() ? nullptr : &*results;
}

/// A result by its name, with or without that of its component; or whatever else the report has.
const ordered_json* find(const ordered_json& report, const std::string& path) {
  if (const auto dot = path.find('.'); dot != std::string::npos) {
    // Its own ones only: another component may have a result of the same name.
    if (const ordered_json* const own = results_of(report, path.substr(0, dot))) {
      if (const auto found = own->find(path.substr(dot + 1)); found != own->end()) {
        return &*found;
      }
    }
  }
  if (const auto results = report.find("results"); results != report.end()) {
    if (const auto found = results->find(path); found != results->end()) {
      return &*found;
    }
  }
  return find_below(report, path);
}

std::string suggestion(const ordered_json& report, const std::string& path) {
  std::vector<std::string> known;
  const auto add_names = [&](const ordered_json& results, const std::string& prefix) {
    for (const auto& [name, value] : results.items()) {
      known.push_back(prefix + name);
    }
  };
  if (const auto results = report.find("results"); results != report.end()) {
    add_names(*results, "");
  }
  if (const auto components = report.find("components"); components != report.end()) {
    for (const auto& [component, its] : components->items()) {
      if (const ordered_json* const results = results_of(report, component)) {
        add_names(*results, component + ".");
      }
    }
  }
  const std::string nearest = config::nearest(path, known);
  return nearest.empty() ? nearest : "; " + config::did_you_mean(nearest);
}

bool compare(const ordered_json& found, const std::string& comparison, const ordered_json& value) {
  if (found.is_number() && value.is_number()) {
    const double a = found.get<double>();
    const double b = value.get<double>();
    return comparison == "=="   ? a == b
           : comparison == "!=" ? a != b
           : comparison == "<"  ? a < b
           : comparison == "<=" ? a <= b
           : comparison == ">"  ? a > b
                                : a >= b;
  }
  return comparison == "==" ? found == value : comparison == "!=" && found != value;
}

/// What `text` is in JSON: a value, or a word without quotes; discarded if it is neither.
ordered_json value_of(const std::string& text) {
  // In a word they are the rest of something else, such as a second condition.
  constexpr const char* kStray = " \t\r\n\v\f=!<>&|,;\"";
  ordered_json json = ordered_json::parse(text, nullptr, false);
  return json.is_discarded() && !text.empty() && text.find_first_of(kStray) == std::string::npos
             ? ordered_json(text)
             : json;
}

/// The name that `text` is, which may be in quotes; empty if it is none.
std::string name_of(const std::string& text) {
  const ordered_json json = value_of(text);
  return json.is_discarded() ? std::string() : json.is_string() ? json.get<std::string>() : text;
}

/// Where the name at the beginning of `text` ends at the latest.
std::size_t end_of_name(std::string_view text) {
  std::size_t begin = text.find_first_not_of(" \t");
  if (begin != std::string_view::npos && text[begin] == '"') {
    for (++begin; begin < text.size() && text[begin] != '"'; ++begin) {
      begin += text[begin] == '\\' ? 1 : 0;
    }
  }
  return text.find_first_of("=!<>", begin);
}

/// The comparison that `text` begins with; empty if there is none.
std::string comparison_at(std::string_view text) {
  for (const char* comparison : {"==", "!=", "<=", ">=", "<", ">"}) {  // Longer ones first.
    if (text.starts_with(comparison)) {
      return comparison;
    }
  }
  return {};
}

}  // namespace

std::optional<Judge> Judge::parse(const std::string& text, std::string& why) {
  const std::string_view view = text;
  if (const auto place = end_of_name(view); place != std::string_view::npos) {
    Judge judge;
    const std::string name = trimmed(view.substr(0, place));
    judge.path_ = name_of(name);
    judge.comparison_ = comparison_at(view.substr(place));
    const std::string value = trimmed(view.substr(place + judge.comparison_.size()));
    const ordered_json json = value_of(value);
    const bool is_ordered = judge.comparison_ != "==" && judge.comparison_ != "!=";
    if (!judge.path_.empty() && !judge.comparison_.empty() && !json.is_discarded() &&
        !json.is_structured() && (!is_ordered || json.is_number())) {
      judge.value_ = json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
      judge.text_ = name + " " + judge.comparison_ + " " + value;
      return judge;
    }
  }
  why =
      "expected a condition such as \"collisions == 0\", with one of == != < <= > >= and a "
      "number, true, false or a word behind it, found \"" +
      text +
      "\"; each condition takes its own --judge, and what has blanks takes double quotes, as in "
      "'end == \"time over\"'";
  return std::nullopt;
}

std::string Judge::find_fault(const ordered_json& report) const {
  const ordered_json* const found = find(report, path_);
  if (found == nullptr) {
    return "the report has no " + path_ + suggestion(report, path_);
  }
  return compare(*found, comparison_, ordered_json::parse(value_))
             ? std::string()
             : path_ + " is " + found->dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace fastcycle::campaign
