#include "params/param_info.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "params/param_value.h"

namespace fastcycle::host {

using detail::ParamKind;
using detail::ParamSpec;
using Json = nlohmann::json;

namespace {

template <typename Value>
std::string dumped(const Value& value) {
  return value.dump(-1, ' ', false, Value::error_handler_t::replace);
}

Json array_of(const ParamInfo& info) {
  return Json::array({info.param, info.type, info.json, info.min_json, info.max_json, info.names,
                      info.unit, info.description, info.is_tunable});
}

ParamInfo info_of_array(const Json& one) {
  ParamInfo info;
  one.at(0).get_to(info.param);
  one.at(1).get_to(info.type);
  one.at(2).get_to(info.json);
  one.at(3).get_to(info.min_json);
  one.at(4).get_to(info.max_json);
  one.at(5).get_to(info.names);
  one.at(6).get_to(info.unit);
  one.at(7).get_to(info.description);
  one.at(8).get_to(info.is_tunable);
  return info;
}

template <typename Value, typename Read>
std::vector<Value> list_of(std::string_view text, const Read& read) {
  std::vector<Value> list;
  try {
    for (const Json& one : Json::parse(text)) {
      list.push_back(read(one));
    }
  } catch (const Json::exception&) {
    list.clear();
  }
  return list;
}

}  // namespace

std::string type_of(const ParamSpec& spec) {
  const auto word = [&]() -> std::string {
    switch (spec.kind) {
      case ParamKind::kBool:
        return "bool";
      case ParamKind::kSigned:
      case ParamKind::kUnsigned:
        return "integer";
      case ParamKind::kDouble:
        return "number";
      case ParamKind::kString:
        return "string";
      case ParamKind::kPath:
        return "path";
      case ParamKind::kEnum:
        return "enum";
      case ParamKind::kMessage:
        return "message " + spec.prototype->GetTypeName();
    }
    return {};
  };
  return word() + (spec.is_vector ? "[]" : "");
}

ParamInfo info_of(const std::string& component, const DeclaredParam& param) {
  const ParamSpec& spec = param.spec();
  ParamInfo info{.param = component + "." + spec.name,
                 .type = type_of(spec),
                 .json = to_text(spec, param.committed),
                 .names = spec.names,
                 .unit = spec.unit,
                 .description = spec.description,
                 .is_tunable = spec.is_tunable};
  if (spec.min && spec.has_own_min) {
    info.min_json = dumped(to_json(spec, *spec.min));
  }
  if (spec.max && spec.has_own_max) {
    info.max_json = dumped(to_json(spec, *spec.max));
  }
  return info;
}

RemoteParam remote_of(const std::string& component, const DeclaredParam& param) {
  const ParamSpec& spec = param.spec();
  return {.info = info_of(component, param),
          .default_json = spec.fallback ? dumped(to_json(spec, *spec.fallback)) : "",
          .origin = param.origin,
          .place = param.place};
}

std::string to_text(const std::vector<ParamInfo>& infos) {
  Json list = Json::array();
  for (const ParamInfo& info : infos) {
    list.push_back(array_of(info));
  }
  return dumped(list);
}

std::string to_text(const std::vector<RemoteParam>& params) {
  Json list = Json::array();
  for (const RemoteParam& param : params) {
    list.push_back(Json::array({array_of(param.info), param.default_json, param.origin,
                                param.place.file, param.place.line, param.place.pointer}));
  }
  return dumped(list);
}

std::vector<ParamInfo> infos_of(std::string_view text) {
  return list_of<ParamInfo>(text, info_of_array);
}

std::vector<RemoteParam> remote_params_of(std::string_view text) {
  return list_of<RemoteParam>(text, [](const Json& one) {
    return RemoteParam{.info = info_of_array(one.at(0)),
                       .default_json = one.at(1).get<std::string>(),
                       .origin = one.at(2).get<ParamOrigin>(),
                       .place = {.file = one.at(3).get<std::string>(),
                                 .line = one.at(4).get<int>(),
                                 .pointer = one.at(5).get<std::string>()}};
  });
}

}  // namespace fastcycle::host
