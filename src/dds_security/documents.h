#pragma once

#include <chrono>
#include <cstdint>
#include <set>
#include <string>

namespace fastcycle::dds_security {

/// The domains that can be secured are those up to this: Cyclone DDS reads no larger number.
inline constexpr std::uint32_t kDomainMax = 230;

/// What a participant may do in a domain. All else is denied.
struct Rights {
  std::uint32_t domain = 0;
  std::set<std::string> publish;    ///< Topics of DDS: `rt/points`
  std::set<std::string> subscribe;  ///< The same.
};

/// The rules of all domains: who has no certificate is left out, discovery and messages are
/// encrypted, and topics need permissions.
[[nodiscard]] std::string governance();

/// What the participant with the certificate of `name` may do until `end`. `name` and the topics
/// have nothing that means something in XML.
[[nodiscard]] std::string permissions(const std::string& name, const Rights& rights,
                                      std::chrono::sys_seconds end);

}  // namespace fastcycle::dds_security
