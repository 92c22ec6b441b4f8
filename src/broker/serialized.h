#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <google/protobuf/message.h>

#include "base/shared_memory.h"

namespace fastcycle::detail {

/// Bytes of a published message, serialized.
///
/// protobuf stores the computed sizes of a message in it. A message of another process cannot be
/// written here; its sizes were stored before it was handed over.
///
/// @threads  Safe for a message that no thread changes.
[[nodiscard]] inline std::size_t serialized_size(const google::protobuf::Message& published) {
  const bool is_of_others =
      base::shared_memory.has(&published) && !base::shared_memory.is_own(&published);
  return is_of_others ? static_cast<std::size_t>(published.GetCachedSize())
                      : published.ByteSizeLong();
}

/// Serializes a published message to `bytes`, even if it lacks required fields.
inline void serialize(const google::protobuf::Message& published, std::string& bytes) {
  bytes.resize(serialized_size(published));
  published.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(bytes.data()));
}

}  // namespace fastcycle::detail
