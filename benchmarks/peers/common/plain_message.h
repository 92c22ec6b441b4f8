#pragma once

#include <cstddef>

#include "peers/common/stamps.h"

namespace fastcycle::peers {

/// For peers that move bytes: the stamps, and right behind them the payload.
struct PlainMessage {
  Stamps stamps;

  [[nodiscard]] void* data() noexcept { return this + 1; }
  [[nodiscard]] const void* data() const noexcept { return this + 1; }
  /// Of a whole message with a payload of `size` bytes.
  [[nodiscard]] static constexpr std::size_t bytes(std::size_t size) noexcept {
    return sizeof(PlainMessage) + size;
  }
};

}  // namespace fastcycle::peers
