// A library with the entry function, made without the macro: it has no build note.

#include "harmless.h"

extern "C" __attribute__((visibility("default"))) const fastcycle::ComponentLibrary*
fastcycle_component_library_v1() {
  return fastcycle::detail::library_of<broken::Harmless>("Harmless");
}
