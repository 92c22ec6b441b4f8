#pragma once

namespace fastcycle::sandbox {

/// The highest system call number known to the filter. Sandboxed processes cannot use later ones.
inline constexpr int kLastKnownCall = 469;

/// The name of a system call of this architecture, such as `socket`; null if unknown.
///
/// @threads  Safe, also in a signal handler.
[[nodiscard]] const char* name_of_call(int call) noexcept;

}  // namespace fastcycle::sandbox
