// Never comes back from being loaded.

#include <unistd.h>

#include "harmless.h"

namespace {

[[maybe_unused]] const bool kLoaded = [] {
  for (;;) {
    pause();
  }
  return true;
}();

}  // namespace

FASTCYCLE_COMPONENT(broken::Harmless)
