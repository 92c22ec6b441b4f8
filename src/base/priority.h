#pragma once

namespace fastcycle::base {

/// Makes the calling thread one of low priority, for work that serves people and no component: nice
/// 10, or what it has if that is lower, and long time slices. Since Linux 6.12 a thread with
/// shorter slices that wakes up takes the place of one with longer slices at once; of one with
/// equally long slices only when these are over, however low its priority is.
void give_way() noexcept;

}  // namespace fastcycle::base
