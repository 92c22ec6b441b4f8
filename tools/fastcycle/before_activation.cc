#include "before_activation.h"

#include <cstdint>

extern "C" [[gnu::noinline]] void fastcycle_before_activation(
    [[maybe_unused]] const char* component, [[maybe_unused]] std::uint64_t activation,
    [[maybe_unused]] const fastcycle::Component* object) {
  asm volatile("" : : : "memory");  // Or the call would be left out.
}
