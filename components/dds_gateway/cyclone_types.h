#pragma once

#include <cstddef>
#include <span>

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>

#include "ros2/buffer.h"

namespace fastcycle::dds_gateway {

/// A type of Cyclone DDS with opaque messages, their serialized bytes: identified by its name
/// alone, so that any type can be created at run time. Freed by Cyclone DDS.
[[nodiscard]] ddsi_sertype* make_raw_type(const char* name);

/// A message of such a type, which takes over the bytes. Owned by its receiver.
[[nodiscard]] ddsi_serdata* make_raw_message(const ddsi_sertype* type, ros2::Buffer bytes);

/// The bytes of a message of such a type; borrowed.
[[nodiscard]] std::span<const std::byte> bytes_of(const ddsi_serdata* message);

}  // namespace fastcycle::dds_gateway
