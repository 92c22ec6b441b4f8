#pragma once

namespace fastcycle::sandbox {

/// The highest number of a system call that the filter knows. What a kernel has beyond it does not
/// exist for a sandboxed process.
inline constexpr int kLastKnownCall = 469;

/// The name of a system call of this architecture, such as `socket`; null where none is known.
///
/// @threads  Safe, also in a signal handler.
[[nodiscard]] const char* name_of_call(int call) noexcept;

}  // namespace fastcycle::sandbox
