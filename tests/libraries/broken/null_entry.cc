// An entry function that returns nothing.

#include "note.h"

BROKEN_NOTE(FASTCYCLE_BUILD_NOTE)

extern "C" __attribute__((visibility("default"))) const fastcycle::ComponentLibrary*
fastcycle_component_library_v1() {
  return nullptr;
}
