#include "config/schema.h"

#include <algorithm>
#include <charconv>
#include <exception>
#include <regex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

#include "config/nearest.h"
#include "config/parse.h"

namespace fastcycle::config {

namespace {

using nlohmann::json;

// Limits of long values for the validator. Its regular expressions need stack by the character and
// its search for equal items is quadratic; the schema limits both far below.
constexpr std::size_t kMaxShownBytes = 1024;
constexpr std::size_t kMaxShownItems = 1100;

/// A place in the file with its schema.
struct Spot {
  const Value* value;
  const json* schema;
};

std::string shortened(const std::string& text) {
  std::size_t length = std::min(text.size(), kMaxShownBytes);
  while (length > 0 && length < text.size() &&
         (static_cast<unsigned char>(text[length]) & 0xC0U) == 0x80U) {
    --length;
  }
  return text.substr(0, length);
}

json bounded_copy(const Value& value) {
  if (value.is_string()) {
    return shortened(value.as_string());
  }
  if (value.is_array()) {
    json result = json::array();
    for (std::size_t i = 0; i < std::min(value.size(), kMaxShownItems); ++i) {
      result.push_back(bounded_copy(value[i]));
    }
    return result;
  }
  if (value.is_object()) {
    json result = json::object();
    for (const auto& [key, member] : value.members()) {
      result[key] = bounded_copy(member);
    }
    return result;
  }
  return value.to_json();
}

void erase_nulls(Value& value) {
  if (value.is_object()) {
    std::erase_if(value.members(), [](const auto& member) { return member.value.is_null(); });
    for (auto& member : value.members()) {
      erase_nulls(member.value);
    }
  } else if (value.is_array()) {
    for (Value& item : value.items()) {
      erase_nulls(item);
    }
  }
}

// Follows "$ref". Other keywords beside it, such as its description, are for editors.
const json& resolved(const json& root, const json& schema) {
  const json* at = &schema;
  while (at->contains("$ref")) {
    at = &root.at(json::json_pointer(at->at("$ref").get<std::string>().substr(1)));
  }
  return *at;
}

// The schema of a member or an item; null if there is none.
const json* schema_of_child(const json& schema, const Value& parent, const std::string& key) {
  if (parent.is_array()) {
    return schema.contains("items") ? &schema["items"] : nullptr;
  }
  if (schema.contains("properties") && schema["properties"].contains(key)) {
    return &schema["properties"][key];
  }
  if (schema.contains("additionalProperties") && schema["additionalProperties"].is_object()) {
    return &schema["additionalProperties"];
  }
  return nullptr;
}

const Value* child_of(const Value& parent, const std::string& key) {
  if (!parent.is_array()) {
    return parent.find(key);
  }
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), index);
  return error == std::errc() && index < parent.size() ? &parent[index] : nullptr;
}

// The validator names a place `<root>`, `[components]`, `[0]`, `[library]`.
std::optional<Spot> find_spot(const json& root, const Value& file,
                              const std::vector<std::string>& context) {
  Spot spot{&file, &resolved(root, root)};
  for (std::size_t i = 1; i < context.size(); ++i) {
    const std::string key = context[i].substr(1, context[i].size() - 2);
    const json* schema = schema_of_child(*spot.schema, *spot.value, key);
    const Value* value = child_of(*spot.value, key);
    if (schema == nullptr || value == nullptr) {
      return std::nullopt;
    }
    spot = {value, &resolved(root, *schema)};
  }
  return spot;
}

bool has_type(const Value& value, const std::string& type) {
  return (type == "object" && value.is_object()) || (type == "array" && value.is_array()) ||
         (type == "string" && value.is_string()) || (type == "integer" && value.is_integer()) ||
         (type == "number" && value.is_number()) || (type == "boolean" && value.is_bool()) ||
         (type == "null" && value.is_null());
}

