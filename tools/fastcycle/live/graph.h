#pragma once

#include <string>

#include "fastcycle/time.h"
#include "live/session.h"

namespace fastcycle::tool::live {

/// The graph of a running application, with its rates, latencies and losses within `span`.
[[nodiscard]] std::string graph_of(const Target& target, Duration span);

}  // namespace fastcycle::tool::live
