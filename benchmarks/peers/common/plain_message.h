#pragma once

#include <cstddef>

#include "peers/common/stamps.h"

namespace fastcycle::peers {

/// For peers that transfer bytes: the stamps, immediately followed by the payload.
struct PlainMessage {
  Stamps stamps;

  [[nodiscard]] unsigned char* data() noexcept {
    return reinterpret_cast<unsigned char*>(this) + sizeof(PlainMessage);
  }
  [[nodiscard]] const unsigned char* data() const noexcept {
    return reinterpret_cast<const unsigned char*>(this) + sizeof(PlainMessage);
  }
  /// The size of a message with a payload of `size` bytes.
  [[nodiscard]] static constexpr std::size_t bytes(std::size_t size) noexcept {
    return sizeof(PlainMessage) + size;
  }
};

/// An answer if a message cannot be forwarded: neither copied nor filled again, with only the
/// stamps and both ends of the payload set.
inline void answer_with(PlainMessage& answer, const PlainMessage& message,
                        std::size_t size) noexcept {
  answer.stamps = message.stamps;
  answer.data()[0] = message.data()[0];
  answer.data()[size - 1] = message.data()[size - 1];
}

}  // namespace fastcycle::peers
