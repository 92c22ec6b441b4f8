#include "params/param_info.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "params/param_value.h"

namespace fastcycle::host {

using detail::ParamKind;
using detail::ParamSpec;
using Json = nlohmann::json;

namespace {

std::string dumped(const nlohmann::ordered_json& value) {
  return value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
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

std::string to_text(const std::vector<ParamInfo>& infos) {
  Json list = Json::array();
  for (const ParamInfo& info : infos) {
    list.push_back(Json::array({info.param, info.type, info.json, info.min_json, info.max_json,
                                info.names, info.unit, info.description, info.is_tunable}));
  }
  return list.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::vector<ParamInfo> infos_of(std::string_view text) {
  std::vector<ParamInfo> infos;
  try {
    for (const Json& one : Json::parse(text)) {
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
      infos.push_back(std::move(info));
    }
  } catch (const Json::exception&) {
    infos.clear();
  }
  return infos;
}

}  // namespace fastcycle::host
