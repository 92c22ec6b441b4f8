#pragma once

#include <string>

#include "archive/message_type.h"

namespace fastcycle::tool::live {

/// The message of this type described by `json`, serialized. Throws a `Failure` that reports what
/// is wrong and lists the fields if `json` does not fit.
[[nodiscard]] std::string serialized_from_json(const archive::MessageType& type,
                                               const std::string& json);

}  // namespace fastcycle::tool::live
