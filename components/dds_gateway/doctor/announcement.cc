#include "dds_gateway/doctor/announcement.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string_view>

#include <fmt/format.h>

namespace fastcycle::dds_gateway {
namespace {

constexpr std::size_t kHeaderBytes = 20;
constexpr std::size_t kAddressesMax = 16;
constexpr std::size_t kNameBytesMax = 256;

constexpr std::uint8_t kData = 0x15;
constexpr std::uint8_t kLittleEndian = 0x01;
constexpr std::uint8_t kHasInlineQos = 0x02;
constexpr std::uint8_t kHasData = 0x04;
constexpr std::array<std::uint8_t, 4> kAnnouncer = {0x00, 0x01, 0x00, 0xc2};
constexpr std::array<std::uint8_t, 4> kParticipant = {0x00, 0x00, 0x01, 0xc1};

enum Parameter : std::uint16_t {
  kSentinel = 0x0001,
  kUnicastLocator = 0x0031,
  kMetatrafficUnicastLocator = 0x0032,
  kEntityName = 0x0062,
  kIdentityToken = 0x1001
};

constexpr std::int32_t kUdp4 = 1;

/// Reads numbers in one byte order; none at the end.
class Bytes {
 public:
  Bytes(std::span<const std::byte> bytes, bool is_little) : bytes_(bytes), is_little_(is_little) {}

  template <typename T>
  std::optional<T> number() {
    const auto found = take(sizeof(T));
    if (!found) {
      return {};
    }
    std::array<std::byte, sizeof(T)> value;
    std::ranges::copy(*found, value.begin());
    if (is_little_ != (std::endian::native == std::endian::little)) {
      std::ranges::reverse(value);
    }
    return std::bit_cast<T>(value);
  }
  std::optional<std::span<const std::byte>> take(std::size_t count) {
    if (bytes_.size() < count) {
      return {};
    }
    const auto taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }
  [[nodiscard]] std::span<const std::byte> rest() const { return bytes_; }

