#pragma once

#include <cstddef>
#include <span>

#include "dds_gateway/engine.h"
#include "ros2/buffer.h"

namespace fastcycle::dds_gateway {

/// Header that ROS 2's middleware over Cyclone DDS puts between the encapsulation and the message
/// of a request or reply: a number of the client and the number of its request, 8 bytes each.
inline constexpr std::size_t kRequestHeaderBytes = 16;

/// The guid of a client with this number, which becomes its first eight bytes.
[[nodiscard]] Guid asker_of(std::uint64_t client);

/// `message` with the header inserted.
[[nodiscard]] ros2::Buffer with_request_header(std::span<const std::byte> message,
                                               const Identity& request);
/// `message` without the header; `request` is set from it.
///
/// @errors  `ros2::CdrError`
[[nodiscard]] ros2::Buffer without_request_header(std::span<const std::byte> message,
                                                  Identity& request);

}  // namespace fastcycle::dds_gateway
