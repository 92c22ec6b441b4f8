#pragma once

#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "config/problem.h"
#include "config/value.h"
#include "fastcycle/detail/param_slot.h"

namespace fastcycle::host {

/// `value` as the parameter wants it; none after adding to `problems` what does not fit.
[[nodiscard]] std::optional<detail::ParamData> read_param(const detail::ParamSpec& spec,
                                                          const config::Value& value,
                                                          config::Problems& problems);

/// The fallback, else something of the right type to go on with when a mistake will keep the
/// application from starting.
[[nodiscard]] detail::ParamData fallback_of(const detail::ParamSpec& spec);

/// `data` as it would stand in the application file.
[[nodiscard]] nlohmann::ordered_json to_json(const detail::ParamSpec& spec,
                                             const detail::ParamData& data);
/// The same as compact text.
[[nodiscard]] std::string to_text(const detail::ParamSpec& spec, const detail::ParamData& data);

/// One value of it, a limit for example.
[[nodiscard]] nlohmann::ordered_json to_json(const detail::ParamSpec& spec,
                                             const detail::ParamElementValue& value);

}  // namespace fastcycle::host
