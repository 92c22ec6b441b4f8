#pragma once

#include "diagnostics/text_buffer.h"
#include "executor/activation.h"

namespace fastcycle::diagnostics {

/// What the thread that calls this does for `running`'s component, in words: `its callback for
/// "speed"`, `its timer "plan"`, `its start()`. For signal handlers.
void describe_call(const detail::RunningActivation& running, TextBuffer& text) noexcept;

/// What that call was given: `message 12 of "speed" from "wheels", published 0.2 ms before`.
/// Nothing if there is nothing to say. For signal handlers.
void describe_cause(const detail::RunningActivation& running, TextBuffer& text) noexcept;

}  // namespace fastcycle::diagnostics
