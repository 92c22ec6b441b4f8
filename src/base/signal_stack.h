#pragma once

#include <cstddef>

#include <signal.h>

namespace fastcycle::base {

/// An alternate signal stack of the calling thread, so that a stack overflow can be reported.
/// Without memory for it, the thread has none.
///
/// @threads  Constructed and destroyed on its thread.
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
