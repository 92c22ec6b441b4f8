#include "campaign/judge.h"

#include <array>
#include <string_view>

#include <nlohmann/json.hpp>

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

/// A result by its name, with or without that of its component; or whatever else the report has.
const ordered_json* find(const ordered_json& report, const std::string& path) {
  const auto results = report.find("results");
  if (results != report.end()) {
    if (const auto found = results->find(path); found != results->end()) {
      return &*found;
    }
    const auto dot = path.find('.');
    const auto components = report.find("components");
    if (dot != std::string::npos && components != report.end() &&
        components->contains(path.substr(0, dot))) {
      const auto found = results->find(path.substr(dot + 1));
      if (found != results->end()) {
        return &*found;
      }
    }
  }
  return find_below(report, path);
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

}  // namespace

std::optional<Judge> Judge::parse(const std::string& text, std::string& why) {
  constexpr std::array kComparisons = {"==", "!=", "<=", ">=", "<", ">"};
  for (const char* comparison : kComparisons) {
    const auto place = text.find(comparison);
    if (place == std::string::npos) {
      continue;
    }
    Judge judge;
    judge.path_ = trimmed(std::string_view(text).substr(0, place));
    judge.comparison_ = comparison;
    const std::string value =
        trimmed(std::string_view(text).substr(place + std::string_view(comparison).size()));
    ordered_json json = ordered_json::parse(value, nullptr, false);
    if (json.is_discarded()) {
      json = value;  // A word.
    }
    const bool is_ordered = comparison[0] == '<' || comparison[0] == '>';
    if (judge.path_.empty() || value.empty() || json.is_structured() ||
        (is_ordered && !json.is_number())) {
      break;
    }
    judge.value_ = json.dump();
    judge.text_ = judge.path_ + " " + comparison + " " + value;
    return judge;
  }
  why =
      "expected a condition such as \"collisions == 0\", with one of == != < <= > >= and a "
      "number, true, false or a word behind it, found \"" +
      text + "\"";
  return std::nullopt;
}

std::string Judge::find_fault(const ordered_json& report) const {
  const ordered_json* const found = find(report, path_);
  if (found == nullptr) {
    return "the report has no " + path_;
  }
  return compare(*found, comparison_, ordered_json::parse(value_))
             ? std::string()
             : path_ + " is " + found->dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace fastcycle::campaign
