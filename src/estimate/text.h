#pragma once

#include <string>

#include "estimate/analysis.h"
#include "estimate/model.h"

namespace fastcycle::estimate {

/// The estimate for people: a table of the hops of each chain, and why it does not hold.
[[nodiscard]] std::string to_text(const System& system, const Estimate& estimate);

/// The estimate for machines: one JSON document; docs/reference/estimate.md has its format.
[[nodiscard]] std::string to_json(const System& system, const Estimate& estimate);

}  // namespace fastcycle::estimate
