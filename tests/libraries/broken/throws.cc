// Throws while it is loaded, where nobody can catch it.

#include <stdexcept>

#include "harmless.h"

namespace {

[[maybe_unused]] const bool kLoaded = [] {
  throw std::runtime_error("there is no such device");
  return true;
}();

}  // namespace

FASTCYCLE_COMPONENT(broken::Harmless)
