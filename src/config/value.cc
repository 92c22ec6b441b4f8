#include "config/value.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <stdexcept>

#include <nlohmann/json.hpp>

namespace fastcycle::config {

namespace {

constexpr std::size_t kShownLength = 60;

std::string with_control_characters_escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      std::array<char, 8> escaped{};
      (void)std::snprintf(escaped.data(), escaped.size(), "\\u%04x",
                          static_cast<unsigned>(static_cast<unsigned char>(c)));
      result += escaped.data();
    } else {
      result += c;
    }
  }
  return result;
}

// Cuts between characters, never inside one of several bytes.
std::string cut(std::string text, std::string_view end, std::size_t length = kShownLength) {
  if (text.size() <= length) {
    return text;
  }
  while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xC0U) == 0x80U) {
    --length;
  }
  text.resize(length);
  return text + "…" + std::string(end);
}

nlohmann::ordered_json to_ordered_json(const Value& value) {
  switch (value.type()) {
    case Value::Type::kNull:
      return nullptr;
    case Value::Type::kBool:
      return value.as_bool();
    case Value::Type::kInt:
      return value.as_int64();
    case Value::Type::kUint:
      return value.as_uint64();
    case Value::Type::kDouble:
      return value.as_double();
    case Value::Type::kString:
      return value.as_string();
    case Value::Type::kArray: {
      auto result = nlohmann::ordered_json::array();
      for (const Value& item : value.items()) {
        result.push_back(to_ordered_json(item));
      }
      return result;
    }
    case Value::Type::kObject: {
      auto result = nlohmann::ordered_json::object();
      // Keys are unique, so the map's own search for an equal key is left out.
      for (const auto& [key, member] : value.members()) {
        result.get_ref<nlohmann::ordered_json::object_t&>().push_back(
            {key, to_ordered_json(member)});
      }
      return result;
    }
  }
  return nullptr;
}

}  // namespace

std::string to_string(const Place& place) {
  std::string result = with_control_characters_escaped(place.file);
  if (place.line > 0) {
    result += ':' + std::to_string(place.line);
  }
  if (!place.pointer.empty()) {
    result += (result.empty() ? "" : ": ") + with_control_characters_escaped(place.pointer);
  }
  return result;
}

Value::Value(Content content, Origin origin)
    : content_(std::move(content)),
      source_(std::move(origin.source)),
      line_(origin.line),
      pointer_(std::move(origin.pointer)) {
  if (const auto* large = std::get_if<std::uint64_t>(&content_); large && *large <= INT64_MAX) {
    content_ = static_cast<std::int64_t>(*large);
  }
}

Value Value::object_at(const Value& place_of) {
  return Value(Object{}, place_of.origin());
}

Value Value::string_at(const Value& place_of, std::string text) {
  return Value(std::move(text), place_of.origin());
}

Value::Type Value::type() const {
  return static_cast<Type>(content_.index());
}

bool Value::as_bool() const {
  return std::get<bool>(content_);
}

std::int64_t Value::as_int64() const {
  return std::get<std::int64_t>(content_);
}

std::uint64_t Value::as_uint64() const {
  if (const auto* small = std::get_if<std::int64_t>(&content_)) {
    return static_cast<std::uint64_t>(*small);
  }
  return std::get<std::uint64_t>(content_);
}

double Value::as_double() const {
  switch (type()) {
    case Type::kInt:
      return static_cast<double>(std::get<std::int64_t>(content_));
    case Type::kUint:
      return static_cast<double>(std::get<std::uint64_t>(content_));
    default:
      return std::get<double>(content_);
  }
}

const std::string& Value::as_string() const {
  return std::get<std::string>(content_);
}

const Value::Array& Value::items() const {
  return std::get<Array>(content_);
}
Value::Array& Value::items() {
  return std::get<Array>(content_);
}

const Value::Object& Value::members() const {
  return std::get<Object>(content_);
}
Value::Object& Value::members() {
  return std::get<Object>(content_);
}

std::filesystem::path Value::as_path() const {
  const std::filesystem::path path(as_string());
  const auto& base = path_base_ ? path_base_ : source_;
  if (path.is_absolute() || !base || base->folder.empty()) {
    return path.lexically_normal();
  }
  return (base->folder / path).lexically_normal();
}

const Value* Value::find(std::string_view key) const {
  if (!is_object()) {
    return nullptr;
  }
  const auto found = std::ranges::find(members(), key, &Member::key);
  return found == members().end() ? nullptr : &found->value;
}

Value* Value::find(std::string_view key) {
  return const_cast<Value*>(std::as_const(*this).find(key));  // The object itself is not const.
}

const Value* Value::find_dotted(std::string_view name) const {
  const Value* value = this;
  while (value != nullptr && !name.empty()) {
    const std::size_t dot = name.find('.');
    value = value->find(name.substr(0, dot));
    name = dot == std::string_view::npos ? std::string_view{} : name.substr(dot + 1);
  }
  return value;
}

const Value& Value::operator[](std::string_view key) const {
  const Value* value = find(key);
  if (value == nullptr) {
    throw std::out_of_range("config::Value: there is no member " + in_quotes(key));
  }
  return *value;
}

std::size_t Value::size() const {
  if (is_array()) {
    return items().size();
  }
  return is_object() ? members().size() : 0;
}

void Value::set(std::string_view key, Value value) {
  if (Value* old = find(key)) {
    *old = std::move(value);
    return;
  }
  members().push_back({std::string(key), std::move(value)});
}

bool Value::erase(std::string_view key) {
  return std::erase_if(members(), [&](const Member& member) { return member.key == key; }) > 0;
}

Place Value::place() const {
  const bool has_lines = source_ && source_->has_lines;
  return {source_ ? source_->name : std::string(), has_lines ? line_ : 0, pointer_};
}

nlohmann::json Value::to_json() const {
  return to_ordered_json(*this);
}

std::string Value::to_text() const {
  return to_ordered_json(*this).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

bool Value::same_content(const Value& other) const {
  return to_ordered_json(*this) == to_ordered_json(other);
}

std::string shown(const Value& value) {
  switch (value.type()) {
    case Value::Type::kString:
      return in_quotes(value.as_string());
    // A container is not written out only to be cut.
    case Value::Type::kArray:
      return value.size() > 16 ? "a list of " + std::to_string(value.size()) + " items"
                               : cut(value.to_text(), "]");
    case Value::Type::kObject:
      return value.size() > 16 ? "an object of " + std::to_string(value.size()) + " keys"
                               : cut(value.to_text(), "}");
    default:
      return value.to_text();
  }
}

std::string in_quotes(std::string_view text, std::size_t max_length) {
  const std::string part(text.substr(0, 4 * max_length));
  const auto escaped =
      nlohmann::json(part).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return cut(with_control_characters_escaped(escaped), "\"", max_length);
}

std::string pointer_to(std::string_view pointer, std::string_view token) {
  std::string result(pointer);
  result += '/';
  for (const char c : token) {
    if (c == '~') {
      result += "~0";
    } else if (c == '/') {
      result += "~1";
    } else {
      result += c;
    }
  }
  return result;
}

}  // namespace fastcycle::config
