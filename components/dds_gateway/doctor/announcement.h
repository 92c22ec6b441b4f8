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

/// A participant's announcement of itself, before discovery (OMG, *DDS Interoperability Wire
/// Protocol*, 8.5.3: the simple participant discovery protocol).
struct Announcement {
  Guid participant{};
  std::string name;                    ///< Of the participant; may be empty.
  std::vector<std::string> addresses;  ///< Its IPv4 unicast addresses.
  bool is_secured = false;             ///< It has a certificate.
};

/// The first announcement in a packet from a discovery port; none if there is none, or it is
/// truncated or has wrong lengths. Keeps at most 16 addresses.
[[nodiscard]] std::optional<Announcement> read_announcement(std::span<const std::byte> packet);

/// The DDS implementation of a participant, from the first two bytes of its guid: "Cyclone DDS"; if
/// unknown the two bytes as `vendor 01.7f`.
[[nodiscard]] std::string implementation_of(const Guid& participant);

}  // namespace fastcycle::dds_gateway
