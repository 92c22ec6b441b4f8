#include "dds_gateway/ros_params.h"

#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

namespace fastcycle::dds_gateway {
namespace {

using Json = nlohmann::json;

// Minimum sizes: a type, and each value with its count.
constexpr std::size_t kParamBytes = 4 + 1 + 24;

template <typename T>
T one_of(const RosParamValue& value) {
  const T* const found = std::get_if<T>(&value);
  return found == nullptr ? T{} : *found;
}

template <typename T>
std::vector<T> read_numbers(ros2::CdrReader& in, std::string_view field) {
  std::vector<T> values(in.count(field, sizeof(T)));
  if (!values.empty()) {
    in.copy(in.raw(field, values.size(), sizeof(T)).data(), values.data(), values.size());
  }
  return values;
}

std::vector<std::string> read_texts(ros2::CdrReader& in, std::string_view field) {
  std::vector<std::string> texts(in.count(field, 5));
  for (std::string& text : texts) {
    text = in.text(field);
  }
  return texts;
}

/// The elements of a JSON list; none if one has another type, or is out of range.
template <typename T>
std::optional<std::vector<T>> list_of(const Json& json) {
  std::vector<T> values;
  for (const Json& one : json) {
    if constexpr (std::is_same_v<T, std::int64_t>) {
      if (!one.is_number_integer() ||
          (one.is_number_unsigned() &&
           one.get<std::uint64_t>() > std::uint64_t(std::numeric_limits<T>::max()))) {
        return {};
      }
    }
    values.push_back(one.get<T>());
  }
  return values;
}

template <typename T>
RosParamValue value_of(std::optional<T> value) {
  return value ? RosParamValue(std::move(*value)) : RosParamValue();
}

bool is_text(std::string_view type) {
  return type == "string" || type == "path" || type == "enum";
}

}  // namespace

void write(const RosParamValue& value, ros2::CdrWriter& out) {
  const auto numbers = [&]<typename T>(const std::vector<T>& values) {
    out.count(values.size());
    out.array(std::span<const T>(values));
  };
  out.number(static_cast<std::uint8_t>(value.index()));
  out.boolean(one_of<bool>(value));
  out.number(one_of<std::int64_t>(value));
  out.number(one_of<double>(value));
  out.text(one_of<std::string>(value));
  numbers(one_of<std::vector<std::uint8_t>>(value));
  const auto bools = one_of<std::vector<bool>>(value);
  out.count(bools.size());
  for (const bool one : bools) {
    out.boolean(one);
  }
  numbers(one_of<std::vector<std::int64_t>>(value));
  numbers(one_of<std::vector<double>>(value));
  const auto texts = one_of<std::vector<std::string>>(value);
  out.count(texts.size());
  for (const std::string& text : texts) {
    out.text(text);
  }
}

RosParamValue read_param_value(ros2::CdrReader& in) {
  const auto type = in.number<std::uint8_t>("type");
  if (type > static_cast<std::uint8_t>(RosParamType::kStringArray)) {
    in.fail("type", "a number from 0 to 9", std::to_string(type));
  }
  // All of them are present; the type selects one.
  const bool boolean = in.boolean("bool_value");
  const auto integer = in.number<std::int64_t>("integer_value");
  const auto number = in.number<double>("double_value");
  std::string text = in.text("string_value");
  auto bytes = read_numbers<std::uint8_t>(in, "byte_array_value");
  const auto raw_bools = read_numbers<std::uint8_t>(in, "bool_array_value");
  auto integers = read_numbers<std::int64_t>(in, "integer_array_value");
  auto numbers = read_numbers<double>(in, "double_array_value");
  auto texts = read_texts(in, "string_array_value");
  switch (static_cast<RosParamType>(type)) {
    case RosParamType::kNotSet:
      return {};
    case RosParamType::kBool:
      return boolean;
    case RosParamType::kInteger:
      return integer;
    case RosParamType::kDouble:
      return number;
    case RosParamType::kString:
      return text;
    case RosParamType::kByteArray:
      return bytes;
    case RosParamType::kBoolArray:
      return std::vector<bool>(raw_bools.begin(), raw_bools.end());
    case RosParamType::kIntegerArray:
      return integers;
    case RosParamType::kDoubleArray:
      return numbers;
    case RosParamType::kStringArray:
      return texts;
  }
  return {};
}

std::vector<RosParam> read_params(ros2::CdrReader& in) {
  std::vector<RosParam> params(in.count("parameters", kParamBytes));
  for (RosParam& param : params) {
    param.name = in.text("name");
    param.value = read_param_value(in);
  }
  return params;
}

RosParamType ros_type_of(const ParamInfo& info) {
  std::string_view type = info.type;
  if (type.empty()) {
    return RosParamType::kNotSet;
  }
  const bool is_list = type.ends_with("[]");
  if (is_list) {
    type.remove_suffix(2);
  }
  if (type == "bool") {
    return is_list ? RosParamType::kBoolArray : RosParamType::kBool;
  }
  if (type == "integer") {
    return is_list ? RosParamType::kIntegerArray : RosParamType::kInteger;
  }
  if (type == "number") {
    return is_list ? RosParamType::kDoubleArray : RosParamType::kDouble;
  }
  return is_list && is_text(type) ? RosParamType::kStringArray : RosParamType::kString;
}

RosParamValue ros_value_of(const ParamInfo& info) {
  try {
    const Json json = Json::parse(info.json);
    switch (ros_type_of(info)) {
      case RosParamType::kBool:
        return json.get<bool>();
      case RosParamType::kInteger: {
        const auto one = list_of<std::int64_t>(Json::array({json}));
        return one ? RosParamValue(one->front()) : RosParamValue();
      }
      case RosParamType::kDouble:
        return json.get<double>();
      case RosParamType::kBoolArray:
        return value_of(list_of<bool>(json));
      case RosParamType::kIntegerArray:
        return value_of(list_of<std::int64_t>(json));
      case RosParamType::kDoubleArray:
        return value_of(list_of<double>(json));
      case RosParamType::kStringArray:
        return value_of(list_of<std::string>(json));
      case RosParamType::kString:
        return json.is_string() ? json.get<std::string>() : info.json;  // Of a message.
      case RosParamType::kByteArray:
      case RosParamType::kNotSet:
        break;
    }
  } catch (const Json::exception&) {
    // Does not match its type: not shown.
  }
  return {};
}

std::optional<std::string> json_of(const ParamInfo& info, const RosParamValue& value) {
  const auto dump = [](const Json& json) {
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
  };
  return std::visit(
      [&]<typename T>(const T& one) -> std::optional<std::string> {
        if constexpr (std::is_same_v<T, std::monostate>) {
          return {};
        } else if constexpr (std::is_same_v<T, double>) {
          return std::isfinite(one) ? std::optional(dump(one)) : std::nullopt;
        } else if constexpr (std::is_same_v<T, std::vector<double>>) {
          for (const double number : one) {
            if (!std::isfinite(number)) {
              return {};
            }
          }
          return dump(one);
        } else if constexpr (std::is_same_v<T, std::string>) {
          if (!info.type.starts_with("message ")) {
            return dump(one);
          }
          const Json json = Json::parse(one, nullptr, false);  // For a message its JSON.
          return json.is_discarded() ? std::nullopt : std::optional(dump(json));
        } else {
          return dump(one);
        }
      },
      value);
}

void write_descriptor(const ParamInfo& info, bool is_read_only, ros2::CdrWriter& out) {
  const RosParamType type = ros_type_of(info);
  out.text(info.param);
  out.number(static_cast<std::uint8_t>(type));
  out.text(info.unit.empty() ? info.description
                             : fmt::format("{}{}[{}]", info.description,
                                           info.description.empty() ? "" : " ", info.unit));
  out.text(!info.names.empty() ? fmt::format("one of {}", fmt::join(info.names, ", "))
           : info.type.starts_with("message ") ? fmt::format("JSON of the {}", info.type)
                                               : "");
  out.boolean(is_read_only);
  out.boolean(false);  // Its type never changes.

  const bool has_range = !info.min_json.empty() || !info.max_json.empty();
  const Json min = Json::parse(info.min_json, nullptr, false);
  const Json max = Json::parse(info.max_json, nullptr, false);
  const bool is_double = type == RosParamType::kDouble || type == RosParamType::kDoubleArray;
  const bool is_integer = type == RosParamType::kInteger || type == RosParamType::kIntegerArray;
  out.count(has_range && is_double ? 1 : 0);
  if (has_range && is_double) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    out.number(min.is_number() ? min.get<double>() : -kInfinity);
    out.number(max.is_number() ? max.get<double>() : kInfinity);
    out.number(0.0);  // Any step.
  }
  out.count(has_range && is_integer ? 1 : 0);
  if (has_range && is_integer) {
    using Limits = std::numeric_limits<std::int64_t>;
    const auto fits = [](const Json& json) {
      return json.is_number_integer() && list_of<std::int64_t>(Json::array({json})).has_value();
    };
    out.number(fits(min) ? min.get<std::int64_t>() : Limits::min());
    out.number(fits(max) ? max.get<std::int64_t>() : Limits::max());
    out.number(std::uint64_t{0});
  }
}

}  // namespace fastcycle::dds_gateway
