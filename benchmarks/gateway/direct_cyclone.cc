// Cyclone DDS, with messages that are already serialized. https://cyclonedds.io
#include <stdexcept>

#include <dds/dds.h>
#include <fmt/format.h>

#include "dds_gateway/cyclone_types.h"
#include "gateway/direct.h"

namespace fastcycle::direct {
namespace {

constexpr const char* kTopic = "payload";
constexpr const char* kType = "fastcycle::Bytes";
constexpr int kDepth = 10;

dds_entity_t checked(dds_return_t result, const char* what) {
  if (result < 0) {
    throw std::runtime_error(fmt::format("{}: {}", what, dds_strretcode(-result)));
  }
  return result;
}

/// A reader's callback: takes all available messages.
void take_all(dds_entity_t reader, void* samples) {
  ddsi_serdata* message = nullptr;
  dds_sample_info_t info;
  while (dds_takecdr(reader, &message, 1, &info, DDS_ANY_STATE) == 1) {
    if (info.valid_data) {
      static_cast<measure::Samples*>(samples)->push_back(
          Message::read(dds_gateway::bytes_of(message)));
    }
    ddsi_serdata_unref(message);
  }
}

}  // namespace

measure::Samples run(const Plan& plan) {
  measure::Samples samples;
  measure::reserve(samples, 100'000);
  const std::string configuration = fmt::format(
      "<Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"{}\"/></Interfaces>"
      "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
      "</ParticipantIndex><Peers><Peer address=\"localhost\"/></Peers></Discovery></Domain>",
      plan.interface);
  const dds_entity_t domain =
      checked(dds_create_domain(plan.domain, configuration.c_str()), "domain");
  const dds_entity_t participant =
      checked(dds_create_participant(plan.domain, nullptr, nullptr), "participant");
  ddsi_sertype* type = dds_gateway::make_raw_type(kType);
  const dds_entity_t topic = checked(
      dds_create_topic_sertype(participant, kTopic, &type, nullptr, nullptr, nullptr), "topic");
  dds_qos_t* const qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kDepth);
  if (plan.is_sender) {
    const dds_entity_t writer =
        checked(dds_create_writer(participant, topic, qos, nullptr), "writer");
    dds_publication_matched_status_t status{};
    while (status.current_count == 0) {
      dds_sleepfor(DDS_MSECS(10));
      checked(dds_get_publication_matched_status(writer, &status), "matched");
    }
    dds_sleepfor(DDS_MSECS(200));
    send_all(plan, [&](std::span<const std::byte> bytes) {
      ros2::Buffer message;
      std::memcpy(message.grow(bytes.size()), bytes.data(), bytes.size());
      checked(dds_writecdr(writer, dds_gateway::make_raw_message(type, std::move(message))),
              "write");
    });
    dds_sleepfor(DDS_MSECS(300));
  } else {
    dds_listener_t* const listener = dds_create_listener(&samples);
    dds_lset_data_available(listener, take_all);
    checked(dds_create_reader(participant, topic, qos, listener), "reader");
    dds_delete_listener(listener);
    wait_for_end();
  }
  dds_delete_qos(qos);
  dds_delete(domain);
  return samples;
}

}  // namespace fastcycle::direct
