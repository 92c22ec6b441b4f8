#include "dds_gateway/doctor/diagnosis.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ros2/names.h"

namespace fastcycle::dds_gateway {
namespace {

constexpr std::size_t kTroublesMax = 50;  // Reported for topics.
constexpr std::size_t kAddressesMax = 8;  // Reported for one domain.
constexpr std::uint64_t kBufferBytes = 1 << 20;

using Findings = std::vector<Finding>;

std::string value_of(const Observation& seen, const std::string& variable) {
  const auto found = seen.environment.find(variable);
  return found == seen.environment.end() ? "" : found->second;
}

bool is_own_address(const Observation& seen, const std::string& address) {
  return std::ranges::any_of(seen.interfaces, [&](const LocalInterface& interface) {
    return interface.address == address;
  });
}

bool is_loopback(const std::string& address) {
  return address.starts_with("127.");
}

// ---- This machine ----

void look_at_interfaces(const Observation& seen, Findings& findings) {
  std::string all;
  bool has_multicast = false;
  for (const LocalInterface& interface : seen.interfaces) {
    if (!seen.interface.empty() && interface.name != seen.interface) {
      continue;
    }
    all += fmt::format("{}{} {}{}", all.empty() ? "" : ", ", interface.name, interface.address,
                       interface.is_multicast ? " (multicast)" : "");
    has_multicast = has_multicast || interface.is_multicast;
  }
  if (has_multicast) {
    findings.push_back({.name = "interfaces", .found = all});
  } else {
    findings.push_back(
        {.name = "interfaces",
         .level = Level::kAdvice,
         .found = all.empty() ? "none that is up and has an address" : all,
         .why = "without multicast participants of this machine are asked one by one, and others "
                "are not found",
         .remedy = seen.interface.empty()
                       ? "sudo ip link set lo multicast on"
                       : fmt::format("sudo ip link set {} multicast on", seen.interface)});
  }
}

void look_at_multicast(const Observation& seen, Findings& findings) {
  std::vector<std::string> good;
  for (const auto& [name, does_return] : seen.multicast_returns) {
    if (does_return) {
      good.push_back(name);
      continue;
    }
    findings.push_back(
        {.name = "multicast",
         .level = Level::kProblem,
         .found = fmt::format("what is sent to {} on {} does not come back", kDiscoveryGroup, name),
         .why = "participants announce themselves there; a firewall that drops it keeps them from "
                "finding each other",
         .remedy = fmt::format("sudo iptables -I INPUT -p udp -d {} -j ACCEPT; sudo iptables -I "
                               "OUTPUT -p udp -d {} -j ACCEPT",
                               kDiscoveryGroup, kDiscoveryGroup)});
  }
  if (!good.empty()) {
    findings.push_back(
        {.name = "multicast", .found = fmt::format("comes back on {}", fmt::join(good, ", "))});
  }
}

void look_at_buffers(const Observation& seen, Findings& findings) {
  if (!seen.receive_buffer_max) {
    return;
  }
  const std::string found = fmt::format("at most {} KiB", *seen.receive_buffer_max / 1024);
  if (*seen.receive_buffer_max >= kBufferBytes) {
    findings.push_back({.name = "receive buffers", .found = found});
    return;
  }
  findings.push_back(
      {.name = "receive buffers",
       .level = Level::kAdvice,
       .found = found,
       .why = "of a picture or a cloud that comes at once packets are lost, and best effort then "
              "loses all of it",
       .remedy = "sudo sysctl -w net.core.rmem_max=8388608"});
}

void look_at_environment(const Observation& seen, Findings& findings) {
  const std::string domain = value_of(seen, "ROS_DOMAIN_ID");
  if (!domain.empty() && domain != std::to_string(seen.domain)) {
    findings.push_back(
        {.name = "environment",
         .level = Level::kAdvice,
         .found =
             fmt::format("ROS_DOMAIN_ID={}, and this looks at the domain {}", domain, seen.domain),
         .why = "nodes that this shell starts are in another domain, and find nobody here",
         .remedy = fmt::format("export ROS_DOMAIN_ID={}", seen.domain)});
  }
  const std::string range = value_of(seen, "ROS_AUTOMATIC_DISCOVERY_RANGE");
  const bool is_local = value_of(seen, "ROS_LOCALHOST_ONLY") == "1";
  if (is_local || range == "LOCALHOST" || range == "OFF") {
    findings.push_back(
        {.name = "environment",
         .level = Level::kAdvice,
         .found = is_local ? "ROS_LOCALHOST_ONLY=1"
                           : fmt::format("ROS_AUTOMATIC_DISCOVERY_RANGE={}", range),
         .why = range == "OFF" ? "nodes that this shell starts find nobody by themselves"
                               : "nodes that this shell starts talk to this machine alone",
         .remedy = "unset ROS_LOCALHOST_ONLY; export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"});
  }
  const std::string middleware = value_of(seen, "RMW_IMPLEMENTATION");
  if (!middleware.empty() && middleware.find("dds") == std::string::npos &&
      middleware.find("fastrtps") == std::string::npos) {
    findings.push_back(
        {.name = "environment",
         .level = Level::kAdvice,
         .found = fmt::format("RMW_IMPLEMENTATION={}", middleware),
         .why = "nodes that this shell starts do not use DDS: nobody here finds them",
         .remedy = "export RMW_IMPLEMENTATION=rmw_cyclonedds_cpp"});
  }
  std::vector<std::string> files;
  for (const char* const variable :
       {"CYCLONEDDS_URI", "FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE",
        "ROS_DISCOVERY_SERVER", "ROS_STATIC_PEERS"}) {
    if (const std::string value = value_of(seen, variable); !value.empty()) {
      files.push_back(fmt::format("{}={}", variable, value));
    }
  }
  if (!files.empty()) {
    findings.push_back({.name = "environment",
                        .found = fmt::format("{} (may choose other interfaces, ports or peers)",
                                             fmt::join(files, ", "))});
  }
}

// ---- Participants ----

/// The other domains, each with the addresses of its participants.
std::string other_domains(const Observation& seen) {
  std::map<std::uint32_t, std::set<std::string>> all;
  for (const auto& [domain, count] : seen.domains_in_use) {
    if (domain != seen.domain) {
      all[domain].insert("this machine");
    }
  }
  for (const ReceivedAnnouncement& received : seen.announcements) {
    if (received.domain != seen.domain) {
      all[received.domain].insert(is_own_address(seen, received.from) ? "this machine"
                                                                      : received.from);
    }
  }
  std::string text;
  for (auto& [domain, places] : all) {
    while (places.size() > kAddressesMax) {
      places.erase(std::prev(places.end()));
    }
    text += fmt::format("{}{} on {}", text.empty() ? "" : "; ", domain, fmt::join(places, ", "));
  }
  return text;
}

void look_for_others(const Observation& seen, Findings& findings) {
  const std::string others = other_domains(seen);
  if (!seen.participants.empty()) {
    std::set<std::string> nodes;
    for (const FoundEndpoint& endpoint : seen.endpoints) {
      if (!endpoint.node.empty()) {
        nodes.insert(endpoint.node);
      }
    }
    findings.push_back(
        {.name = "discovery",
         .found = fmt::format("{} participant{} with {} node{} of ROS 2{}",
                              seen.participants.size(), seen.participants.size() == 1 ? "" : "s",
                              nodes.size(), nodes.size() == 1 ? "" : "s",
                              others.empty() ? "" : fmt::format(" (other domains: {})", others))});
    return;
  }
  const std::string nobody = fmt::format("nobody was found in the domain {} within {} s",
                                         seen.domain, seen.watched.count());
  if (const auto here = seen.domains_in_use.find(seen.domain); here != seen.domains_in_use.end()) {
    findings.push_back(
        {.name = "discovery",
         .level = Level::kProblem,
         .found = fmt::format("{}, though programs of this machine have its ports open", nobody),
         .why = "they are on another interface (ROS_LOCALHOST_ONLY=1 and "
                "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST: on lo alone), or have security",
         .remedy = fmt::format("fastcycle doctor --dds --domain {} --interface {}", seen.domain,
                               seen.interface == "lo" ? "eth0" : "lo")});
    return;
  }
  if (!others.empty()) {
    findings.push_back(
        {.name = "domain",
         .level = Level::kProblem,
         .found = fmt::format("{}; there are participants in the domain {}", nobody, others),
         .why = "who is in another domain is not found",
         .remedy = "give both sides one number: ROS_DOMAIN_ID of nodes, \"domain\" "
                   "of the gateway"});
    return;
  }
  findings.push_back({.name = "discovery",
                      .level = Level::kAdvice,
                      .found = nobody,
                      .why = "nobody is there, or they are on a network that this machine does not "
                             "receive",
                      .remedy = "start a node, and look again"});
}

/// Participants whose announcements were received, but that were not discovered.
void look_at_announcements(const Observation& seen, Findings& findings) {
  for (const ReceivedAnnouncement& received : seen.announcements) {
    const bool is_found = std::ranges::any_of(seen.participants, [&](const auto& participant) {
      return participant.guid == received.announcement.participant;
    });
    const bool has_topics = std::ranges::any_of(seen.endpoints, [&](const auto& endpoint) {
      return endpoint.participant == received.announcement.participant;
    });
    if (received.domain != seen.domain || (is_found && has_topics)) {
      continue;
    }
    const std::string who = fmt::format(
        "{} ({}, {})", received.from, implementation_of(received.announcement.participant),
        received.announcement.name.empty() ? text_of(received.announcement.participant)
                                           : received.announcement.name);
    const auto& addresses = received.announcement.addresses;
    if (received.announcement.is_secured && !seen.is_secured) {
      findings.push_back({.name = "security",
                          .level = Level::kProblem,
                          .found = fmt::format("{} has security, and this has none", who),
                          .why = "a participant with a certificate talks to those with one alone",
                          .remedy = "fastcycle doctor --dds --security ENCLAVE"});
    } else if (!is_own_address(seen, received.from) && !addresses.empty() &&
               std::ranges::all_of(addresses, is_loopback)) {
      findings.push_back(
          {.name = "localhost only",
           .level = Level::kProblem,
           .found = fmt::format("{} expects replies only at {}", who, fmt::join(addresses, ", ")),
           .why = "it talks to its own machine alone",
           .remedy = "there: unset ROS_LOCALHOST_ONLY; export "
                     "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"});
    } else if (!seen.interface.empty() && received.interface != seen.interface) {
      findings.push_back(
          {.name = "interface",
           .level = Level::kAdvice,
           .found = fmt::format("{} announces itself on {}, and this looks at {} alone", who,
                                received.interface, seen.interface),
           .why = "who uses one interface does not find those on another one",
           .remedy = fmt::format("fastcycle doctor --dds --domain {} --interface {}", seen.domain,
                                 received.interface)});
    } else {
      findings.push_back(
          {.name = "firewall",
           .level = Level::kProblem,
           .found = fmt::format("{} announces itself, but {}", who,
                                is_found ? "none of its topics came" : "was not found"),
           .why = "answers to one participant alone do not pass: a firewall, here or there, drops "
                  "UDP from this port on",
           .remedy = fmt::format("sudo iptables -I INPUT -p udp --dport {}: -j ACCEPT",
                                 discovery_port(seen.domain))});
    }
  }
}

void look_at_topics(const Observation& seen, Findings& findings) {
  std::set<std::string> reported;
  std::size_t more = 0;
  auto begin = seen.endpoints.begin();
  while (begin != seen.endpoints.end()) {
    const auto end = std::find_if(begin, seen.endpoints.end(), [&](const FoundEndpoint& one) {
      return one.endpoint.topic != begin->endpoint.topic;
    });
    for (auto writer = begin; writer != end && !writer->endpoint.is_reader; ++writer) {
      for (auto reader = writer; reader != end; ++reader) {
        if (!reader->endpoint.is_reader) {
          continue;
        }
        auto trouble = trouble_between(*writer, *reader);
        if (!trouble || !reported.insert(trouble->found).second) {
          continue;
        }
        if (reported.size() <= kTroublesMax) {
          findings.push_back(std::move(*trouble));
        } else {
          ++more;
        }
      }
    }
    begin = end;
  }
  if (more > 0) {
    findings.push_back({.name = "topics",
                        .level = Level::kAdvice,
                        .found = fmt::format("{} more of this kind", more),
                        .why = "only the first are reported",
                        .remedy = "fastcycle doctor --dds --json"});
  }
}

std::string text_of(std::chrono::nanoseconds time) {
  return fmt::format("{:.2f} ms", static_cast<double>(time.count()) / 1e6);
}

void look_at_round_trip(const Observation& seen, Findings& findings) {
  if (!seen.round_trip) {
    return;
  }
  const RoundTripResult& result = *seen.round_trip;
  if (result.found_after < std::chrono::milliseconds(0)) {
    findings.push_back(
        {.name = "round trip",
         .level = Level::kProblem,
         .found = fmt::format("another process of this machine was not found within {} s",
                              seen.watched.count()),
         .why = "discovery does not work on this machine itself: a firewall, or an interface that "
                "is not the one",
         .remedy = "fastcycle doctor --dds --interface lo"});
    return;
  }
  if (result.small.empty() || result.large.empty()) {
    findings.push_back(
        {.name = "round trip",
         .level = Level::kProblem,
         .found = fmt::format("another process was found after {} ms, but messages of {} did not "
                              "come back",
                              result.found_after.count(), result.small.empty() ? "64 B" : "1 MiB"),
         .why = "packets to one participant alone, or large ones, are dropped",
         .remedy = "fastcycle doctor --dds --interface lo"});
    return;
  }
  const std::string found = fmt::format(
      "another process was found after {} ms; 64 B there and back in {}, 1 MiB in {} (medians of "
      "{} and {})",
      result.found_after.count(), text_of(result.small[result.small.size() / 2]),
      text_of(result.large[result.large.size() / 2]), result.small.size(), result.large.size());
  if (result.lost == 0) {
    findings.push_back({.name = "round trip", .found = found});
  } else {
    findings.push_back({.name = "round trip",
                        .level = Level::kAdvice,
                        .found = fmt::format("{}; {} did not come back", found, result.lost),
                        .why = "packets are lost on this machine itself",
                        .remedy = "sudo sysctl -w net.core.rmem_max=8388608"});
  }
}

}  // namespace

const std::vector<const char*>& variables_of_interest() {
  static const std::vector<const char*> kAll = {"ROS_DOMAIN_ID",
                                                "ROS_LOCALHOST_ONLY",
                                                "ROS_AUTOMATIC_DISCOVERY_RANGE",
                                                "ROS_STATIC_PEERS",
                                                "ROS_DISCOVERY_SERVER",
                                                "RMW_IMPLEMENTATION",
                                                "CYCLONEDDS_URI",
                                                "FASTRTPS_DEFAULT_PROFILES_FILE",
                                                "FASTDDS_DEFAULT_PROFILES_FILE"};
  return kAll;
}

std::string text_of(const Guid& participant) {
  std::string text;
  for (std::size_t i = 0; i < 12; ++i) {
    text += fmt::format("{:02x}", participant[i]);
  }
  return text;
}

std::string name_of(const FoundEndpoint& endpoint) {
  return endpoint.node.empty() ? fmt::format("the participant {}", text_of(endpoint.participant))
                               : endpoint.node;
}

std::string topic_of(const Endpoint& endpoint) {
  return ros2::ros_topic(endpoint.topic).value_or(endpoint.topic);
}

std::string type_of(const Endpoint& endpoint) {
  return ros2::ros_type(endpoint.type).value_or(endpoint.type);
}

std::optional<Finding> trouble_between(const FoundEndpoint& writer, const FoundEndpoint& reader) {
  const Endpoint& from = writer.endpoint;
  const Endpoint& to = reader.endpoint;
  const std::string who =
      fmt::format("{}: from {} to {}", topic_of(from), name_of(writer), name_of(reader));
  if (from.type != to.type) {
    return Finding{.name = "type",
                   .level = Level::kProblem,
                   .found = fmt::format("{} no message passes: written as {}, read as {}", who,
                                        type_of(from), type_of(to)),
                   .why = "two types on one topic",
                   .remedy = "give one of the two topics another name, or both the same type"};
  }
  if (const auto why = mismatch(to.qos, from.qos)) {
    return Finding{.name = "quality",
                   .level = Level::kProblem,
                   .found = fmt::format("{} no message passes: {} (written {}, read {})", who, *why,
                                        to_text(from.qos), to_text(to.qos)),
                   .why = "what a reader asks for, the writer has to offer",
                   .remedy = "give both the same reliability and durability"};
  }
  const std::string_view written = ros2::value_of(from.user_data, "typehash");
  const std::string_view read = ros2::value_of(to.user_data, "typehash");
  if (!written.empty() && !read.empty() && written != read) {
    return Finding{.name = "version",
                   .level = Level::kProblem,
                   .found = fmt::format("{} {} has two versions: written {}, read {}", who,
                                        type_of(from), written, read),
                   .why = "messages are misread",
                   .remedy = "build both with the same definition"};
  }
  return {};
}

std::vector<Finding> diagnose(const Observation& seen) {
  Findings findings;
  look_at_announcements(seen, findings);
  look_at_topics(seen, findings);
  look_for_others(seen, findings);
  look_at_round_trip(seen, findings);
  look_at_multicast(seen, findings);
  look_at_interfaces(seen, findings);
  look_at_buffers(seen, findings);
  look_at_environment(seen, findings);
  Findings worst_first;
  for (const Level level : {Level::kProblem, Level::kAdvice, Level::kFine}) {
    std::ranges::copy_if(findings, std::back_inserter(worst_first),
                         [&](const Finding& finding) { return finding.level == level; });
  }
  return worst_first;
}

}  // namespace fastcycle::dds_gateway
