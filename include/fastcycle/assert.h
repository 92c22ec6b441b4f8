#pragma once

namespace fastcycle::detail {

/// Prints the broken rule with its place and ends the process by `abort`.
[[noreturn]] void assertion_failed(const char* condition, const char* rule, const char* file,
                                   int line) noexcept;

/// The same of a contract that `what` names in full: who broke it, how, and what to do instead.
[[noreturn]] void contract_broken(const char* what) noexcept;

}  // namespace fastcycle::detail

/// Ends the process when `condition` does not hold, in every build: the caller broke the contract
/// that `rule` states, and nothing that follows could be trusted.
#define FASTCYCLE_ASSERT(condition, rule) \
  (static_cast<bool>(condition)           \
       ? static_cast<void>(0)             \
       : ::fastcycle::detail::assertion_failed(#condition, rule, __FILE__, __LINE__))
