#pragma once

#include <cstddef>

#include "peers/common/stamps.h"

namespace fastcycle::peers {

/// For peers that move bytes: the stamps, and right behind them the payload.
struct PlainMessage {
  Stamps stamps;

  [[nodiscard]] unsigned char* data() noexcept {
    return reinterpret_cast<unsigned char*>(this) + sizeof(PlainMessage);
  }
  [[nodiscard]] const unsigned char* data() const noexcept {
    return reinterpret_cast<const unsigned char*>(this) + sizeof(PlainMessage);
  }
  /// Of a whole message with a payload of `size` bytes.
  [[nodiscard]] static constexpr std::size_t bytes(std::size_t size) noexcept {
    return sizeof(PlainMessage) + size;
  }
};

/// An answer where a message cannot be sent on as it is: neither copied nor filled again, only as
/// much of it that the other end finds the stamps and both ends of the payload.
inline void answer_with(PlainMessage& answer, const PlainMessage& message,
                        std::size_t size) noexcept {
  answer.stamps = message.stamps;
  answer.data()[0] = message.data()[0];
  answer.data()[size - 1] = message.data()[size - 1];
}

}  // namespace fastcycle::peers
