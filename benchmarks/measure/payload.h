#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace fastcycle::measure {

/// Writes the whole payload, like a driver that copies a frame out of a device's buffer.
inline void fill(void* data, std::size_t size, std::int64_t number) noexcept {
  std::memset(data, static_cast<int>(number & 0xff), size);
}

/// Whether both ends of a payload hold what `fill` wrote; called after the stamp is taken.
[[nodiscard]] inline bool is_filled(const void* data, std::size_t size,
                                    std::int64_t number) noexcept {
  const auto* bytes = static_cast<const unsigned char*>(data);
  const auto expected = static_cast<unsigned char>(number & 0xff);
  return size == 0 || (bytes[0] == expected && bytes[size - 1] == expected);
}

}  // namespace fastcycle::measure
