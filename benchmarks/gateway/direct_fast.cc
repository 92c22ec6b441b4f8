// Fast DDS, with messages that are already serialized. https://fast-dds.docs.eprosima.com
#include <chrono>
#include <stdexcept>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include "dds_gateway/interface.h"
#include "gateway/direct.h"

namespace fastcycle::direct {
namespace {

namespace fdds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using namespace std::chrono_literals;

constexpr int kDepth = 10;

template <typename T>
T* checked(T* made, const char* what) {
  if (made == nullptr) {
    throw std::runtime_error(std::string("Fast DDS makes no ") + what);
  }
  return made;
}

/// Messages are vectors of the bytes to send.
class BytesType final : public fdds::TopicDataType {
 public:
  using Bytes = std::vector<std::byte>;

  BytesType() {
    setName("fastcycle::Bytes");
    m_typeSize = 1024;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto& bytes = *static_cast<const std::span<const std::byte>*>(data);
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    const auto* const from = reinterpret_cast<const std::byte*>(payload->data);
    static_cast<Bytes*>(data)->assign(from, from + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] {
      return static_cast<std::uint32_t>(
          static_cast<const std::span<const std::byte>*>(data)->size());
    };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void* /*data*/, rtps::InstanceHandle_t* /*handle*/, bool /*is_md5*/) override {
    return false;
  }
};

class Listener final : public fdds::DataReaderListener {
 public:
  void on_data_available(fdds::DataReader* reader) override {
    fdds::SampleInfo info;
    while (reader->take_next_sample(&bytes_, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
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
