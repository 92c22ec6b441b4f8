#include "base/signal_stack.h"

#include <sys/mman.h>

namespace fastcycle::base {
namespace {

constexpr std::size_t kGuard = 4096;  // Below it, so that an overflow of this one ends there.

}  // namespace

SignalStack::SignalStack() noexcept {
  void* const memory = mmap(nullptr, kGuard + kSize, PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS | MAP_STACK, -1, 0);
  if (memory == MAP_FAILED) {
    return;
  }
  mprotect(memory, kGuard, PROT_NONE);
  stack_t stack{};
  stack.ss_sp = static_cast<std::byte*>(memory) + kGuard;
  stack.ss_size = kSize;
  if (sigaltstack(&stack, &before_) != 0) {
    munmap(memory, kGuard + kSize);
    return;
  }
  memory_ = memory;
}

SignalStack::~SignalStack() {
  if (memory_ != nullptr) {
    sigaltstack(&before_, nullptr);
    munmap(memory_, kGuard + kSize);
  }
}

}  // namespace fastcycle::base
