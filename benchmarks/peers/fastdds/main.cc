// Fast DDS within one process, with loans. https://fast-dds.docs.eprosima.com

#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastrtps/config.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>

#include "peers/common/peer.h"
#include "peers/fastdds/plain_type.h"

namespace fastcycle::peers {
namespace {

namespace dds = eprosima::fastdds::dds;
using Take = std::function<void(const PlainBytes& message, std::int64_t arrived_ns)>;

template <typename Pointer>
Pointer checked(Pointer pointer, const char* what) {
  if (pointer == nullptr) {
    throw std::runtime_error(std::string("Fast DDS makes no ") + what);
  }
  return pointer;
}

void check(const eprosima::fastrtps::types::ReturnCode_t& code, const char* what) {
  if (!(code == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK)) {
    throw std::runtime_error(std::string("Fast DDS: ") + what + " failed");
  }
}

/// The participant, and what deletes everything made of it.
class Participant {
 public:
  explicit Participant(std::size_t size) {
    // "Intra-process delivery ... INTRAPROCESS_FULL: default value": the writer calls the reader,
    // no transport is used.
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

/// Best effort, which does without heartbeats and acknowledgements and loses nothing within a
/// process. A history as short as the mode allows, because the writer goes through all of it before
/// it uses a payload again: a short one stays in the cache.
template <typename Qos>
Qos quality(Qos qos, const Run& run) {
  qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = run.is_flood() ? static_cast<int>(Run::kWindow) : 8;
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

/// Takes all that the reader has, by loan: "the application gets the received samples as a
/// reference to the receive queue itself" (Zero-Copy communication).
void take_all(dds::DataReader& reader, const Take& take) {
  PlainSequence messages;
  dds::SampleInfoSeq infos;
  while (reader.take(messages, infos) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    const std::int64_t arrived_ns = now_ns();
    for (dds::LoanableCollection::size_type i = 0; i < messages.length(); ++i) {
      if (infos[i].valid_data) {
        take(messages[i], arrived_ns);
      }
    }
    reader.return_loan(messages, infos);
  }
}

/// In the thread that Fast DDS calls it in: within a process, that of the publisher.
class Listener final : public dds::DataReaderListener {
 public:
  explicit Listener(Take take) : take_(std::move(take)) {}
  void on_data_available(dds::DataReader* reader) override { take_all(*reader, take_); }

 private:
  const Take take_;
};

/// In a thread of its own, which a wait set wakes.
class Waiter {
 public:
  Waiter(const Run& run, dds::DataReader& reader, Take take)
      : thread_([&run, &reader, called = std::move(take)] {
          dds::WaitSet waitset;
          auto& condition = reader.get_statuscondition();
          condition.set_enabled_statuses(dds::StatusMask::data_available());
          waitset.attach_condition(condition);
          while (!run.is_over()) {
            dds::ConditionSeq triggered;
            waitset.wait(triggered, {0, 100'000'000});
            take_all(reader, called);
          }
          waitset.detach_condition(condition);
        }) {}
  Waiter(const Waiter&) = delete;
  Waiter& operator=(const Waiter&) = delete;
  ~Waiter() { thread_.join(); }

 private:
  std::thread thread_;
};

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
    const std::int64_t deadline_ns = now_ns() + 10'000'000'000;
    dds::PublicationMatchedStatus status;
    while (writer->get_publication_matched_status(status) ==
               eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK &&
           status.current_count == 0) {
      if (now_ns() > deadline_ns) {
        throw std::runtime_error("writer and reader do not find each other");
      }
      measure::sleep_until(now_ns() + 1'000'000);
    }
  }

  [[nodiscard]] PlainBytes* loan() const {
    void* loaned = nullptr;
    check(writer->loan_sample(loaned), "loan_sample");
    return static_cast<PlainBytes*>(loaned);
  }

  dds::DataReader* reader;
  dds::DataWriter* writer;
};

/// How a reader tells that it has data.
enum class Telling : std::uint8_t { kWaitset, kListener };

void measure_loans(Run& run, Telling telling) {
  Participant participant(run.size());
  const Link there(run, participant, "payload");
  const Link back(run, participant, "echo");
  there.wait_until_matched();
  back.wait_until_matched();
  const Take take_down = [&](const PlainBytes& message, std::int64_t arrived_ns) {
    run.arrived(message.stamps(), message.data(), arrived_ns);
  };
  const Take answer = [&](const PlainBytes& message, std::int64_t) {
    PlainBytes* loaned = back.loan();
    loaned->set_stamps(message.stamps());
    loaned->data()[0] = message.data()[0];
    loaned->data()[run.size() - 1] = message.data()[run.size() - 1];
    back.writer->write(loaned);
  };
  const auto listen = [&](const Link& link, const Take& take) {
    auto listener = std::make_unique<Listener>(take);
    link.reader->set_listener(listener.get(), dds::StatusMask::data_available());
    return listener;
  };
  std::unique_ptr<Listener> listeners[2];
  std::optional<Waiter> waiters[2];
  if (telling == Telling::kListener) {
    listeners[0] = listen(there, run.is_rtt() ? answer : take_down);
    listeners[1] = listen(back, take_down);
  } else {
    waiters[0].emplace(run, *there.reader, run.is_rtt() ? answer : take_down);
    waiters[1].emplace(run, *back.reader, take_down);
  }
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    PlainBytes* message = there.loan();
    measure::fill(message->data(), run.size(), number);
    message->set_stamps({.number = number, .made_ns = made_ns, .sent_ns = now_ns()});
    there.writer->write(message);
  });
  there.reader->set_listener(nullptr);
  back.reader->set_listener(nullptr);
}

}  // namespace
}  // namespace fastcycle::peers

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(
      argc, argv,
      {.name = "fastdds",
       .version = FASTRTPS_VERSION_STR,
       .variants = {
           {.name = "waitset",
            .about =
                "Intra-process delivery of loans; a thread waits on a wait set. An answer is a "
                "new loan with the stamps and both ends of the payload.",
            .delivery = Delivery::kBetweenThreads,
            .is_typed = true,
            .copies = "none",
            .measure = [](Run& run) { measure_loans(run, Telling::kWaitset); }},
           {.name = "listener",
            .about =
                "Intra-process delivery of loans; the publisher's thread runs the callback. An "
                "answer is a new loan with the stamps and both ends of the payload.",
            .delivery = Delivery::kPublishersThread,
            .is_typed = true,
            .copies = "none",
            .measure = [](Run& run) { measure_loans(run, Telling::kListener); }}}});
}
