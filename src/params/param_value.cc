#include "params/param_value.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <variant>

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "config/params.h"
#include "fastcycle/params.h"

namespace fastcycle::host {

using config::Problems;
using config::Value;
using detail::ParamData;
using detail::ParamElementValue;
using detail::ParamKind;
using detail::ParamSpec;

namespace {

template <typename T>
config::Range<T> range_of(const ParamSpec& spec) {
  config::Range<T> range;
  if (spec.min) {
    range.min = std::get<T>(*spec.min);
  }
  if (spec.max) {
    range.max = std::get<T>(*spec.max);
  }
  return range;
}

std::optional<ParamElementValue> read_element(const ParamSpec& spec, const Value& value,
                                              Problems& problems) {
  switch (spec.kind) {
    case ParamKind::kBool:
      return config::to_bool(value, problems);
    case ParamKind::kSigned:
      return config::to_int64(value, range_of<std::int64_t>(spec), problems);
    case ParamKind::kUnsigned:
      return config::to_uint64(value, range_of<std::uint64_t>(spec), problems);
    case ParamKind::kDouble:
      return config::to_double(value, range_of<double>(spec), problems);
    case ParamKind::kEnum:
      if (const auto index = config::to_choice(value, spec.names, problems)) {
        return static_cast<std::int64_t>(*index);
      }
      return std::nullopt;
    case ParamKind::kString:
    case ParamKind::kPath:
      if (const auto text = config::to_text(value, problems)) {
        return spec.kind == ParamKind::kPath ? value.as_path().string() : *text;
      }
      return std::nullopt;
    case ParamKind::kMessage:
      break;
  }
  return std::nullopt;
}

std::optional<ParamData> read_message(const ParamSpec& spec, const Value& value,
                                      Problems& problems) {
  std::shared_ptr<google::protobuf::Message> message(spec.prototype->New());
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = false;
  const auto status =
      google::protobuf::util::JsonStringToMessage(value.to_text(), message.get(), options);
  if (!status.ok()) {
    config::Problem problem =
        config::unexpected(value, "a message " + message->GetTypeName() + " as JSON");
    problem.hint = std::string(status.message());
    problems.add(std::move(problem));
    return std::nullopt;
  }
  return ParamData{.message = std::move(message)};
}

std::optional<ParamData> read_vector(const ParamSpec& spec, const Value& value,
                                     Problems& problems) {
  if (!value.is_array()) {
    problems.add(config::unexpected(value, "a list"));
    return std::nullopt;
  }
  ParamData data;
  for (const Value& item : value.items()) {
    if (auto element = read_element(spec, item, problems)) {
      data.elements.push_back(std::move(*element));
    }
  }
  return data.elements.size() == value.size() ? std::optional(std::move(data)) : std::nullopt;
}

ParamElementValue empty_element(ParamKind kind) {
  switch (kind) {
    case ParamKind::kBool:
      return false;
    case ParamKind::kSigned:
    case ParamKind::kEnum:
      return std::int64_t{0};
    case ParamKind::kUnsigned:
      return std::uint64_t{0};
    case ParamKind::kDouble:
      return 0.0;
    case ParamKind::kString:
    case ParamKind::kPath:
    case ParamKind::kMessage:
      break;
  }
  return std::string();
}

}  // namespace

std::optional<ParamData> read_param(const ParamSpec& spec, const Value& value, Problems& problems) {
  if (spec.kind == ParamKind::kMessage) {
    return read_message(spec, value, problems);
  }
  if (spec.is_vector) {
    return read_vector(spec, value, problems);
  }
  if (auto element = read_element(spec, value, problems)) {
    return ParamData{.elements = {std::move(*element)}};
  }
  return std::nullopt;
}

ParamData fallback_of(const ParamSpec& spec) {
  if (spec.fallback) {
    return *spec.fallback;
  }
  ParamData data;
  if (spec.kind == ParamKind::kMessage) {
    data.message.reset(spec.prototype->New());
  } else if (!spec.is_vector) {
    data.elements.push_back(empty_element(spec.kind));
  }
  return data;
}

nlohmann::ordered_json to_json(const ParamSpec& spec, const ParamElementValue& value) {
  if (spec.kind == ParamKind::kEnum) {
    const auto index = static_cast<std::size_t>(std::get<std::int64_t>(value));
    return index < spec.names.size() ? nlohmann::ordered_json(spec.names[index])
                                     : nlohmann::ordered_json();
  }
  return std::visit([](const auto& plain) { return nlohmann::ordered_json(plain); }, value);
}

nlohmann::ordered_json to_json(const ParamSpec& spec, const ParamData& data) {
  if (spec.kind == ParamKind::kMessage) {
    std::string text;
    google::protobuf::util::JsonPrintOptions options;
    options.preserve_proto_field_names = true;
    static_cast<void>(google::protobuf::util::MessageToJsonString(*data.message, &text, options));
    auto parsed = nlohmann::ordered_json::parse(text, nullptr, false);
    return parsed.is_discarded() ? nlohmann::ordered_json() : parsed;
  }
  if (!spec.is_vector) {
    return to_json(spec, data.elements.at(0));
  }
  auto list = nlohmann::ordered_json::array();
  for (const ParamElementValue& element : data.elements) {
    list.push_back(to_json(spec, element));
  }
  return list;
}

std::string to_text(const ParamSpec& spec, const ParamData& data) {
  return to_json(spec, data).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace fastcycle::host

namespace fastcycle {

std::string param_json(bool value) {
  return value ? "true" : "false";
}
std::string param_json(double value) {
  return nlohmann::json(value).dump();
}
std::string param_json(const std::string& value) {
  return nlohmann::json(value).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace fastcycle
