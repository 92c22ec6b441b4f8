#pragma once

#include <string_view>

namespace fastcycle::config {

/// The name of the process that was started, which has all components that name no other. In a
/// description its name is empty.
inline constexpr std::string_view kMainProcess = "main";

}  // namespace fastcycle::config
