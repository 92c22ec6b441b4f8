#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace fastcycle::inspect {

inline constexpr std::uint32_t kProtocolVersion = 1;

/// Each message is preceded by its size: 4 bytes, little endian.
inline constexpr std::size_t kFrameHead = 4;
/// Maximum size of one request.
inline constexpr std::size_t kMaxRequestBytes = std::size_t{16} << 20U;
/// Maximum size of one answer.
inline constexpr std::size_t kMaxAnswerBytes = std::size_t{64} << 20U;

inline void append_size(std::string& out, std::size_t size) {
  for (unsigned shift = 0; shift < 32; shift += 8) {
    out.push_back(static_cast<char>((size >> shift) & 0xffU));
  }
}

/// @pre  `head` has `kFrameHead` bytes.
inline std::size_t read_size(std::string_view head) {
  std::size_t size = 0;
  for (std::size_t i = 0; i < kFrameHead; ++i) {
    size |= static_cast<std::size_t>(static_cast<unsigned char>(head[i])) << (8 * i);
  }
  return size;
}

}  // namespace fastcycle::inspect
