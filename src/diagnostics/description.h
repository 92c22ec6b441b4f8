#pragma once

#include "diagnostics/text_buffer.h"
#include "executor/activation.h"

namespace fastcycle::diagnostics {

/// Describes what the calling thread does for `running`'s component: `its callback for "speed"`,
/// `its timer "plan"`, `its start()`. For signal handlers.
void describe_call(const detail::RunningActivation& running, TextBuffer& text) noexcept;

/// Describes the cause of that call:
/// `message 12 of "speed" from "wheels", published 0.2 ms before`. Nothing if it has none. For
/// signal handlers.
void describe_cause(const detail::RunningActivation& running, TextBuffer& text) noexcept;

}  // namespace fastcycle::diagnostics
