#pragma once

#include "broker/subscription.h"
#include "fastcycle/component.h"
#include "host/component_core.h"

namespace fastcycle::host {

// The words of reports, and of all else that tools say.
[[nodiscard]] const char* to_word(detail::ComponentCore::State state) noexcept;
[[nodiscard]] const char* to_word(Health health) noexcept;
[[nodiscard]] const char* to_word(detail::Subscription::Kind kind) noexcept;

}  // namespace fastcycle::host
