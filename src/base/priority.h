#pragma once

#include <chrono>

namespace fastcycle::base {

/// Sets the time slice of the calling thread, which has an ordinary policy. Since Linux 6.12 a
/// waking thread with shorter slices preempts one with longer slices at once, but one with equal
/// slices only at the end of a slice or if it had less than its share of the CPU, regardless of
/// nice. (EEVDF; `PREEMPT_SHORT` in the kernel's kernel/sched/fair.c.)
///
/// @param slice  100 µs to 100 ms.
/// @returns false where the kernel has no such slices.
bool set_time_slice(std::chrono::nanoseconds slice) noexcept;

/// Lowers the priority of the calling thread, for work that serves users and no component: nice 10,
/// unless its priority is lower already, and long time slices.
void give_way() noexcept;

}  // namespace fastcycle::base
