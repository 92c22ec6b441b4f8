#include "ros2/mapping.h"

#include <algorithm>
#include <initializer_list>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "ros2/definition.h"

namespace fastcycle::ros2 {
namespace {

using nlohmann::json;

/// A position in a file of mappings, for errors.
struct Place {
  std::string_view source;
  std::string pointer;

  [[nodiscard]] Place in(std::string_view key) const {
    return {.source = source, .pointer = fmt::format("{}/{}", pointer, key)};
  }
  [[noreturn]] void fail(std::string_view expected, const json& found) const {
    throw MappingError(
        fmt::format("{}: {}: expected {}, found {}", source, pointer, expected, found.dump()));
  }
};

const json& object(const json& value, const Place& place,
                   std::initializer_list<std::string_view> keys) {
  if (!value.is_object()) {
    place.fail("an object", value);
  }
  for (const auto& [key, inner] : value.items()) {
    if (keys.size() > 0 && std::ranges::find(keys, key) == keys.end()) {
      throw MappingError(
          fmt::format("{}: {}/{}: there is no such key", place.source, place.pointer, key));
    }
  }
  return value;
}

std::string text(const json& from, std::string_view key, const Place& place, bool is_needed) {
  const auto found = from.find(key);
  if (found == from.end() && !is_needed) {
    return {};
  }
  if (found == from.end() || !found->is_string()) {
    place.in(key).fail("a text", found == from.end() ? json() : *found);
  }
  return found->get<std::string>();
}

double number(const json& from, std::string_view key, const Place& place, double fallback) {
  const auto found = from.find(key);
  if (found == from.end()) {
    return fallback;
  }
  if (!found->is_number()) {
    place.in(key).fail("a number", *found);
  }
  return found->get<double>();
}

Rule rule_of(const json& value, const Place& place) {
  Rule rule;
  if (value.is_string()) {
    rule.to = value.get<std::string>();
    return rule;
  }
  object(value, place, {"to", "scale", "offset", "names", "value"});
  rule.to = text(value, "to", place, false);
  rule.scale = number(value, "scale", place, 1.0);
  rule.offset = number(value, "offset", place, 0.0);
  if (rule.scale == 0.0) {
    place.in("scale").fail("a number other than 0", value["scale"]);
  }
  if (value.contains("value")) {
    rule.constant = number(value, "value", place, 0.0);
  }
  if (value.contains("names")) {
    const Place names = place.in("names");
    for (const auto& [ros, ours] : object(value["names"], names, {}).items()) {
      rule.names[ros] = text(value["names"], ros, names, true);
    }
  }
  if (rule.to.empty() && !rule.constant) {
    place.fail("\"to\" or \"value\"", value);
  }
  return rule;
}

Mapping mapping_of(const json& value, const Place& place) {
  object(value, place, {"ros", "message", "fields", "absent", "constants", "conversion"});
  Mapping mapping;
  mapping.ros = full_type_name(text(value, "ros", place, true));
  mapping.message = text(value, "message", place, true);
  mapping.conversion = text(value, "conversion", place, false);
  if (value.contains("fields")) {
    const Place fields = place.in("fields");
    for (const auto& [path, rule] : object(value["fields"], fields, {}).items()) {
      mapping.fields[path] = rule_of(rule, fields.in(path));
    }
  }
  if (value.contains("absent")) {
    const Place absent = place.in("absent");
    for (const auto& [field, covariance] : object(value["absent"], absent, {}).items()) {
      mapping.absent[field] = text(value["absent"], field, absent, true);
    }
  }
  if (value.contains("constants")) {
    mapping.constants = object(value["constants"], place.in("constants"), {}).dump();
  }
  return mapping;
}

}  // namespace

void Mappings::add(std::string_view text, std::string_view source) {
  const Place place{.source = source, .pointer = ""};
  json file;
  try {
    file = json::parse(text);
  } catch (const json::parse_error& error) {
    throw MappingError(fmt::format("{}: {}", source, error.what()));
  }
  object(file, place, {"$schema", "mappings"});
  const auto list = file.find("mappings");
  if (list == file.end() || !list->is_array()) {
    place.in("mappings").fail("a list", list == file.end() ? json() : *list);
  }
  std::vector<Mapping> added;
  for (std::size_t i = 0; i < list->size(); ++i) {
    added.push_back(mapping_of((*list)[i], place.in("mappings").in(std::to_string(i))));
  }
  mappings_.insert(mappings_.begin(), std::make_move_iterator(added.begin()),
                   std::make_move_iterator(added.end()));
}

const Mapping* Mappings::find(std::string_view ros, std::string_view message) const {
  const std::string full = full_type_name(ros);
  const auto found = std::ranges::find_if(mappings_, [&](const Mapping& mapping) {
    return mapping.ros == full && (message.empty() || mapping.message == message);
  });
  return found == mappings_.end() ? nullptr : &*found;
}

}  // namespace fastcycle::ros2
