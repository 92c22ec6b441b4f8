#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "diagnostics/loaded_objects.h"

namespace fastcycle::diagnostics {

inline constexpr std::size_t kMaxFrames = 48;

/// The stack of the calling thread, as unresolved addresses.
struct RawStack {
  std::array<void*, kMaxFrames + 8> addresses{};
  std::size_t count = 0;
  std::uintptr_t stands_at = 0;  ///< The address interrupted by a signal; 0: none.
};

/// Prepares `read_stack`; before the first signal.
void prepare_stacks() noexcept;

/// The stack of the calling thread; `context` is the third argument of a signal handler, or null.
/// For signal handlers.
void read_stack(const void* context, RawStack& stack) noexcept;

/// Resolves `stack` to `frames`, innermost first, without the frames of the handler; returns how
/// many there are.
std::size_t to_frames(const RawStack& stack, std::span<Frame> frames) noexcept;

}  // namespace fastcycle::diagnostics
