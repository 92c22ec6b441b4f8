#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "diagnostics/loaded_objects.h"

namespace fastcycle::diagnostics {

inline constexpr std::size_t kMaxFrames = 48;

/// Where the calling thread stands, as addresses that mean nothing yet.
struct RawStack {
  std::array<void*, kMaxFrames + 8> addresses{};
  std::size_t count = 0;
  std::uintptr_t stands_at = 0;  ///< Where a signal interrupted it; 0: none did.
};

/// Loads what `read_stack` needs; before the first signal.
void prepare_stacks() noexcept;

/// The stack of the calling thread; `context` is what a signal handler got as its third argument,
/// or null. For signal handlers.
void read_stack(const void* context, RawStack& stack) noexcept;

/// Writes what `stack` means into `frames`, innermost first, without the frames of the handler;
/// returns how many there are.
std::size_t to_frames(const RawStack& stack, std::span<Frame> frames) noexcept;

}  // namespace fastcycle::diagnostics
