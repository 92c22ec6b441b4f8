#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace ads::velodyne {

// The data packet of the manufacturer's manuals: VLP-16 User Manual 63-9243,
// and HDL-64E S3 User's Manual 63-HDL64ES3. All numbers are little endian.
inline constexpr std::size_t kPacketBytes = 1206;
inline constexpr std::size_t kBlockBytes = 100;
inline constexpr std::size_t kBlocks = 12;
inline constexpr std::size_t kReturnsPerBlock = 32;
inline constexpr double kMetresPerUnit = 0.002;  ///< Of distances.
inline constexpr int kAzimuthUnits = 36'000;     ///< A whole turn: 0.01 degrees each.

/// The lasers of a block: the bytes FF EE and FF DD in the packet.
enum class BlockFlag : std::uint16_t {
  kLasers0To31 = 0xeeff,
  kLasers32To63 = 0xddff,
};

/// The measurement of one laser: in units of 2 mm, 0 if there was no return.
struct Return {
  std::uint16_t distance = 0;
  std::uint8_t intensity = 0;
};

struct Block {
  BlockFlag flag = BlockFlag::kLasers0To31;
  std::uint16_t azimuth = 0;  ///< In 0.01 degrees, clockwise seen from above.
  std::array<Return, kReturnsPerBlock> returns{};
};

/// The returns of each firing that a sensor sends; the first of the factory bytes.
enum class ReturnMode : std::uint8_t {
  kStrongest = 0x37,
  kLast = 0x38,
  kDual = 0x39,  ///< Both, in two blocks with the same azimuth: first the last, then the strongest.
};

inline constexpr std::uint8_t kProductVlp16 = 0x22;  ///< The second of the factory bytes.

struct Packet {
  std::array<Block, kBlocks> blocks{};
  std::uint32_t since_hour_us = 0;  ///< Of the sensor's clock, at the first firing of the packet.
  std::array<std::uint8_t, 2> factory{};
};

/// Why a packet is invalid.
enum class PacketFault : std::uint8_t {
  kSize,        ///< Not 1206 bytes.
  kFlag,        ///< A block begins with neither of the two flags.
  kAzimuth,     ///< A whole turn, or more.
  kTime,        ///< More microseconds than an hour has.
  kReturnMode,  ///< A VLP-16 with an unknown return mode.
  kModel,       ///< Blocks that a sensor of the configured model does not send.
};
inline constexpr std::size_t kPacketFaults = 6;

/// As text: "wrong size".
std::string_view text_of(PacketFault fault);

/// Parses `payload` into `packet`. Returns a fault, if any: `packet` is undefined then.
std::optional<PacketFault> parse_packet(std::span<const std::uint8_t> payload, Packet& packet);

/// The bytes of a packet.
std::array<std::uint8_t, kPacketBytes> encode_packet(const Packet& packet);

}  // namespace ads::velodyne
