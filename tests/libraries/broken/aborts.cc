// Aborts while it is loaded.

#include <cstdio>
#include <cstdlib>

#include "harmless.h"

namespace {

[[maybe_unused]] const bool kLoaded = [] {
  std::fputs("the licence has run out\n", stderr);
  std::abort();
  return true;
}();

}  // namespace

FASTCYCLE_COMPONENT(broken::Harmless)
