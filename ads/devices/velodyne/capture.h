#pragma once

// Capture files for tests.

#include <cstdint>
#include <span>
#include <string>

namespace ads::velodyne::testing {

inline void add_32(std::string& bytes, std::uint32_t value, bool is_big) {
  for (int index = 0; index < 4; ++index) {
    bytes.push_back(static_cast<char>(value >> (is_big ? 24 - 8 * index : 8 * index)));
  }
}

inline void add_16(std::string& bytes, std::uint16_t value) {
  bytes.push_back(static_cast<char>(value >> 8));
  bytes.push_back(static_cast<char>(value));
}

/// Builds a capture file in a string.
class Capture {
 public:
  explicit Capture(bool is_big = false, bool has_nanoseconds = false, std::uint32_t link = 1)
      : is_big_(is_big), has_nanoseconds_(has_nanoseconds) {
    for (const std::uint32_t number :
         {has_nanoseconds ? 0xa1b23c4dU : 0xa1b2c3d4U, 0x00040002U, 0U, 0U, 65'535U, link}) {
      add_32(bytes, number, is_big_);
    }
  }

  /// Adds an Ethernet frame unchanged.
  void add_frame(std::int64_t time_ns, const std::string& frame) {
    add_32(bytes, static_cast<std::uint32_t>(time_ns / 1'000'000'000), is_big_);
    const auto fraction_ns = static_cast<std::uint32_t>(time_ns % 1'000'000'000);
    add_32(bytes, has_nanoseconds_ ? fraction_ns : fraction_ns / 1000, is_big_);
    add_32(bytes, static_cast<std::uint32_t>(frame.size()), is_big_);
    add_32(bytes, static_cast<std::uint32_t>(frame.size()), is_big_);
    bytes += frame;
  }

  /// Adds a UDP datagram.
  void add(std::int64_t time_ns, std::uint16_t port, std::span<const std::uint8_t> payload) {
    add_frame(time_ns, frame_of(port, payload));
  }

  static std::string frame_of(std::uint16_t port, std::span<const std::uint8_t> payload,
                              std::uint16_t fragment = 0, bool has_vlan = false) {
    std::string frame(12, '\x02');
    if (has_vlan) {
      add_16(frame, 0x8100);
      add_16(frame, 7);
    }
    add_16(frame, 0x0800);
    frame += "\x45";
    frame.push_back('\0');
    add_16(frame, static_cast<std::uint16_t>(28 + payload.size()));
    add_16(frame, 1);
    add_16(frame, fragment);
    frame += "\x40\x11";
    add_16(frame, 0);
    add_32(frame, 0xc0a801c9, true);
    add_32(frame, 0xffffffff, true);
    add_16(frame, 2368);
    add_16(frame, port);
    add_16(frame, static_cast<std::uint16_t>(8 + payload.size()));
    add_16(frame, 0);
    frame.append(payload.begin(), payload.end());
    return frame;
  }

  std::string bytes;

 private:
  bool is_big_;
  bool has_nanoseconds_;
};

}  // namespace ads::velodyne::testing
