#include "ros2/json_form.h"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "ros2/cdr.h"
#include "ros2/kinds.h"

namespace fastcycle::ros2 {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kDigits =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

std::string to_base64(std::span<const std::byte> bytes) {
  std::string text;
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    std::uint32_t three = 0;
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
    for (std::size_t i = 0; i < 3; ++i) {
      three = three << 8U | (i < count ? static_cast<std::uint32_t>(bytes[at + i]) : 0U);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      text += i <= count ? kDigits[three >> (18 - 6 * i) & 63U] : '=';
    }
  }
  return text;
}

std::string from_base64(std::string_view text) {
  std::string bytes;
  std::uint32_t bits = 0;
  unsigned count = 0;
  for (const char c : text) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) {
      break;
    }
    bits = bits << 6U | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count >= 8) {
      count -= 8;
      bytes += static_cast<char>(bits >> count);
    }
  }
  return bytes;
}

template <typename T>
Json json_of(T value) {
  if constexpr (std::is_floating_point_v<T>) {
    if (std::isnan(value)) {
      return "NaN";
    }
    if (std::isinf(value)) {
      return value > 0 ? "Infinity" : "-Infinity";
    }
    // The shortest text that yields this 32-bit number, not all its digits as a 64-bit one.
    const std::string text = fmt::format("{}", value);
    double same = 0.0;
    std::from_chars(text.data(), text.data() + text.size(), same);
    return same;
  } else {
    return value;
  }
}

Json read_struct(const Definition& definition, CdrReader& in, const std::string& path);

Json read_one(const Field& field, CdrReader& in, const std::string& path) {
  if (field.kind == Kind::kMessage) {
    return read_struct(*field.message, in, path + '.');
  }
  if (field.kind == Kind::kText) {
    return in.text(path);
  }
  if (field.kind == Kind::kWideText) {
    in.fail(path, "a type that is supported", "wstring");
  }
  if (field.kind == Kind::kBool) {
    return in.boolean(path);
  }
  return with_number(field.kind,
                     [&]<typename T>(T /*type*/) -> Json { return json_of(in.number<T>(path)); });
}

Json read_field(const Field& field, CdrReader& in, const std::string& path) {
  if (field.shape == Shape::kOne) {
    return read_one(field, in, path);
  }
  if (field.kind == Kind::kUint8 && field.shape != Shape::kArray) {
    return {{"base64", to_base64(in.bytes(path))}};
  }
  const std::size_t count =
      field.shape == Shape::kArray ? field.count : in.count(path, least_bytes_of(field));
  Json list = Json::array();
  for (std::size_t i = 0; i < count; ++i) {
    list.push_back(read_one(field, in, path));
  }
  return list;
}

Json read_struct(const Definition& definition, CdrReader& in, const std::string& path) {
  Json object = Json::object();
  for (const Field& field : definition.fields) {
    object[field.name] = read_field(field, in, path + field.name);
  }
  return object;
}

template <typename T>
T number_of(const Json& value, CdrWriter& out, const std::string& path) {
  if constexpr (std::is_floating_point_v<T>) {
    if (value.is_string()) {
      const auto& text = value.get_ref<const std::string&>();
      using Limits = std::numeric_limits<T>;
      return text == "Infinity"    ? Limits::infinity()
             : text == "-Infinity" ? -Limits::infinity()
                                   : Limits::quiet_NaN();
    }
  }
  if (value.is_boolean()) {
    return static_cast<T>(value.get<bool>());
  }
  if (!value.is_number()) {
    out.fail(path, "a number", value.dump());
  }
  return value.get<T>();
}

void write_struct(const Definition& definition, const Json& value, CdrWriter& out,
                  const std::string& path);

void write_one(const Field& field, const Json& value, CdrWriter& out, const std::string& path) {
  if (field.kind == Kind::kMessage) {
    write_struct(*field.message, value, out, path + '.');
  } else if (field.kind == Kind::kText) {
    out.text(value.is_string() ? value.get_ref<const std::string&>() : std::string(), path);
  } else if (field.kind == Kind::kWideText) {
    out.fail(path, "a type that is supported", "wstring");
  } else if (value.is_null()) {
    with_number(field.kind, [&]<typename T>(T /*type*/) { out.number(T{}); });
  } else {
    with_number(field.kind,
                [&]<typename T>(T /*type*/) { out.number(number_of<T>(value, out, path)); });
  }
}

void write_field(const Field& field, const Json& value, CdrWriter& out, const std::string& path) {
  if (field.shape == Shape::kOne) {
    write_one(field, value, out, path);
  } else if (value.is_object() && value.contains("base64")) {
    out.bytes(from_base64(value["base64"].get<std::string>()), path);
  } else {
    const std::size_t count = value.is_array() ? value.size() : 0;
    if (field.shape != Shape::kArray) {
      out.count(count, path);
    }
    static const Json kNothing;
    const std::size_t written = field.shape == Shape::kArray ? field.count : count;
    for (std::size_t i = 0; i < written; ++i) {
      write_one(field, i < count ? value[i] : kNothing, out, path);
    }
  }
}

void write_struct(const Definition& definition, const Json& value, CdrWriter& out,
                  const std::string& path) {
  static const Json kNothing;
  for (const Field& field : definition.fields) {
    const bool is_given = value.is_object() && value.contains(field.name);
    write_field(field, is_given ? value[field.name] : kNothing, out, path + field.name);
  }
}

}  // namespace

nlohmann::ordered_json to_json(const Definition& definition, std::span<const std::byte> message) {
  CdrReader in(message, definition.name);
  Json value = read_struct(definition, in, "");
  in.end();
  return value;
}

void from_json(const Definition& definition, const nlohmann::ordered_json& value, Buffer& out) {
  CdrWriter writer(out, definition.name);
  write_struct(definition, value, writer, "");
}

}  // namespace fastcycle::ros2
