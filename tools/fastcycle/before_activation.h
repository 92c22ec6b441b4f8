#pragma once

#include <cstdint>

#include "fastcycle/component.h"

/// Where gdb stops for `fastcycle debug`: the next thing that happens is this activation of
/// `object`. Does nothing.
extern "C" void fastcycle_before_activation(const char* component, std::uint64_t activation,
                                            const fastcycle::Component* object);
