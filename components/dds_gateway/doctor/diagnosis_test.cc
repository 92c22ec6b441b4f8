#include "dds_gateway/doctor/diagnosis.h"

#include <algorithm>
#include <string>

#include <gmock/gmock.h>

#include "dds_gateway/doctor/to_text.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kString = "std_msgs::msg::dds_::String_";

Guid guid_of(std::uint8_t number) {
  Guid guid{};
  guid[0] = 1;
  guid[1] = 0x10;
  guid[11] = number;
  return guid;
}

FoundEndpoint end_of(const std::string& node, bool is_reader, const Qos& qos,
                     const std::string& type = kString) {
  return {.guid = {},
          .participant = guid_of(is_reader ? 2 : 1),
          .endpoint = {.topic = "rt/points",
                       .type = type,
                       .user_data = {},
                       .qos = qos,
                       .is_reader = is_reader},
          .node = node};
}

/// A network in which all is well.
Observation healthy() {
  Observation seen;
  seen.domain = 0;
  seen.watched = 10s;
  seen.interfaces = {{.name = "eth0",
                      .address = "192.168.1.5",
                      .index = 2,
                      .is_loopback = false,
                      .is_multicast = true}};
  seen.multicast_returns = {{"eth0", true}};
  seen.receive_buffer_max = 8 << 20;
  seen.participants = {{.guid = guid_of(1), .user_data = "enclave=/;"},
                       {.guid = guid_of(2), .user_data = "enclave=/;"}};
  seen.endpoints = {end_of("/driver", false, {}), end_of("/perception", true, {})};
  seen.round_trip = RoundTripResult{.found_after = 12ms, .small = {1ms}, .large = {3ms}, .lost = 0};
  return seen;
}

ReceivedAnnouncement announcement_from(const std::string& address, std::uint32_t domain = 0) {
  return {.announcement = {.participant = guid_of(9),
                           .name = "camera",
                           .addresses = {address},
                           .is_secured = false},
          .domain = domain,
          .from = address,
          .interface = "eth0"};
}

Finding find(const Observation& seen, const std::string& name) {
  const auto all = diagnose(seen);
  const auto found = std::ranges::find(all, name, &Finding::name);
  EXPECT_NE(found, all.end()) << name;
  return found == all.end() ? Finding{} : *found;
}

TEST(Diagnosis, IsFineWhereAllIsWell) {
  for (const Finding& finding : diagnose(healthy())) {
    EXPECT_EQ(finding.level, Level::kFine) << finding.name << ": " << finding.found;
    EXPECT_EQ(finding.why, "");
  }
}

TEST(Diagnosis, TellsQualitiesThatDoNotMatchWithBothValues) {
  Observation seen = healthy();
  seen.endpoints[0].endpoint.qos.is_reliable = false;

  const Finding finding = find(seen, "quality");

  EXPECT_EQ(finding.level, Level::kProblem);
  EXPECT_EQ(finding.found,
            "/points: from /driver to /perception no message passes: the reader asks for reliable, "
            "the writer offers best effort (written best effort, volatile, read reliable, "
            "volatile)");
}

TEST(Diagnosis, TellsTypesThatDiffer) {
  Observation seen = healthy();
  seen.endpoints[1] = end_of("/perception", true, {}, "std_msgs::msg::dds_::Int8_");

  EXPECT_THAT(find(seen, "type").found,
              HasSubstr("written as std_msgs/msg/String, read as std_msgs/msg/Int8"));
}

TEST(Diagnosis, TellsVersionsOfATypeThatDiffer) {
  Observation seen = healthy();
  seen.endpoints[0].endpoint.user_data = "typehash=RIHS01_aa;";
  seen.endpoints[1].endpoint.user_data = "typehash=RIHS01_bb;";

  EXPECT_THAT(find(seen, "version").found, HasSubstr("written RIHS01_aa, read RIHS01_bb"));
}

TEST(Diagnosis, TellsTheSameTroubleOnceAndOnlyTheFirstOfMany) {
  Observation seen = healthy();
  seen.endpoints[0].endpoint.qos.is_reliable = false;
  for (int i = 0; i < 60; ++i) {
    seen.endpoints.push_back(end_of("/reader" + std::to_string(i), true, {}));
    seen.endpoints.push_back(end_of("/reader" + std::to_string(i), true, {}));
  }

  const auto all = diagnose(seen);

  EXPECT_EQ(std::ranges::count(all, "quality", &Finding::name), 50);
  EXPECT_EQ(find(seen, "topics").found, "11 more of this kind");
}

