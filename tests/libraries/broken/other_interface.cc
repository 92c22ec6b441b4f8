// An entry function of a later FastCycle.

#include "note.h"

BROKEN_NOTE(FASTCYCLE_BUILD_NOTE)

extern "C" __attribute__((visibility("default"))) const fastcycle::ComponentLibrary*
fastcycle_component_library_v1() {
  static constexpr fastcycle::ComponentLibrary kLibrary{fastcycle::kInterfaceVersion + 98, 1,
                                                        nullptr};
  return &kLibrary;
}
