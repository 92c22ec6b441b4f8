#pragma once

#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "config/problem.h"
#include "config/value.h"
#include "fastcycle/detail/param_slot.h"

namespace fastcycle::host {

/// `value` converted to the parameter's type; none after adding the errors to `problems`.
[[nodiscard]] std::optional<detail::ParamData> read_param(const detail::ParamSpec& spec,
                                                          const config::Value& value,
                                                          config::Problems& problems);

/// The fallback, else a placeholder of the right type, for when an error will keep the application
/// from starting.
[[nodiscard]] detail::ParamData fallback_of(const detail::ParamSpec& spec);

/// `data` as the application file would write it.
[[nodiscard]] nlohmann::ordered_json to_json(const detail::ParamSpec& spec,
                                             const detail::ParamData& data);
/// The same as compact text.
[[nodiscard]] std::string to_text(const detail::ParamSpec& spec, const detail::ParamData& data);

/// A single element, a limit for example.
[[nodiscard]] nlohmann::ordered_json to_json(const detail::ParamSpec& spec,
                                             const detail::ParamElementValue& value);

}  // namespace fastcycle::host
