#pragma once

#include <chrono>
#include <cstdint>
#include <set>
#include <string>

namespace fastcycle::dds_security {

/// The largest domain that can be secured: a limit of Cyclone DDS.
inline constexpr std::uint32_t kDomainMax = 230;

/// Permissions of a participant in a domain. All else is denied.
struct Rights {
  std::uint32_t domain = 0;
  std::set<std::string> publish;    ///< Topics of DDS: `rt/points`
  std::set<std::string> subscribe;  ///< The same.
};

/// The rules of all domains: participants without a certificate are rejected, discovery and
/// messages are encrypted, and topics need permissions.
[[nodiscard]] std::string governance();

/// Permissions of the participant with the certificate of `name`, until `end`. `name` and the
/// topics must not contain XML markup.
[[nodiscard]] std::string permissions(const std::string& name, const Rights& rights,
                                      std::chrono::sys_seconds end);

}  // namespace fastcycle::dds_security
