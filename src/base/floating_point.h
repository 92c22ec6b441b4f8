#pragma once

namespace fastcycle::base {

/// Sets rounding to nearest, no flush-to-zero, all exceptions masked, as a new thread has them.
///
/// A library built with `-ffast-math` sets flush-to-zero for the thread that loads it and all
/// threads created by it; the same component would then compute other numbers in another
/// application.
///
/// @threads  Safe: it changes the calling thread only.
/// @realtime Two register writes.
void reset_floating_point() noexcept;

}  // namespace fastcycle::base
