// Never comes back from being loaded, and writes to standard error all the time.

#include <cstdio>

#include "harmless.h"

namespace {

[[maybe_unused]] const bool kLoaded = [] {
  for (;;) {
    std::fputs("waiting for the device\n", stderr);
  }
  return true;
}();

}  // namespace

FASTCYCLE_COMPONENT(broken::Harmless)
