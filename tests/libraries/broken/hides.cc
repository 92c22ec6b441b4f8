// Closes every file, as a daemon does, and never comes back from being loaded.

#include <unistd.h>

#include "harmless.h"

namespace {

[[maybe_unused]] const bool kLoaded = [] {
  for (int descriptor = 0; descriptor < 256; ++descriptor) {
    close(descriptor);
  }
  for (;;) {
    pause();
  }
  return true;
}();

}  // namespace

FASTCYCLE_COMPONENT(broken::Harmless)
