#pragma once

#include <cstdint>

#include "fastcycle/component.h"

/// gdb stops here for `fastcycle debug`: the next activation to run is this one of `object`. Does
/// nothing.
extern "C" void fastcycle_before_activation(const char* component, std::uint64_t activation,
                                            const fastcycle::Component* object);
