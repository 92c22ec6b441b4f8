#include "pcap.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>

namespace ads::velodyne {
namespace {

constexpr std::size_t kFileHeaderBytes = 24;
constexpr std::size_t kRecordHeaderBytes = 16;
constexpr std::uint32_t kMicroseconds = 0xa1b2c3d4;
constexpr std::uint32_t kNanoseconds = 0xa1b23c4d;
constexpr std::uint32_t kEthernet = 1;
// No link carries more at once: a larger one is damage.
constexpr std::uint32_t kRecordMax = 262'144;

constexpr std::size_t kEthernetBytes = 14;
constexpr std::size_t kVlanBytes = 4;
constexpr std::uint16_t kVlan = 0x8100;
constexpr std::uint16_t kIpv4 = 0x0800;
constexpr std::size_t kIpv4BytesMin = 20;
constexpr std::uint8_t kUdp = 17;
constexpr std::size_t kUdpBytes = 8;
constexpr std::uint16_t kFragment = 0x3fff;  // More of them, or not the first.

std::uint16_t network_16(const std::uint8_t* at) {
  return static_cast<std::uint16_t>(at[0] << 8 | at[1]);
}

std::uint32_t network_32(const std::uint8_t* at) {
  return static_cast<std::uint32_t>(network_16(at)) << 16 | network_16(at + 2);
}

std::uint32_t little_32(const std::uint8_t* at) {
  return at[0] | static_cast<std::uint32_t>(at[1]) << 8 | static_cast<std::uint32_t>(at[2]) << 16 |
         static_cast<std::uint32_t>(at[3]) << 24;
}

}  // namespace

PcapReader::PcapReader(const std::filesystem::path& file)
    : name_(file.string()), stream_(file, std::ios::binary) {
  std::array<std::uint8_t, kFileHeaderBytes> header{};
  if (!stream_) {
    throw std::runtime_error(fmt::format("{}: cannot be opened: {}", name_, std::strerror(errno)));
  }
  stream_.read(reinterpret_cast<char*>(header.data()), header.size());
  if (stream_.gcount() != static_cast<std::streamsize>(header.size())) {
    throw std::runtime_error(
        fmt::format("{}: expected a capture file of at least {} bytes, found {}", name_,
                    header.size(), stream_.gcount()));
  }
  offset_ = header.size();
  const std::uint32_t little = little_32(header.data());
  const std::uint32_t big = network_32(header.data());
  is_swapped_ = big == kMicroseconds || big == kNanoseconds;
  const std::uint32_t magic = is_swapped_ ? big : little;
  if (magic != kMicroseconds && magic != kNanoseconds) {
    throw std::runtime_error(fmt::format(
        "{}: expected a capture file in the classic format of pcap (a1b2c3d4 or a1b23c4d), found "
        "{:08x}{}",
        name_, little,
        little == 0x0a0d0d0a ? ": it is pcapng, which `editcap -F pcap` converts" : ""));
  }
  fraction_ns_ = magic == kNanoseconds ? 1 : 1000;
  const std::uint32_t link = number_32(header.data() + 20) & 0xffff;
  if (link != kEthernet) {
    throw std::runtime_error(
        fmt::format("{}: expected a capture of Ethernet (link type 1), found {}", name_, link));
  }
}

std::uint32_t PcapReader::number_32(const std::uint8_t* at) const {
  return is_swapped_ ? network_32(at) : little_32(at);
}

bool PcapReader::read_record(std::int64_t& time_ns, bool& is_whole) {
  std::array<std::uint8_t, kRecordHeaderBytes> header{};
  stream_.read(reinterpret_cast<char*>(header.data()), header.size());
  if (stream_.gcount() == 0) {
    return false;
  }
  const std::uint32_t size = number_32(header.data() + 8);
  if (stream_.gcount() != static_cast<std::streamsize>(header.size())) {
    damage_ = fmt::format("{}: byte {}: expected the {} bytes in front of a packet, found {}",
                          name_, offset_, header.size(), stream_.gcount());
    return false;
  }
  if (size > kRecordMax) {
    damage_ = fmt::format("{}: byte {}: expected a packet of at most {} bytes, found {}", name_,
                          offset_, kRecordMax, size);
    return false;
  }
  bytes_.resize(size);
  stream_.read(reinterpret_cast<char*>(bytes_.data()), size);
  if (stream_.gcount() != static_cast<std::streamsize>(size)) {
    damage_ = fmt::format("{}: byte {}: expected a packet of {} bytes, found {}", name_,
                          offset_ + header.size(), size, stream_.gcount());
    return false;
  }
  offset_ += header.size() + size;
  time_ns = std::int64_t{number_32(header.data())} * 1'000'000'000 +
            std::int64_t{number_32(header.data() + 4)} * fraction_ns_;
  is_whole = number_32(header.data() + 12) <= size;
  return true;
}

std::optional<Datagram> PcapReader::datagram() const {
  std::span<const std::uint8_t> rest = bytes_;
  if (rest.size() < kEthernetBytes) {
    return std::nullopt;
  }
  std::uint16_t type = network_16(rest.data() + kEthernetBytes - 2);
  rest = rest.subspan(kEthernetBytes);
  if (type == kVlan && rest.size() >= kVlanBytes) {
    type = network_16(rest.data() + 2);
    rest = rest.subspan(kVlanBytes);
  }
  if (type != kIpv4 || rest.size() < kIpv4BytesMin || rest[0] >> 4 != 4) {
    return std::nullopt;
  }
  const std::size_t header_bytes = std::size_t{4} * (rest[0] & 0x0fU);
  const std::size_t total_bytes = network_16(rest.data() + 2);
  if (header_bytes < kIpv4BytesMin || total_bytes < header_bytes + kUdpBytes ||
      total_bytes > rest.size() || rest[9] != kUdp ||
      (network_16(rest.data() + 6) & kFragment) != 0) {
    return std::nullopt;
  }
  const std::uint8_t* const udp = rest.data() + header_bytes;
  const std::size_t udp_bytes = network_16(udp + 4);
  if (udp_bytes < kUdpBytes || header_bytes + udp_bytes > total_bytes) {
    return std::nullopt;
  }
  return Datagram{.source = network_32(rest.data() + 12),
                  .port = network_16(udp + 2),
                  .payload = {udp + kUdpBytes, udp_bytes - kUdpBytes}};
}

std::optional<Datagram> PcapReader::next() {
  std::int64_t time_ns = 0;
  bool is_whole = false;
  while (damage_.empty() && read_record(time_ns, is_whole)) {
    if (auto found = is_whole ? datagram() : std::nullopt) {
      found->time_ns = time_ns;
      return found;
    }
    ++others_;
  }
  return std::nullopt;
}

}  // namespace ads::velodyne
