#pragma once

namespace fastcycle::base {

/// Lowers the priority of the calling thread, for work that serves users and no component: nice 10,
/// unless its priority is lower already, and long time slices. Since Linux 6.12 a waking thread
/// with shorter slices preempts one with longer slices at once, but one with equal slices only at
/// the end of a slice, regardless of nice.
void give_way() noexcept;

}  // namespace fastcycle::base