 private:
  std::span<const std::byte> bytes_;
  const bool is_little_;
};

template <std::size_t N>
bool is(std::span<const std::byte> bytes, const std::array<std::uint8_t, N>& expected) {
  return std::ranges::equal(bytes, std::as_bytes(std::span(expected)));
}

void read_locator(Bytes value, Announcement& announcement) {
  const auto kind = value.number<std::int32_t>();
  const auto port = value.number<std::uint32_t>();
  const auto address = value.take(16);
  if (!kind || !port || !address || *kind != kUdp4 ||
      announcement.addresses.size() >= kAddressesMax) {
    return;
  }
  const auto part = [&](std::size_t i) { return std::to_integer<unsigned>((*address)[12 + i]); };
  std::string text = fmt::format("{}.{}.{}.{}", part(0), part(1), part(2), part(3));
  if (std::ranges::find(announcement.addresses, text) == announcement.addresses.end()) {
    announcement.addresses.push_back(std::move(text));
  }
}

void read_name(Bytes value, Announcement& announcement) {
  const auto size = value.number<std::uint32_t>();
  if (!size) {
    return;
  }
  const auto text = value.take(std::min<std::size_t>({*size, kNameBytesMax, value.rest().size()}));
  announcement.name.assign(reinterpret_cast<const char*>(text->data()), text->size());
  announcement.name.resize(std::min(announcement.name.find('\0'), announcement.name.size()));
}

/// Reads a parameter list to its end; false if it is truncated.
bool read_parameters(std::span<const std::byte> payload, Announcement& announcement) {
  if (payload.size() < 4 || payload[0] != std::byte{0}) {
    return false;
  }
  const auto representation = std::to_integer<unsigned>(payload[1]);  // PL_CDR_BE or PL_CDR_LE.
  if (representation != 2 && representation != 3) {
    return false;
  }
  const bool is_little = representation == 3;
  Bytes bytes(payload.subspan(4), is_little);
  while (true) {
    const auto id = bytes.number<std::uint16_t>();
    const auto size = bytes.number<std::uint16_t>();
    if (!id || !size) {
      return false;
    }
    if (*id == kSentinel) {
      return true;
    }
    const auto value = bytes.take(*size);
    if (!value) {
      return false;
    }
    switch (*id) {
      case kUnicastLocator:
      case kMetatrafficUnicastLocator:
        read_locator(Bytes(*value, is_little), announcement);
        break;
      case kEntityName:
        read_name(Bytes(*value, is_little), announcement);
        break;
      case kIdentityToken:
        announcement.is_secured = true;
        break;
      default:
        break;
    }
  }
}

/// Reads the body of a submessage with data: whether it is an announcement.
bool read_data(std::span<const std::byte> body, std::uint8_t flags, Announcement& announcement) {
  Bytes bytes(body, (flags & kLittleEndian) != 0);
  const auto extra = bytes.number<std::uint16_t>();
  const auto to_inline_qos = bytes.number<std::uint16_t>();
  if (!extra || !to_inline_qos || (flags & kHasData) == 0) {
    return false;
  }
  Bytes behind(bytes.rest(), (flags & kLittleEndian) != 0);
  const auto reader = bytes.take(4);
  const auto writer = bytes.take(4);
  if (!reader || !writer || !is(*writer, kAnnouncer) || !behind.take(*to_inline_qos)) {
    return false;
  }
  if ((flags & kHasInlineQos) != 0) {
    std::optional<std::uint16_t> id;
    do {
      id = behind.number<std::uint16_t>();
      const auto size = behind.number<std::uint16_t>();
      if (!id || !size || (*id != kSentinel && !behind.take(*size))) {
        return false;
      }
    } while (*id != kSentinel);
  }
  return read_parameters(behind.rest(), announcement);
}

}  // namespace

std::optional<Announcement> read_announcement(std::span<const std::byte> packet) {
  constexpr std::string_view kMagic = "RTPS";
  if (packet.size() < kHeaderBytes || std::memcmp(packet.data(), kMagic.data(), 4) != 0) {
    return {};
  }
  Announcement announcement;
  std::memcpy(announcement.participant.data(), packet.data() + 8, 12);
  std::ranges::copy(kParticipant, announcement.participant.begin() + 12);
  packet = packet.subspan(kHeaderBytes);
  while (packet.size() >= 4) {
    const auto kind = std::to_integer<std::uint8_t>(packet[0]);
    const auto flags = std::to_integer<std::uint8_t>(packet[1]);
    std::size_t size =
        *Bytes(packet.subspan(2), (flags & kLittleEndian) != 0).number<std::uint16_t>();
    packet = packet.subspan(4);
    if (size > packet.size()) {
      return {};
    }
    size = size == 0 && kind == kData ? packet.size() : size;  // 0: up to the end.
    if (kind == kData && read_data(packet.first(size), flags, announcement)) {
      return announcement;
    }
    packet = packet.subspan(size);
  }
  return {};
}

std::string implementation_of(const Guid& participant) {
  struct Known {
    std::uint8_t minor;
    const char* name;
  };
  // Vendor ids assigned by the OMG.
  constexpr Known kKnown[] = {
      {0x01, "RTI Connext"},       {0x02, "OpenSplice"}, {0x03, "OpenDDS"},
      {0x0a, "RTI Connext Micro"}, {0x0f, "Fast DDS"},   {0x10, "Cyclone DDS"},
      {0x11, "GurumDDS"},          {0x12, "RustDDS"},    {0x14, "Dust DDS"}};
  const auto* const found = std::ranges::find_if(
      kKnown, [&](const Known& one) { return participant[0] == 1 && participant[1] == one.minor; });
  return found != std::end(kKnown)
             ? found->name
             : fmt::format("vendor {:02x}.{:02x}", participant[0], participant[1]);
}

}  // namespace fastcycle::dds_gateway
