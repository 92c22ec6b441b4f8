#pragma once

#include <string>

#include "campaign/summary.h"

namespace fastcycle::campaign {

/// What was found as a page of its own, which needs nothing else: a map of what failed when, the
/// table, the failures.
[[nodiscard]] std::string to_page(const Summary& summary);

}  // namespace fastcycle::campaign
