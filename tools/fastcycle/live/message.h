#pragma once

#include <string>

#include "archive/message_type.h"

namespace fastcycle::tool::live {

/// The message of this type that `json` says, serialized; else a `Failure` that says what is wrong,
/// and which fields there are.
[[nodiscard]] std::string serialized_from_json(const archive::MessageType& type,
                                               const std::string& json);

}  // namespace fastcycle::tool::live
