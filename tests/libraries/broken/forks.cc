// Leaves a process behind that keeps all files open, and is loaded without an error.

#include <unistd.h>

#include "harmless.h"

namespace {

[[maybe_unused]] const bool kLoaded = [] {
  if (fork() == 0) {
    for (;;) {
      pause();
    }
  }
  return true;
}();

}  // namespace

FASTCYCLE_COMPONENT(broken::Harmless)
