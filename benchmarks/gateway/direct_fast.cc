// Fast DDS, with messages that are already serialized. https://fast-dds.docs.eprosima.com
#include <chrono>
#include <cstring>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "dds_gateway/fast_dds.h"
#include "dds_gateway/interface.h"
#include "gateway/direct.h"

namespace fastcycle::direct {
namespace {

namespace fdds = fast_dds::fdds;
namespace rtps = fast_dds::rtps;
using namespace std::chrono_literals;

constexpr int kDepth = 10;

template <typename T>
T* checked(T* made, const char* what) {
  if (made == nullptr) {
    throw std::runtime_error(std::string("Fast DDS makes no ") + what);
  }
  return made;
}

/// Messages are spans of the bytes to send, and vectors of those received.
class BytesType final : public fast_dds::SerializedType {
 public:
  using Bytes = std::vector<std::byte>;

  BytesType() : SerializedType("fastcycle::Bytes", 1024) {}

 private:
  [[nodiscard]] std::uint32_t size_of(const void* sample) const override {
    return static_cast<std::uint32_t>(
        static_cast<const std::span<const std::byte>*>(sample)->size());
  }
  bool put(const void* sample, rtps::SerializedPayload_t& payload) override {
    const auto& bytes = *static_cast<const std::span<const std::byte>*>(sample);
    std::memcpy(payload.data, bytes.data(), bytes.size());
    payload.length = static_cast<std::uint32_t>(bytes.size());
    return true;
  }
  bool take(const rtps::SerializedPayload_t& payload, void* sample) override {
    const auto* const from = reinterpret_cast<const std::byte*>(payload.data);
    static_cast<Bytes*>(sample)->assign(from, from + payload.length);
    return true;
  }
  [[nodiscard]] void* create() override { return new Bytes; }
  void destroy(void* sample) override { delete static_cast<Bytes*>(sample); }
};

class Listener final : public fdds::DataReaderListener {
 public:
  void on_data_available(fdds::DataReader* reader) override {
    fdds::SampleInfo info;
    while (fast_dds::is_ok(reader->take_next_sample(&bytes_, &info))) {
      if (info.valid_data) {
        samples.push_back(Message::read(bytes_));
      }
    }
  }

  measure::Samples samples;

 private:
  BytesType::Bytes bytes_;  // Reused, so that its memory is warm.
};

template <typename Qos>
Qos qos_of() {
  Qos qos;
  qos.reliability().kind = fdds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = fdds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = fdds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = kDepth;
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
  return qos;
}

fdds::DomainParticipantQos participant_qos(const std::string& interface) {
  constexpr std::uint32_t kBufferBytes = 4U << 20U;
  fdds::DomainParticipantQos qos;
  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  const std::string address = dds_gateway::find_interface(interface).address;
  udp->interfaceWhiteList.push_back(address);
  udp->receiveBufferSize = kBufferBytes;
  udp->sendBufferSize = kBufferBytes;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  rtps::Locator_t peer;
  rtps::IPLocator::setIPv4(peer, address);
  qos.wire_protocol().builtin.initialPeersList.push_back(peer);
  qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(peer);
  qos.wire_protocol().default_unicast_locator_list.push_back(peer);
  return qos;
}

}  // namespace

measure::Samples run(const Plan& plan) {
  auto* const factory = fdds::DomainParticipantFactory::get_instance();
  fdds::DomainParticipant* const participant = checked(
      factory->create_participant(plan.domain, participant_qos(plan.interface)), "participant");
  fdds::TypeSupport type(new BytesType);
  (void)type.register_type(participant);
  fdds::Topic* const topic = checked(
      participant->create_topic("payload", type.get_type_name(), fdds::TOPIC_QOS_DEFAULT), "topic");
  Listener listener;
  measure::reserve(listener.samples, 100'000);
  if (plan.is_sender) {
    fdds::DataWriter* const writer =
        checked(checked(participant->create_publisher(fdds::PUBLISHER_QOS_DEFAULT), "publisher")
                    ->create_datawriter(topic, qos_of<fdds::DataWriterQos>()),
                "writer");
    fdds::PublicationMatchedStatus status;
    while (status.current_count == 0) {
      std::this_thread::sleep_for(10ms);
      (void)writer->get_publication_matched_status(status);
    }
    std::this_thread::sleep_for(200ms);
    send_all(plan, [&](std::span<const std::byte> bytes) { (void)writer->write(&bytes); });
    std::this_thread::sleep_for(300ms);
  } else {
    fdds::DataReader* const reader =
        checked(checked(participant->create_subscriber(fdds::SUBSCRIBER_QOS_DEFAULT), "subscriber")
                    ->create_datareader(topic, qos_of<fdds::DataReaderQos>(), &listener),
                "reader");
    wait_for_end();
    (void)reader->set_listener(nullptr);
  }
  (void)participant->delete_contained_entities();
  (void)factory->delete_participant(participant);
  return std::move(listener.samples);
}

}  // namespace fastcycle::direct
