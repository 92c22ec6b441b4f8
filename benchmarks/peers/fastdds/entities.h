#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastrtps/xmlparser/XMLProfileManager.h>

#include "peers/common/run.h"
#include "peers/common/wait.h"
#include "peers/fastdds/plain_type.h"

namespace fastcycle::peers {

namespace dds = eprosima::fastdds::dds;

template <typename Pointer>
Pointer checked(Pointer pointer, const char* what) {
  if (pointer == nullptr) {
    throw std::runtime_error(std::string("Fast DDS makes no ") + what);
  }
  return pointer;
}

inline void check(const eprosima::fastrtps::types::ReturnCode_t& code, const char* what) {
  if (!(code == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK)) {
    throw std::runtime_error(std::string("Fast DDS: ") + what + " failed");
  }
}

/// Owns the participant and all entities created from it.
class Participant {
 public:
  explicit Participant(std::size_t size) {
    // Intra-process delivery, which is the default: the writer calls the reader's reception
    // functions and no transport is used.
    eprosima::fastrtps::LibrarySettingsAttributes settings;
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_FULL;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
    auto* factory = dds::DomainParticipantFactory::get_instance();
    participant_ =
        checked(factory->create_participant(0, dds::PARTICIPANT_QOS_DEFAULT), "participant");
    dds::TypeSupport(new PlainType(size)).register_type(participant_, kTypeName);
    publisher = checked(participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT), "publisher");
    subscriber =
        checked(participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT), "subscriber");
  }
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;
  ~Participant() {
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }

  [[nodiscard]] dds::Topic* make_topic(const char* name) {
    return checked(participant_->create_topic(name, kTypeName, dds::TOPIC_QOS_DEFAULT), "topic");
  }

  dds::Publisher* publisher;
  dds::Subscriber* subscriber;

 private:
  static constexpr const char* kTypeName = "fastcycle::peers::PlainType";

  dds::DomainParticipant* participant_;
};

/// The maximum lead of a writer over a reader. The writer cycles through the whole history before
/// it reuses a payload, so the history is short for large payloads: it should fit in the cache.
inline int history_depth(const Run& run) {
  if (run.is_flood()) {
    return static_cast<int>(Run::kWindow);
  }
  constexpr std::size_t kBytes = 4 << 20;
  return static_cast<int>(std::clamp<std::size_t>(kBytes / run.size(), 16, 64));
}

/// Best effort has no heartbeats and acknowledgements, and loses nothing within a process.
template <typename Qos>
Qos quality(Qos qos, const Run& run) {
  qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = history_depth(run);
  qos.resource_limits().max_samples = qos.history().depth;
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().max_samples_per_instance = qos.history().depth;
  qos.resource_limits().allocated_samples = qos.history().depth;
  qos.resource_limits().extra_samples = 4;  // On loan, besides those of the history.
  // Data-sharing goes through a file of shared memory; within a process it would only be a second
  // way beside the writer's own call.
  qos.data_sharing().off();
  return qos;
}

/// A writer and a reader of one topic.
struct Link {
  Link(const Run& run, Participant& participant, const char* name) {
    dds::Topic* topic = participant.make_topic(name);
    reader = checked(participant.subscriber->create_datareader(
                         topic, quality(participant.subscriber->get_default_datareader_qos(), run)),
                     "reader");
    writer = checked(participant.publisher->create_datawriter(
                         topic, quality(participant.publisher->get_default_datawriter_qos(), run)),
                     "writer");
  }

  void wait_until_matched() const {
    wait_until("writer and reader find each other", [this] {
      dds::PublicationMatchedStatus status;
      check(writer->get_publication_matched_status(status), "matched status");
      return status.current_count > 0;
    });
  }

  [[nodiscard]] PlainBytes* loan() const {
    void* loaned = nullptr;
    check(writer->loan_sample(loaned), "loan_sample");
    return static_cast<PlainBytes*>(loaned);
  }

  dds::DataReader* reader;
  dds::DataWriter* writer;
};

}  // namespace fastcycle::peers
