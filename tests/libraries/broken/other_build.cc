// A library that was built with something else; the build file says with what. It would end the
// process if anybody loaded it.

#include <cstdlib>

#include "harmless.h"

// The note is put together from these where it is used.
#if defined(BROKEN_OTHER_VERSION)
#undef FASTCYCLE_VERSION_MAJOR
#define FASTCYCLE_VERSION_MAJOR 99
#elif defined(BROKEN_OTHER_PROTOBUF)
#undef GOOGLE_PROTOBUF_VERSION
#define GOOGLE_PROTOBUF_VERSION 1002003
#elif defined(BROKEN_OTHER_SANITIZER)
#undef FASTCYCLE_SANITIZER
#define FASTCYCLE_SANITIZER "another"
#endif

namespace {

[[maybe_unused]] const bool kLoaded = [] {
  std::abort();
  return true;
}();

}  // namespace

FASTCYCLE_COMPONENT(broken::Harmless)
