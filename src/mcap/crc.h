#pragma once

#include <cstdint>

#include <zlib.h>

#include "mcap/records.h"

namespace fastcycle::mcap {

/// The CRC-32 of bytes that come one after the other.
class Crc {
 public:
  void add(Bytes bytes) {
    value_ = static_cast<std::uint32_t>(
        ::crc32_z(value_, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
  }
  [[nodiscard]] std::uint32_t value() const { return value_; }

 private:
  std::uint32_t value_ = 0;
};

}  // namespace fastcycle::mcap
