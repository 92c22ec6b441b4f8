#include "dds_security/documents.h"

#include <string_view>

#include <fmt/chrono.h>
#include <fmt/format.h>

namespace fastcycle::dds_security {
namespace {

constexpr std::string_view kGovernance = R"(<?xml version="1.0" encoding="utf-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains>
        <id_range>
          <min>0</min>
          <max>230</max>
        </id_range>
      </domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>SIGN</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>ENCRYPT</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
)";

std::string time_text(std::chrono::sys_seconds time) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(time)));
}

std::string rule_of(std::string_view verb, const std::set<std::string>& topics) {
  if (topics.empty()) {
    return {};
  }
  std::string text = fmt::format("        <{}>\n          <topics>\n", verb);
  for (const std::string& topic : topics) {
    text += fmt::format("            <topic>{}</topic>\n", topic);
  }
  return text + fmt::format("          </topics>\n        </{}>\n", verb);
}

}  // namespace

std::string governance() {
  return std::string(kGovernance);
}

std::string permissions(const std::string& name, const Rights& rights,
                        std::chrono::sys_seconds end) {
  const auto begin = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now()) -
                     std::chrono::days(1);  // Clocks may differ.
  return fmt::format(
      R"(<?xml version="1.0" encoding="utf-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="{0}">
      <subject_name>CN={0}</subject_name>
      <validity>
        <not_before>{1}</not_before>
        <not_after>{2}</not_after>
      </validity>
      <allow_rule>
        <domains>
          <id>{3}</id>
        </domains>
{4}{5}      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
)",
      name, time_text(begin), time_text(end), rights.domain, rule_of("publish", rights.publish),
      rule_of("subscribe", rights.subscribe));
}

}  // namespace fastcycle::dds_security
