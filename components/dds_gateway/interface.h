#pragma once

#include <string>

namespace fastcycle::dds_gateway {

/// A network interface of this machine.
struct Interface {
  bool is_multicast = false;  ///< It supports multicast.
  bool is_loopback = false;
  std::string address;  ///< IPv4; empty if it has none.
};

/// @errors  `EngineError`: no interface has that name.
[[nodiscard]] Interface find_interface(const std::string& name);

}  // namespace fastcycle::dds_gateway
