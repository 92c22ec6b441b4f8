#pragma once

#include <string>

#include "campaign/summary.h"

namespace fastcycle::campaign {

/// The results as a self-contained page: a map of failures by fault and time, the table, the
/// failures.
[[nodiscard]] std::string to_page(const Summary& summary);

}  // namespace fastcycle::campaign
