#include "dds_gateway/interface.h"

#include <array>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include "dds_gateway/engine.h"

namespace fastcycle::dds_gateway {

Interface find_interface(const std::string& name) {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) {
    throw EngineError("the network interfaces cannot be listed");
  }
  Interface found;
  bool is_there = false;
  std::string known;
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    if (name != one->ifa_name) {
      if (known.find(one->ifa_name) == std::string::npos) {
        known += fmt::format("{}{}", known.empty() ? "" : ", ", one->ifa_name);
      }
      continue;
    }
    is_there = true;
    found.is_multicast = (one->ifa_flags & static_cast<unsigned>(IFF_MULTICAST)) != 0;
    found.is_loopback = (one->ifa_flags & static_cast<unsigned>(IFF_LOOPBACK)) != 0;
    if (one->ifa_addr != nullptr && one->ifa_addr->sa_family == AF_INET) {
      std::array<char, INET_ADDRSTRLEN> text{};
      const auto* const address = reinterpret_cast<const sockaddr_in*>(one->ifa_addr);
      if (inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size()) != nullptr) {
        found.address = text.data();
      }
    }
  }
  freeifaddrs(all);
  if (!is_there) {
    throw EngineError(
        fmt::format("there is no network interface \"{}\"; there are {}", name, known));
  }
  return found;
}

}  // namespace fastcycle::dds_gateway
