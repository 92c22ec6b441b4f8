#pragma once

namespace fastcycle::base {

/// Asks for the cache line at `address` in a state that a write needs no second transfer for, if
/// another CPU has it. An address that is not mapped does no harm.
///
/// @realtime One instruction, no wait.
inline void prefetch_for_writing(const void* address) noexcept {
#if defined(__x86_64__)
  // The compiler emits `prefetchw` only for CPUs that are named to have it, and else a prefetch for
  // reading, which costs a second transfer at the write. CPUs without it execute it as a no-op
  // (Intel SDM volume 2, PREFETCHW; AMD64 APM volume 3, PREFETCH).
  asm volatile("prefetchw (%0)" : : "r"(address));
#else
  __builtin_prefetch(address, 1);
#endif
}

}  // namespace fastcycle::base
