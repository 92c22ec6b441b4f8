#pragma once

#include "broker/subscription.h"
#include "component/component_state.h"
#include "fastcycle/component.h"

namespace fastcycle::host {

// The words in reports and in the output of tools.
[[nodiscard]] const char* to_word(detail::ComponentState state) noexcept;
[[nodiscard]] const char* to_word(Health health) noexcept;
[[nodiscard]] const char* to_word(detail::Subscription::Kind kind) noexcept;

}  // namespace fastcycle::host
