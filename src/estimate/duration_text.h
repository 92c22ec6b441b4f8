#pragma once

#include <string>

#include "estimate/model.h"

namespace fastcycle::estimate {

/// `3.20 ms`, for people.
[[nodiscard]] std::string text_of(Duration span);

}  // namespace fastcycle::estimate