bool has_type_of(const Value& value, const json& schema) {
  if (!schema.contains("type")) {
    return true;
  }
  const json& type = schema["type"];
  if (type.is_string()) {
    return has_type(value, type);
  }
  return std::ranges::any_of(type, [&](const json& one) { return has_type(value, one); });
}

std::string range_of(const json& schema) {
  const bool has_min = schema.contains("minimum");
  const bool has_max = schema.contains("maximum");
  if (has_min && has_max) {
    return " in [" + schema["minimum"].dump() + ", " + schema["maximum"].dump() + "]";
  }
  if (has_min) {
    return " of at least " + schema["minimum"].dump();
  }
  return has_max ? " of at most " + schema["maximum"].dump() : "";
}

std::string words_of(const json& schema) {
  std::string result = "one of ";
  for (const json& word : schema["enum"]) {
    result += (result.ends_with(' ') ? "" : ", ") + word.dump();
  }
  return result;
}

std::string items_of(const json& schema) {
  return schema.contains("maxItems") ? " of at most " + schema["maxItems"].dump() + " items" : "";
}

/// The expected value: `an integer in [1, 64]`.
std::string expected_by(const json& schema) {
  const bool is_outermost = schema.contains("$schema");
  if (schema.contains("title") && !is_outermost) {
    return schema["title"];
  }
  if (schema.contains("enum")) {
    return words_of(schema);
  }
  const std::string type = schema.contains("type") && schema["type"].is_string()
                               ? schema["type"].get<std::string>()
                               : std::string();
  if (type == "integer") {
    return "an integer" + range_of(schema);
  }
  if (type == "number") {
    return "a number" + range_of(schema);
  }
  if (type == "array") {
    return "a list" + items_of(schema);
  }
  if (type == "boolean") {
    return "true or false";
  }
  return type == "object" ? "an object" : "a string";
}

std::string nearest_word(const Value& value, const json& schema) {
  if (!value.is_string() || !schema.contains("enum")) {
    return {};
  }
  return nearest(value.as_string(), schema["enum"].get<std::vector<std::string>>());
}

std::vector<std::string> keys_of(const json& properties) {
  std::vector<std::string> result;
  for (const auto& [key, property] : properties.items()) {
    result.push_back(key);
  }
  return result;
}

Problem unknown_key(const std::string& key, const Value& value,
                    const std::vector<std::string>& known) {
  Problem problem = make_error(value.place(), "unknown key " + in_quotes(key));
  for (const std::string& name : known) {
    problem.expected += (problem.expected.empty() ? "one of " : ", ") + name;
  }
  problem.found = in_quotes(key);
  problem.hint = name_hint(key, known);
  return problem;
}

void explain_object(const Spot& spot, Problems& problems) {
  const json& schema = *spot.schema;
  for (const json& key : schema.value("required", json::array())) {
    if (spot.value->find(key.get<std::string>()) == nullptr) {
      problems.add(make_error(spot.value->place(), "the key " + key.dump() + " is missing"));
    }
  }
  if (!schema.contains("additionalProperties") || schema["additionalProperties"] != false) {
    return;
  }
  const json& properties = schema["properties"];
  for (const auto& [key, value] : spot.value->members()) {
    if (!properties.contains(key)) {
      problems.add(unknown_key(key, value, keys_of(properties)));
    }
  }
}

bool has_too_many_items(const Spot& spot) {
  return spot.value->is_array() && spot.schema->contains("maxItems") &&
         spot.value->size() > (*spot.schema)["maxItems"].get<std::size_t>();
}

/// Reports the error at the spot itself. The validator reports each error again at every level
/// above it; there this reports nothing, because `is_deepest` is false.
void explain(const Spot& spot, bool is_deepest, Problems& problems) {
  if (!has_type_of(*spot.value, *spot.schema)) {
    problems.add(unexpected(*spot.value, expected_by(*spot.schema)));
    return;
  }
  if (spot.value->is_object()) {
    explain_object(spot, problems);
    return;
  }
  if (is_deepest || has_too_many_items(spot)) {
    problems.add(unexpected(*spot.value, expected_by(*spot.schema), shown(*spot.value),
                            did_you_mean(nearest_word(*spot.value, *spot.schema))));
  }
}

