#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dds_gateway/engine.h"

namespace fastcycle::dds_gateway {

/// What a participant says of itself to everybody, before anybody has found it (OMG, *DDS
/// Interoperability Wire Protocol*, 8.5.3: the simple participant discovery protocol).
struct Announcement {
  Guid participant{};
  std::string name;                    ///< Of the participant, if it says one.
  std::vector<std::string> addresses;  ///< IPv4, at which it wants to be answered.
  bool is_secured = false;             ///< It has a certificate.
};

/// The first announcement in a packet that came on a port of discovery; none if there is none, or
/// what looks like one is cut or says lengths that it does not have. At most 16 addresses are kept.
[[nodiscard]] std::optional<Announcement> read_announcement(std::span<const std::byte> packet);

/// The name of the implementation of DDS that a participant has, by the first two bytes of its
/// guid: "Cyclone DDS"; else the two bytes as `vendor 01.7f`.
[[nodiscard]] std::string implementation_of(const Guid& participant);

}  // namespace fastcycle::dds_gateway
