// An entry function that offers no class.

#include "note.h"

BROKEN_NOTE(FASTCYCLE_BUILD_NOTE)

extern "C" __attribute__((visibility("default"))) const fastcycle::ComponentLibrary*
fastcycle_component_library_v1() {
  static constexpr fastcycle::ComponentLibrary kLibrary{fastcycle::kInterfaceVersion, 0, nullptr};
  return &kLibrary;
}
