#pragma once

#include <string>

#include "config/value.h"

namespace fastcycle::config {

/// `value` as JSON text in which a comment after each value says where it was written:
///
///     "limit_mps": 20,  // --set limiter.limit_mps=20
///
/// The text can be loaded again. Relative paths stay as they are written, so it has to be saved
/// beside the files that they were relative to.
[[nodiscard]] std::string print(const Value& value);

}  // namespace fastcycle::config
