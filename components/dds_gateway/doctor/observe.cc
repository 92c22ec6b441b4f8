#include "dds_gateway/doctor/observe.h"

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <optional>

#include "dds_gateway/interface.h"
#include "dds_gateway/ros_graph.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;

constexpr std::chrono::milliseconds kServe = 50ms;  // Maximum delay of a message's timeout.

void look_at_machine(Observation& seen) {
  for (const char* const name : variables_of_interest()) {
    if (const char* const value = std::getenv(name)) {
      seen.environment[name] = value;
    }
  }
  seen.interfaces = local_interfaces();
  for (const LocalInterface& interface : seen.interfaces) {
    if (interface.is_multicast && (seen.interface.empty() || interface.name == seen.interface)) {
      seen.multicast_returns[interface.name] = does_multicast_return(interface);
    }
  }
  seen.receive_buffer_max = receive_buffer_max("/");
  seen.domains_in_use = domains_in_use("/");
}

}  // namespace

Observation observe(const ObserveOptions& options) {
  if (!options.participant.interface.empty()) {
    (void)find_interface(options.participant.interface);  // Reports an unknown interface first.
  }
  Observation seen{.domain = options.participant.domain,
                   .interface = options.participant.interface,
                   .is_secured = !options.participant.security.empty(),
                   .watched = std::chrono::ceil<std::chrono::seconds>(options.time)};
  look_at_machine(seen);

  const Listener listener(seen.interfaces);
  ParticipantOptions own = options.participant;
  own.user_data = kDoctorUserData;
  const std::unique_ptr<Participant> participant = options.engine->create(own);
  Picture picture;
  const std::unique_ptr<Reader> graph = participant->create_reader(
      graph_endpoint(true),
      [&](std::span<const std::byte> message, const SampleInfo&) { picture.take_graph(message); });
  std::optional<RoundTrip> round_trip;
  if (!options.program.empty()) {
    round_trip.emplace(*participant, options.program,
                       std::vector<std::string>{"echo", options.engine->name,
                                                std::to_string(own.domain), own.interface});
  }
  const auto end = std::chrono::steady_clock::now() + options.time;
  while (std::chrono::steady_clock::now() < end) {
    participant->serve(kServe);
    for (const Discovery& discovery : participant->discoveries()) {
      picture.take(discovery);
    }
    if (round_trip) {
      round_trip->step();
    }
  }

  seen.announcements = listener.announcements();
  // Excludes its own announcements, and those of the other end of the round trip.
  std::erase_if(seen.announcements, [&](const ReceivedAnnouncement& received) {
    return received.announcement.participant == participant->guid() ||
           picture.is_doctor(received.announcement.participant);
  });
  seen.participants = picture.participants();
  seen.endpoints = picture.endpoints();
  if (round_trip) {
    seen.round_trip = round_trip->result();
  }
  return seen;
}

}  // namespace fastcycle::dds_gateway
