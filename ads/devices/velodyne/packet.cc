#include "packet.h"

namespace ads::velodyne {
namespace {

constexpr std::size_t kTimeAt = kBlocks * kBlockBytes;
constexpr std::size_t kFactoryAt = kTimeAt + 4;
// A leap second makes the last hour longer.
constexpr std::uint32_t kHourMax_us = 3'601'000'000U;

std::uint16_t read_16(const std::uint8_t* at) {
  return static_cast<std::uint16_t>(at[0] | at[1] << 8);
}

void write_16(std::uint16_t value, std::uint8_t* at) {
  at[0] = static_cast<std::uint8_t>(value);
  at[1] = static_cast<std::uint8_t>(value >> 8);
}

bool is_flag(std::uint16_t flag) {
  return flag == static_cast<std::uint16_t>(BlockFlag::kLasers0To31) ||
         flag == static_cast<std::uint16_t>(BlockFlag::kLasers32To63);
}

std::optional<PacketFault> parse_block(const std::uint8_t* at, Block& block) {
  const std::uint16_t flag = read_16(at);
  if (!is_flag(flag)) {
    return PacketFault::kFlag;
  }
  block.flag = static_cast<BlockFlag>(flag);
  block.azimuth = read_16(at + 2);
  if (block.azimuth >= kAzimuthUnits) {
    return PacketFault::kAzimuth;
  }
  const std::uint8_t* its = at + 4;
  for (Return& measured : block.returns) {
    measured = {.distance = read_16(its), .intensity = its[2]};
    its += 3;
  }
  return std::nullopt;
}

}  // namespace

std::string_view text_of(PacketFault fault) {
  switch (fault) {
    case PacketFault::kSize:
      return "wrong size";
    case PacketFault::kFlag:
      return "wrong flag of a block";
    case PacketFault::kAzimuth:
      return "azimuth beyond a turn";
    case PacketFault::kTime:
      return "time beyond an hour";
    case PacketFault::kReturnMode:
      return "unknown return mode";
    case PacketFault::kModel:
      return "another model's blocks";
  }
  return "unknown";
}

std::optional<PacketFault> parse_packet(std::span<const std::uint8_t> payload, Packet& packet) {
  if (payload.size() != kPacketBytes) {
    return PacketFault::kSize;
  }
  for (std::size_t index = 0; index < kBlocks; ++index) {
    if (const auto fault =
            parse_block(payload.data() + index * kBlockBytes, packet.blocks[index])) {
      return fault;
    }
  }
  packet.since_hour_us = read_16(payload.data() + kTimeAt) |
                         static_cast<std::uint32_t>(read_16(payload.data() + kTimeAt + 2)) << 16;
  if (packet.since_hour_us >= kHourMax_us) {
    return PacketFault::kTime;
  }
  packet.factory = {payload[kFactoryAt], payload[kFactoryAt + 1]};
  return std::nullopt;
}

std::array<std::uint8_t, kPacketBytes> encode_packet(const Packet& packet) {
  std::array<std::uint8_t, kPacketBytes> bytes{};
  std::uint8_t* at = bytes.data();
  for (const Block& block : packet.blocks) {
    write_16(static_cast<std::uint16_t>(block.flag), at);
    write_16(block.azimuth, at + 2);
    at += 4;
    for (const Return& measured : block.returns) {
      write_16(measured.distance, at);
      at[2] = measured.intensity;
      at += 3;
    }
  }
  write_16(static_cast<std::uint16_t>(packet.since_hour_us), at);
  write_16(static_cast<std::uint16_t>(packet.since_hour_us >> 16), at + 2);
  at[4] = packet.factory[0];
  at[5] = packet.factory[1];
  return bytes;
}

}  // namespace ads::velodyne
