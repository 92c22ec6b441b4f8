#pragma once

namespace fastcycle::detail {

/// Prints the violated rule with its location and ends the process by `abort`.
[[noreturn]] void assertion_failed(const char* condition, const char* rule, const char* file,
                                   int line) noexcept;

/// The same for a contract that `what` describes in full: the caller, the violation, and what to do
/// instead.
[[noreturn]] void contract_broken(const char* what) noexcept;

}  // namespace fastcycle::detail

/// Ends the process when `condition` does not hold, in every build: the caller violated the
/// contract that `rule` states, and the program's state cannot be trusted.
#define FASTCYCLE_ASSERT(condition, rule) \
  (static_cast<bool>(condition)           \
       ? static_cast<void>(0)             \
       : ::fastcycle::detail::assertion_failed(#condition, rule, __FILE__, __LINE__))
