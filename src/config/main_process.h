#pragma once

#include <string_view>

namespace fastcycle::config {

/// What files and people call the process that was started, in which all components are that name
/// no other. In a description its name is empty.
inline constexpr std::string_view kMainProcess = "main";

}  // namespace fastcycle::config
