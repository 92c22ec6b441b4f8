#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#if __has_include(<fastdds/LibrarySettings.hpp>)
#define FASTCYCLE_FAST_DDS 3
#include <fastdds/rtps/common/WriteParams.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.hpp>
#include <fastdds/utils/IPLocator.hpp>
#else
#define FASTCYCLE_FAST_DDS 2
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#endif

/// What differs between Fast DDS 2 (Debian 12) and 3 (Debian 13), in one form.
namespace fastcycle::fast_dds {

namespace fdds = eprosima::fastdds::dds;

#if FASTCYCLE_FAST_DDS == 3
namespace rtps = eprosima::fastdds::rtps;
using Duration = fdds::Duration_t;
using ReturnCode = fdds::ReturnCode_t;
inline bool is_ok(const ReturnCode& code) {
  return code == fdds::RETCODE_OK;
}
#else
namespace rtps = eprosima::fastrtps::rtps;
using Duration = eprosima::fastrtps::Duration_t;
using ReturnCode = eprosima::fastrtps::types::ReturnCode_t;
inline bool is_ok(const ReturnCode& code) {
  return code == ReturnCode::RETCODE_OK;
}
inline bool is_ok(bool is_written) {
  return is_written;
}
#endif

/// A type without a key that is only known by its name: its messages are serialized already.
class SerializedType : public fdds::TopicDataType {
 public:
  /// `first_bytes`: what is reserved for a message at first.
  SerializedType(const std::string& name, std::uint32_t first_bytes) {
#if FASTCYCLE_FAST_DDS == 3
    set_name(name);
    max_serialized_type_size = first_bytes;
    is_compute_key_provided = false;
#else
    setName(name.c_str());
    m_typeSize = first_bytes;
    m_isGetKeyDefined = false;
#endif
  }

 protected:
  [[nodiscard]] virtual std::uint32_t size_of(const void* sample) const = 0;
  /// Returns false if the message does not fit into `payload`.
  virtual bool put(const void* sample, rtps::SerializedPayload_t& payload) = 0;
  virtual bool take(const rtps::SerializedPayload_t& payload, void* sample) = 0;
  [[nodiscard]] virtual void* create() = 0;
  virtual void destroy(void* sample) = 0;

 private:
#if FASTCYCLE_FAST_DDS == 3
  bool serialize(const void* data, rtps::SerializedPayload_t& payload,
                 fdds::DataRepresentationId_t /*representation*/) final {
    return put(data, payload);
  }
  bool deserialize(rtps::SerializedPayload_t& payload, void* data) final {
    return take(payload, data);
  }
  std::uint32_t calculate_serialized_size(const void* data,
                                          fdds::DataRepresentationId_t /*representation*/) final {
    return size_of(data);
  }
  void* create_data() final { return create(); }
  void delete_data(void* data) final { destroy(data); }
  bool compute_key(rtps::SerializedPayload_t& /*payload*/, rtps::InstanceHandle_t& /*handle*/,
                   bool /*is_md5*/) final {
    return false;
  }
  bool compute_key(const void* /*data*/, rtps::InstanceHandle_t& /*handle*/,
                   bool /*is_md5*/) final {
    return false;
  }
#else
  bool serialize(void* data, rtps::SerializedPayload_t* payload) final {
    return put(data, *payload);
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) final {
    return take(*payload, data);
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) final {
    return [this, data] { return size_of(data); };
  }
  void* createData() final { return create(); }
  void deleteData(void* data) final { destroy(data); }
  bool getKey(void* /*data*/, rtps::InstanceHandle_t* /*handle*/, bool /*is_md5*/) final {
    return false;
  }
#endif
};

/// A reader or a writer of another participant.
struct SeenEndpoint {
  rtps::GUID_t guid;
  std::string topic;
  std::string type;
  fdds::UserDataQosPolicy user_data;
  bool is_reliable = false;
  bool is_transient_local = false;
  bool is_reader = false;
};

/// Receives what discovery finds and loses. Changes of QoS are left out.
///
/// @threads  Those of Fast DDS.
class DiscoveryListener : public fdds::DomainParticipantListener {
 protected:
  virtual void on_participant(const rtps::GUID_t& guid, const fdds::UserDataQosPolicy& user_data,
                              bool is_gone) = 0;
  virtual void on_endpoint(const fdds::DomainParticipant& participant, SeenEndpoint seen,
                           bool is_gone) = 0;

