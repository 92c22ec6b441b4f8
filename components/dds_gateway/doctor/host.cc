#include "dds_gateway/doctor/host.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <set>
#include <sstream>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "dds_gateway/doctor/socket.h"

namespace fastcycle::dds_gateway {
namespace {

constexpr int kPatience_ms = 300;
constexpr unsigned kPortsOfDomain = 250;
constexpr unsigned kPortMax = 65'535;

std::string text_of(const in_addr& address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  return inet_ntop(AF_INET, &address, text.data(), text.size()) == nullptr ? "" : text.data();
}

/// The UDP ports that are open on this machine.
std::set<std::uint16_t> open_ports(const std::filesystem::path& root) {
  std::set<std::uint16_t> ports;
  for (const char* const file : {"proc/net/udp", "proc/net/udp6"}) {
    std::ifstream input(root / file);
    std::string line;
    std::getline(input, line);  // Column headings.
    while (std::getline(input, line)) {
      std::istringstream words(line);
      std::string number;
      std::string local;
      words >> number >> local;
      const std::size_t colon = local.rfind(':');
      if (colon == std::string::npos || local.size() - colon != 5) {
        continue;
      }
      unsigned port = 0;
      std::istringstream(local.substr(colon + 1)) >> std::hex >> port;
      ports.insert(static_cast<std::uint16_t>(port));
    }
  }
  return ports;
}

}  // namespace

std::vector<LocalInterface> local_interfaces() {
  std::vector<LocalInterface> found;
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) {
    return found;
  }
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    const auto has = [&](unsigned flag) { return (one->ifa_flags & flag) != 0; };
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET || !has(IFF_UP) ||
        std::ranges::find(found, one->ifa_name, &LocalInterface::name) != found.end()) {
      continue;
    }
    found.push_back(
        {.name = one->ifa_name,
         .address = text_of(reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr),
         .index = static_cast<int>(if_nametoindex(one->ifa_name)),
         .is_loopback = has(IFF_LOOPBACK),
         .is_multicast = has(IFF_MULTICAST)});
  }
  freeifaddrs(all);
  return found;
}

bool does_multicast_return(const LocalInterface& interface) {
  const Socket receiver(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const Socket sender(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  // The discovery group, and an unused port: firewalls distinguish groups, and no participant
  // receives what is no announcement.
  sockaddr_in place{};
  place.sin_family = AF_INET;
  inet_pton(AF_INET, kDiscoveryGroup, &place.sin_addr);
  socklen_t size = sizeof place;
  ip_mreqn membership{};
  membership.imr_multiaddr = place.sin_addr;
  membership.imr_ifindex = interface.index;
  if (bind(receiver.get(), reinterpret_cast<const sockaddr*>(&place), sizeof place) != 0 ||
      getsockname(receiver.get(), reinterpret_cast<sockaddr*>(&place), &size) != 0 ||
      setsockopt(receiver.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) !=
          0 ||
      setsockopt(sender.get(), IPPROTO_IP, IP_MULTICAST_IF, &membership, sizeof membership) != 0) {
    return false;
  }
  constexpr std::array<char, 8> kWord = {'d', 'o', 'c', 't', 'o', 'r', '?', '\n'};
  if (sendto(sender.get(), kWord.data(), kWord.size(), 0, reinterpret_cast<const sockaddr*>(&place),
             sizeof place) < 0) {
    return false;
  }
  pollfd waiting{.fd = receiver.get(), .events = POLLIN, .revents = 0};
  return poll(&waiting, 1, kPatience_ms) == 1;
}

std::map<std::uint32_t, std::size_t> domains_in_use(const std::filesystem::path& root) {
  const std::set<std::uint16_t> ports = open_ports(root);
  std::map<std::uint32_t, std::size_t> domains;
  for (std::uint32_t domain = 0; domain < kDomains; ++domain) {
    const unsigned first = discovery_port(domain);
    // Each participant with a given number has two consecutive ports, from the tenth on.
    std::size_t pairs = 0;
    for (unsigned port = first + 10; port < std::min(first + kPortsOfDomain - 1, kPortMax);
         port += 2) {
      const auto even = static_cast<std::uint16_t>(port);
      pairs += ports.contains(even) && ports.contains(static_cast<std::uint16_t>(port + 1)) ? 1 : 0;
    }
    if (ports.contains(static_cast<std::uint16_t>(first)) || pairs > 0) {
      domains[domain] = std::max<std::size_t>(1, pairs);
    }
  }
  return domains;
}

std::optional<std::uint64_t> receive_buffer_max(const std::filesystem::path& root) {
  std::ifstream input(root / "proc/sys/net/core/rmem_max");
  std::uint64_t bytes = 0;
  return input >> bytes ? std::optional(bytes) : std::nullopt;
}

}  // namespace fastcycle::dds_gateway
