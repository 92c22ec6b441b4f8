#pragma once

#include <cstddef>

#include <signal.h>

namespace fastcycle::base {

/// A stack of its own for the signal handlers of the calling thread, so that a thread whose stack
/// is used up can still say so. Where there is no memory for it, the thread goes without.
///
/// @threads  Made and destroyed on the thread that it is for.
class SignalStack {
 public:
  static constexpr std::size_t kSize = 64UL * 1024;

  SignalStack() noexcept;
  SignalStack(const SignalStack&) = delete;
  SignalStack& operator=(const SignalStack&) = delete;
  ~SignalStack();

 private:
  void* memory_ = nullptr;
  stack_t before_{};
};

}  // namespace fastcycle::base