 private:
#if FASTCYCLE_FAST_DDS == 3
  void on_participant_discovery(fdds::DomainParticipant* /*participant*/,
                                rtps::ParticipantDiscoveryStatus status,
                                const fdds::ParticipantBuiltinTopicData& info,
                                bool& /*should_be_ignored*/) final {
    using Status = rtps::ParticipantDiscoveryStatus;
    if (status != Status::CHANGED_QOS_PARTICIPANT) {
      on_participant(info.guid, info.user_data, status != Status::DISCOVERED_PARTICIPANT);
    }
  }
  void on_data_reader_discovery(fdds::DomainParticipant* participant,
                                rtps::ReaderDiscoveryStatus status,
                                const fdds::SubscriptionBuiltinTopicData& info,
                                bool& /*should_be_ignored*/) final {
    using Status = rtps::ReaderDiscoveryStatus;
    if (status != Status::CHANGED_QOS_READER) {
      on_endpoint(*participant, seen_of(info, true), status == Status::REMOVED_READER);
    }
  }
  void on_data_writer_discovery(fdds::DomainParticipant* participant,
                                rtps::WriterDiscoveryStatus status,
                                const fdds::PublicationBuiltinTopicData& info,
                                bool& /*should_be_ignored*/) final {
    using Status = rtps::WriterDiscoveryStatus;
    if (status != Status::CHANGED_QOS_WRITER) {
      on_endpoint(*participant, seen_of(info, false), status == Status::REMOVED_WRITER);
    }
  }
  template <typename T>
  static SeenEndpoint seen_of(const T& info, bool is_reader) {
    return {.guid = info.guid,
            .topic = info.topic_name.to_string(),
            .type = info.type_name.to_string(),
            .user_data = info.user_data,
            .is_reliable = info.reliability.kind == fdds::RELIABLE_RELIABILITY_QOS,
            .is_transient_local = info.durability.kind != fdds::VOLATILE_DURABILITY_QOS,
            .is_reader = is_reader};
  }
#else
  void on_participant_discovery(fdds::DomainParticipant* /*participant*/,
                                rtps::ParticipantDiscoveryInfo&& info) final {
    using Status = rtps::ParticipantDiscoveryInfo;
    if (info.status != Status::CHANGED_QOS_PARTICIPANT) {
      on_participant(info.info.m_guid, info.info.m_userData,
                     info.status != Status::DISCOVERED_PARTICIPANT);
    }
  }
  void on_subscriber_discovery(fdds::DomainParticipant* participant,
                               rtps::ReaderDiscoveryInfo&& info) final {
    using Status = rtps::ReaderDiscoveryInfo;
    if (info.status != Status::CHANGED_QOS_READER) {
      on_endpoint(*participant, seen_of(info.info, true), info.status == Status::REMOVED_READER);
    }
  }
  void on_publisher_discovery(fdds::DomainParticipant* participant,
                              rtps::WriterDiscoveryInfo&& info) final {
    using Status = rtps::WriterDiscoveryInfo;
    if (info.status != Status::CHANGED_QOS_WRITER) {
      on_endpoint(*participant, seen_of(info.info, false), info.status == Status::REMOVED_WRITER);
    }
  }
  template <typename T>
  static SeenEndpoint seen_of(const T& info, bool is_reader) {
    return {.guid = info.guid(),
            .topic = info.topicName().to_string(),
            .type = info.typeName().to_string(),
            .user_data = info.m_qos.m_userData,
            .is_reliable = info.m_qos.m_reliability.kind == fdds::RELIABLE_RELIABILITY_QOS,
            .is_transient_local = info.m_qos.m_durability.kind != fdds::VOLATILE_DURABILITY_QOS,
            .is_reader = is_reader};
  }
#endif
};

}  // namespace fastcycle::fast_dds