TEST(Diagnosis, TellsWhoIsInAnotherDomain) {
  Observation seen = healthy();
  seen.participants.clear();
  seen.endpoints.clear();
  seen.domains_in_use = {{7, 2}};
  seen.announcements = {announcement_from("192.168.1.9", 42)};

  const Finding finding = find(seen, "domain");

  EXPECT_EQ(finding.level, Level::kProblem);
  EXPECT_THAT(finding.found,
              AllOf(HasSubstr("nobody was found in the domain 0 within 10 s"),
                    HasSubstr("there are participants in the domain 7 on this machine; 42 on "
                              "192.168.1.9")));
}

TEST(Diagnosis, TellsThatProgramsOfThisMachineAreInTheDomainAndNotFound) {
  Observation seen = healthy();
  seen.participants.clear();
  seen.endpoints.clear();
  seen.domains_in_use = {{0, 2}};

  const Finding finding = find(seen, "discovery");

  EXPECT_EQ(finding.level, Level::kProblem);
  EXPECT_THAT(finding.found, HasSubstr("though programs of this machine have its ports open"));
  EXPECT_THAT(finding.why, HasSubstr("ROS_LOCALHOST_ONLY=1"));
}

TEST(Diagnosis, ReportsWhoAnnouncesItselfAndIsNotFoundAsAFirewallDoesIt) {
  Observation seen = healthy();
  seen.announcements = {announcement_from("192.168.1.9")};

  const Finding finding = find(seen, "firewall");

  EXPECT_EQ(finding.level, Level::kProblem);
  EXPECT_EQ(finding.found, "192.168.1.9 (Cyclone DDS, camera) announces itself, but was not found");
  EXPECT_THAT(finding.remedy, HasSubstr("--dport 7400: -j ACCEPT"));
  seen.participants.push_back({.guid = guid_of(9), .user_data = {}});
  EXPECT_THAT(find(seen, "firewall").found,
              HasSubstr("announces itself, but none of its topics came"));
}

TEST(Diagnosis, TellsWhoTalksToItsOwnMachineAlone) {
  Observation seen = healthy();
  seen.announcements = {announcement_from("192.168.1.9")};
  seen.announcements[0].announcement.addresses = {"127.0.0.1"};

  EXPECT_THAT(find(seen, "localhost only").found, HasSubstr("expects replies only at 127.0.0.1"));
}

TEST(Diagnosis, TellsWhoHasSecurityAndWhoIsOnAnotherInterface) {
  Observation seen = healthy();
  seen.announcements = {announcement_from("192.168.1.9")};
  seen.announcements[0].announcement.is_secured = true;
  EXPECT_THAT(find(seen, "security").found, HasSubstr("has security, and this has none"));

  seen.announcements[0].announcement.is_secured = false;
  seen.interface = "lo";
  EXPECT_THAT(find(seen, "interface").found,
              HasSubstr("announces itself on eth0, and this looks at lo"));
}

TEST(Diagnosis, TellsMulticastThatDoesNotComeBackAndARoundTripThatFails) {
  Observation seen = healthy();
  seen.multicast_returns = {{"eth0", false}};
  seen.round_trip = RoundTripResult{};

  EXPECT_THAT(find(seen, "multicast").found,
              HasSubstr("what is sent to 239.255.0.1 on eth0 does not come back"));
  EXPECT_THAT(find(seen, "round trip").found,
              HasSubstr("another process of this machine was not found within 10 s"));
}

TEST(Diagnosis, TellsWhatTheEnvironmentDoesToNodes) {
  Observation seen = healthy();
  seen.environment = {{"ROS_DOMAIN_ID", "5"}};
  EXPECT_THAT(find(seen, "environment").found, HasSubstr("ROS_DOMAIN_ID=5"));
  seen.environment = {{"ROS_LOCALHOST_ONLY", "1"}};
  EXPECT_THAT(find(seen, "environment").why, HasSubstr("talk to this machine alone"));
  seen.environment = {{"RMW_IMPLEMENTATION", "rmw_zenoh_cpp"}};
  EXPECT_THAT(find(seen, "environment").why, HasSubstr("do not use DDS"));
}

TEST(Diagnosis, IsReportedWithWhoIsThereAndNothingThatWouldSteerATerminal) {
  Observation seen = healthy();
  seen.endpoints[0].node = "/dri\x1b[31mver";

  const std::string text = to_text(seen, diagnose(seen));

  EXPECT_THAT(text, AllOf(HasSubstr("  /perception (Cyclone DDS)\n    reads   /points  "
                                    "std_msgs/msg/String  reliable, volatile\n"),
                          HasSubstr("/dri\\x1b[31mver"), Not(HasSubstr("\x1b")),
                          HasSubstr("\n0 problems, 0 possible improvements\n")));
}

}  // namespace
}  // namespace fastcycle::dds_gateway
