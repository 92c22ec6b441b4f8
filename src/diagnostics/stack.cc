#include "diagnostics/stack.h"

#include <algorithm>

#include <execinfo.h>
#include <ucontext.h>

namespace fastcycle::diagnostics {
namespace {

/// Where the thread stood, and where the call would return to that has just been made: an unwinder
/// finds no way from a jump to nowhere.
struct Place {
  std::uintptr_t at = 0;
  std::uintptr_t returns_to = 0;
};

Place place_of(const void* context) noexcept {
  const auto& registers = static_cast<const ucontext_t*>(context)->uc_mcontext;
#if defined(__x86_64__)
  Place place{.at = static_cast<std::uintptr_t>(registers.gregs[REG_RIP])};
  if (find_object(place.at) == nullptr) {
    const auto stack = static_cast<std::uintptr_t>(registers.gregs[REG_RSP]);
    if (stack % sizeof(std::uintptr_t) == 0 && stack != 0) {
      place.returns_to = *reinterpret_cast<const std::uintptr_t*>(stack);
    }
  }
  return place;
#elif defined(__aarch64__)
  return {.at = static_cast<std::uintptr_t>(registers.pc),
          .returns_to = static_cast<std::uintptr_t>(registers.regs[30])};
#else
  return {};
#endif
}

}  // namespace

void prepare_stacks() noexcept {
  RawStack ignored;
  read_stack(nullptr, ignored);  // Its first call loads the unwinder.
}

void read_stack(const void* context, RawStack& stack) noexcept {
  const int count = backtrace(stack.addresses.data(), static_cast<int>(stack.addresses.size()));
  stack.count = static_cast<std::size_t>(std::max(count, 0));
  stack.stands_at = 0;
  if (context == nullptr) {
    return;
  }
  const Place place = place_of(context);
  stack.stands_at = place.at;
  const auto used = std::span(stack.addresses).first(stack.count);
  const auto found = std::ranges::find(used, reinterpret_cast<void*>(place.at));
  if (found != used.end() && (place.returns_to == 0 || found + 1 != used.end())) {
    const auto skipped = static_cast<std::size_t>(found - used.begin());
    std::copy(found, used.end(), stack.addresses.begin());
    stack.count -= skipped;
    return;
  }
  stack.addresses[0] = reinterpret_cast<void*>(place.at);
  stack.addresses[1] = reinterpret_cast<void*>(place.returns_to);
  stack.count = place.returns_to == 0 ? 1 : 2;
}

std::size_t to_frames(const RawStack& stack, std::span<Frame> frames) noexcept {
  const std::size_t count = std::min(stack.count, frames.size());
  for (std::size_t i = 0; i < count; ++i) {
    frames[i] = {};
    frames[i].address = reinterpret_cast<std::uintptr_t>(stack.addresses[i]);
    frames[i].is_exact = i == 0 && stack.stands_at != 0;
  }
  name_frames(frames.first(count));
  return count;
}

}  // namespace fastcycle::diagnostics
