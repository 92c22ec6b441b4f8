#pragma once

#include <cstdint>

#include <libdeflate.h>
#include <zlib.h>

#include "mcap/records.h"

namespace fastcycle::mcap {

/// The CRC-32 of a sequence of bytes.
class Crc {
 public:
  void add(Bytes bytes) {
    if (!bytes.empty()) {  // A null pointer would reset the CRC.
      value_ = ::libdeflate_crc32(value_, bytes.data(), bytes.size());
    }
  }
  /// Adds `size` bytes of which only the CRC is available.
  void add(std::uint32_t crc, std::uint64_t size) {
    value_ = static_cast<std::uint32_t>(::crc32_combine(value_, crc, static_cast<z_off_t>(size)));
  }
  [[nodiscard]] std::uint32_t value() const { return value_; }

 private:
  std::uint32_t value_ = 0;
};

}  // namespace fastcycle::mcap