// The validator does not report what "propertyNames" refuses.
void check_keys(const json& root, const Spot& spot, Problems& problems) {
  const json& schema = *spot.schema;
  const auto visit = [&](const Value& value, const std::string& key) {
    if (const json* child = schema_of_child(schema, *spot.value, key)) {
      check_keys(root, {&value, &resolved(root, *child)}, problems);
    }
  };
  if (spot.value->is_array()) {
    for (const Value& item : spot.value->items()) {
      visit(item, {});
    }
  } else if (spot.value->is_object()) {
    for (const auto& [key, value] : spot.value->members()) {
      visit(value, key);
    }
    if (!schema.contains("propertyNames")) {
      return;
    }
    const json& names = resolved(root, schema["propertyNames"]);
    const std::regex pattern(names["pattern"].get<std::string>());
    const std::size_t max_length = names["maxLength"];
    for (const auto& [key, value] : spot.value->members()) {
      if (key.size() > max_length || !std::regex_match(key, pattern)) {
        problems.add(unexpected(value, names["title"], "the key " + in_quotes(key)));
      }
    }
  }
}

}  // namespace

Schema::Schema(const std::filesystem::path& schema_file, Problems& problems) {
  std::string text(built_in_schema());
  if (!schema_file.empty()) {
    text = read_file(schema_file, {}, problems).value_or("");
    if (text.empty()) {
      return;
    }
  }
  json application = json::parse(text, nullptr, false);
  try {
    const json component_file = {{"$ref", "#/definitions/component_file"},
                                 {"definitions", application.at("definitions")}};
    application_ = make_rules(std::move(application));
    component_file_ = make_rules(component_file);
  } catch (const std::exception& error) {
    problems.add(
        make_error({schema_file.string(), 0, ""},
                   std::string("this is not the schema of applications: ") + error.what()));
  }
}

Schema::Rules Schema::make_rules(json json) {
  auto parsed = std::make_shared<valijson::Schema>();
  valijson::SchemaParser parser(valijson::SchemaParser::kDraft7);
  parser.populateSchema(valijson::adapters::NlohmannJsonAdapter(json), *parsed);
  return {std::move(json), std::move(parsed)};
}

void Schema::check_application(const Value& file, Problems& problems) const {
  check(file, application_, problems);
}

void Schema::check_overlay(const Value& file, Problems& problems) const {
  Value without_nulls = file;
  erase_nulls(without_nulls);
  check(without_nulls, application_, problems);
}

void Schema::check_component_file(const Value& file, Problems& problems) const {
  check(file, component_file_, problems);
}

void Schema::check(const Value& file, const Rules& rules, Problems& problems) {
  if (rules.parsed == nullptr) {
    return;
  }
  const json& schema = rules.json;
  const json content = bounded_copy(file);
  valijson::ValidationResults results;
  valijson::Validator().validate(*rules.parsed, valijson::adapters::NlohmannJsonAdapter(content),
                                 &results);
  std::set<std::vector<std::string>> places;
  for (const auto& error : results) {
    places.insert(error.context);
  }
  for (auto place = places.begin(); place != places.end(); ++place) {
    // In this order a place stands right before all that is below it.
    const auto next = std::next(place);
    const bool is_deepest = next == places.end() || next->size() <= place->size() ||
                            !std::equal(place->begin(), place->end(), next->begin());
    if (const auto spot = find_spot(schema, file, *place)) {
      explain(*spot, is_deepest, problems);
    }
  }
  check_keys(schema, {&file, &resolved(schema, schema)}, problems);
}

}  // namespace fastcycle::config
