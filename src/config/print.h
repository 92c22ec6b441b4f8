#pragma once

#include <string>

#include "config/value.h"

namespace fastcycle::config {

/// `value` as JSON text with a comment after each value that states where it was written:
///
///     "limit_mps": 20,  // --set limiter.limit_mps=20
///
/// The text can be loaded again. Relative paths are unchanged, so it has to be saved in the folder
/// that they are relative to.
[[nodiscard]] std::string print(const Value& value);

}  // namespace fastcycle::config
