#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace fastcycle::dds_gateway {

/// A network interface of this machine that is up and has an IPv4 address.
struct LocalInterface {
  std::string name;
  std::string address;
  int index = 0;
  bool is_loopback = false;
  bool is_multicast = false;
};

[[nodiscard]] std::vector<LocalInterface> local_interfaces();

/// The multicast group in which participants announce themselves.
inline constexpr const char* kDiscoveryGroup = "239.255.0.1";
inline constexpr std::uint32_t kDomains = 233;  // More have no ports.

/// The UDP multicast port for announcements of a domain.
[[nodiscard]] constexpr std::uint16_t discovery_port(std::uint32_t domain) {
  return static_cast<std::uint16_t>(7400 + 250 * domain);
}

/// Whether multicast sent over `interface` loops back to this machine, as its programs require.
/// Waits for at most 0.3 s.
[[nodiscard]] bool does_multicast_return(const LocalInterface& interface);

/// The DDS domains whose ports programs of this machine have open, from the kernel's files under
/// `root`, which is / except in tests; with the minimum number of participants in each.
[[nodiscard]] std::map<std::uint32_t, std::size_t> domains_in_use(
    const std::filesystem::path& root);

/// The maximum size of a socket's receive buffer (net.core.rmem_max); none if unknown.
[[nodiscard]] std::optional<std::uint64_t> receive_buffer_max(const std::filesystem::path& root);

}  // namespace fastcycle::dds_gateway
