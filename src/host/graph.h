#pragma once

#include <string>

#include "host/application.h"

namespace fastcycle::host {

/// The components and topics of `application`, which is built, as a graph in Graphviz's DOT:
/// components are boxes, topics ellipses; what comes from one namespace stands in one frame.
[[nodiscard]] std::string to_dot(const Application& application);

}  // namespace fastcycle::host
