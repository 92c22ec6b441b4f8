#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "fastcycle/param_list.h"
#include "params/param_table.h"

namespace fastcycle::host {

/// The type of a parameter in words: "number", "integer[]", "message demo.Limits".
[[nodiscard]] std::string type_of(const detail::ParamSpec& spec);

/// The view of `param` for others than its component. @pre The mutex is held.
[[nodiscard]] ParamInfo info_of(const std::string& component, const DeclaredParam& param);

/// A parameter of a component in another process, for tools.
struct RemoteParam {
  ParamInfo info;
  std::string default_json;  ///< Empty: none.
  ParamOrigin origin = ParamOrigin::kFallback;
  config::Place place;
};

/// The view of `param` for other processes. @pre The mutex is held.
[[nodiscard]] RemoteParam remote_of(const std::string& component, const DeclaredParam& param);

/// Serializes a list of them, and parses it. Invalid text yields an empty list.
[[nodiscard]] std::string to_text(const std::vector<ParamInfo>& infos);
[[nodiscard]] std::string to_text(const std::vector<RemoteParam>& params);
[[nodiscard]] std::vector<ParamInfo> infos_of(std::string_view text);
[[nodiscard]] std::vector<RemoteParam> remote_params_of(std::string_view text);

}  // namespace fastcycle::host
