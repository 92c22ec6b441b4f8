// DDS by eProsima Fast DDS.
#include <algorithm>
#include <atomic>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "base/clock.h"
#include "dds_gateway/bell.h"
#include "dds_gateway/engine.h"
#include "dds_gateway/fast_dds.h"
#include "dds_gateway/interface.h"
#include "dds_gateway/waiting_messages.h"
#include "dds_security/enclave.h"

namespace fastcycle::dds_gateway {
namespace {

namespace fdds = fast_dds::fdds;
namespace rtps = fast_dds::rtps;
using fast_dds::is_ok;

constexpr std::uint32_t kFirstBytes = 1024;  // Initial message buffer, which grows.
constexpr std::uint32_t kReceiveBytes = 4U << 20U;
constexpr std::uint32_t kPeersMax = 32;
constexpr std::uint32_t kBlockingMax_ns = 100'000'000;

template <typename T>
T* check(T* made, std::string_view what) {
  if (made == nullptr) {
    throw EngineError(fmt::format("Fast DDS: {}: it could not be made", what));
  }
  return made;
}

Guid guid_of(const rtps::GUID_t& from) {
  Guid guid;
  std::copy_n(from.guidPrefix.value, 12, guid.begin());
  std::copy_n(from.entityId.value, 4, guid.begin() + 12);
  return guid;
}

rtps::GUID_t to_guid(const Guid& from) {
  rtps::GUID_t guid;
  std::copy_n(from.begin(), 12, guid.guidPrefix.value);
  std::copy_n(from.begin() + 12, 4, guid.entityId.value);
  return guid;
}

/// The identity of a request, or of the request that a reply answers. A request is numbered by its
/// writer; its client is the reader of the replies, if given.
Identity identity_of(const fdds::SampleInfo& info, Role role) {
  const rtps::SampleIdentity& related = info.related_sample_identity;
  const bool has_related = related.writer_guid() != rtps::GUID_t::unknown();
  if (role == Role::kRequests) {
    return {
        .asker = guid_of(has_related ? related.writer_guid() : info.sample_identity.writer_guid()),
        .number = static_cast<std::int64_t>(info.sample_identity.sequence_number().to64long())};
  }
  return {.asker = guid_of(related.writer_guid()),
          .number = static_cast<std::int64_t>(related.sequence_number().to64long())};
}

std::string text_of(const fdds::UserDataQosPolicy& data) {
  std::string text(data.begin(), data.end());
  while (!text.empty() && text.back() == '\0') {
    text.pop_back();
  }
  return text;
}

/// A message in the form in which Fast DDS sends and receives it.
struct RawSample {
  std::span<const std::byte> sent = {};  ///< To be sent.
  ros2::Buffer received = {};            ///< The received message,
  /// or the callback that reads it in place.
  const std::function<void(std::span<const std::byte>)>* at_once = nullptr;
};

/// Messages are `RawSample`s.
class RawType final : public fast_dds::SerializedType {
 public:
  explicit RawType(const std::string& name) : SerializedType(name, kFirstBytes) {}

 private:
  [[nodiscard]] std::uint32_t size_of(const void* sample) const override {
    return static_cast<std::uint32_t>(static_cast<const RawSample*>(sample)->sent.size());
  }
  bool put(const void* sample, rtps::SerializedPayload_t& payload) override {
    const std::span<const std::byte> bytes = static_cast<const RawSample*>(sample)->sent;
    if (bytes.size() > payload.max_size) {
      return false;
    }
    std::memcpy(payload.data, bytes.data(), bytes.size());
    payload.length = static_cast<std::uint32_t>(bytes.size());
    payload.encapsulation = CDR_LE;
    return true;
  }
  bool take(const rtps::SerializedPayload_t& payload, void* to) override {
    auto& sample = *static_cast<RawSample*>(to);
    const std::span bytes(reinterpret_cast<const std::byte*>(payload.data), payload.length);
    if (sample.at_once != nullptr) {
      (*sample.at_once)(bytes);
      return true;
    }
    sample.received.clear();
    std::memcpy(sample.received.grow(bytes.size()), bytes.data(), bytes.size());
    return true;
  }
  [[nodiscard]] void* create() override { return new RawSample; }
  void destroy(void* sample) override { delete static_cast<RawSample*>(sample); }
};

template <typename T>
void put_qos(const Endpoint& endpoint, T& qos) {
  qos.reliability().kind =
      endpoint.qos.is_reliable ? fdds::RELIABLE_RELIABILITY_QOS : fdds::BEST_EFFORT_RELIABILITY_QOS;
  qos.reliability().max_blocking_time = fast_dds::Duration(0, kBlockingMax_ns);
  qos.durability().kind = endpoint.qos.is_transient_local ? fdds::TRANSIENT_LOCAL_DURABILITY_QOS
                                                          : fdds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = fdds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = static_cast<std::int32_t>(endpoint.qos.depth);
  // The depth alone is the limit.
  qos.resource_limits().max_samples = 0;
  qos.resource_limits().max_instances = 0;
  qos.resource_limits().max_samples_per_instance = 0;
  qos.resource_limits().allocated_samples = 0;
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
  qos.user_data().data_vec({endpoint.user_data.begin(), endpoint.user_data.end()});
}

/// Topics, shared by a reader and a writer.
class Topics {
 public:
  Topics(fdds::DomainParticipant& participant, bool is_secured)
      : participant_(participant), is_secured_(is_secured) {}

  fdds::Topic* open(const Endpoint& endpoint) {
    Known& known = known_[endpoint.topic];
    if (known.topic == nullptr) {
      fdds::TypeSupport type(new RawType(endpoint.type));
      (void)type.register_type(&participant_);
      known.topic =
          check(participant_.create_topic(endpoint.topic, endpoint.type, fdds::TOPIC_QOS_DEFAULT),
                endpoint.topic);
    }
    ++known.users;
    return known.topic;
  }
  /// Returns what was `made` for `endpoint` on an open topic; on failure closes the topic.
  template <typename T>
  T* checked(T* made, const Endpoint& endpoint) {
    if (made != nullptr) {
      return made;
    }
    close(endpoint.topic);
    if (is_secured_) {  // Fast DDS does not report the reason; this is the only one left.
      throw EngineError(refusal_of_security(endpoint));
    }
    return check(made, endpoint.topic);
  }
  void close(const std::string& name) {
    Known& known = known_[name];
    if (--known.users == 0) {
      (void)participant_.delete_topic(std::exchange(known.topic, nullptr));
    }
  }

 private:
  struct Known {
    fdds::Topic* topic = nullptr;
    int users = 0;
  };
  fdds::DomainParticipant& participant_;
  const bool is_secured_;
  std::map<std::string, Known> known_;
};

class FastWriter final : public Writer {
 public:
  FastWriter(Topics& topics, fdds::Publisher& publisher, const Endpoint& endpoint)
      : topics_(topics), publisher_(publisher), name_(endpoint.topic) {
    fdds::Topic* const topic = topics.open(endpoint);
    fdds::DataWriterQos qos;
    put_qos(endpoint, qos);
    writer_ = topics.checked(publisher.create_datawriter(topic, qos), endpoint);
  }
  ~FastWriter() override {
    (void)publisher_.delete_datawriter(writer_);
    topics_.close(name_);
  }

  void write(ros2::Buffer& message) override {
    RawSample sample{.sent = message.bytes()};
    if (!is_ok(writer_->write(&sample))) {
      throw EngineError(fmt::format("Fast DDS: {}: the message was not taken", name_));
    }
  }
  Identity write_request(ros2::Buffer& message, const Guid& replies) override {
    rtps::WriteParams params;
    params.related_sample_identity().writer_guid(to_guid(replies));
    RawSample sample{.sent = message.bytes()};
    if (!is_ok(writer_->write(&sample, params))) {
      throw EngineError(fmt::format("Fast DDS: {}: the request was not taken", name_));
    }
    return {
        .asker = replies,
        .number = static_cast<std::int64_t>(params.sample_identity().sequence_number().to64long())};
  }
  void write_reply(ros2::Buffer& message, const Identity& request) override {
    rtps::WriteParams params;
    params.related_sample_identity().writer_guid(to_guid(request.asker));
    const auto number = static_cast<std::uint64_t>(request.number);
    params.related_sample_identity().sequence_number(rtps::SequenceNumber_t(
        static_cast<std::int32_t>(number >> 32U), static_cast<std::uint32_t>(number)));
    RawSample sample{.sent = message.bytes()};
    if (!is_ok(writer_->write(&sample, params))) {
      throw EngineError(fmt::format("Fast DDS: {}: the reply was not taken", name_));
    }
  }
  [[nodiscard]] Guid guid() const override { return guid_of(writer_->guid()); }
  [[nodiscard]] std::size_t matched() const override {
    fdds::PublicationMatchedStatus status;
    (void)writer_->get_publication_matched_status(status);
    return static_cast<std::size_t>(std::max(0, status.current_count));
  }

 private:
  Topics& topics_;
  fdds::Publisher& publisher_;
  std::string name_;
  fdds::DataWriter* writer_ = nullptr;
};

/// Takes messages on the thread that received them, as for Cyclone DDS.
class FastReader final : public Reader, private fdds::DataReaderListener {
 public:
  FastReader(Topics& topics, fdds::Subscriber& subscriber, const Endpoint& endpoint,
             OnMessage on_message, std::shared_ptr<Bell> bell)
      : topics_(topics),
        subscriber_(subscriber),
        name_(endpoint.topic),
        on_message_(std::move(on_message)),
        waiting_(endpoint.qos.depth, std::move(bell)),
        role_(endpoint.role),
        is_given_at_once_(endpoint.is_given_at_once) {
    fdds::Topic* const topic = topics.open(endpoint);
    fdds::DataReaderQos qos;
    put_qos(endpoint, qos);
    reader_ = topics.checked(subscriber.create_datareader(topic, qos, this), endpoint);
  }
  ~FastReader() override {
    (void)reader_->set_listener(nullptr);
    (void)subscriber_.delete_datareader(reader_);
    topics_.close(name_);
  }

  void serve() {
    std::unique_lock order(at_once_, std::defer_lock);
    if (is_given_at_once_) {
      order.lock();
      is_served_ = true;
    }
    for (const Waiting& waiting : waiting_.take()) {
      on_message_(waiting.message.bytes(), waiting.info);
    }
  }

  [[nodiscard]] Guid guid() const override { return guid_of(reader_->guid()); }
  [[nodiscard]] std::size_t matched() const override {
    fdds::SubscriptionMatchedStatus status;
    (void)reader_->get_subscription_matched_status(status);
    return static_cast<std::size_t>(std::max(0, status.current_count));
  }
  [[nodiscard]] std::uint64_t lost() const override { return waiting_.overflowed() + lost_.load(); }

 private:
  struct Waiting {
    ros2::Buffer message;
    SampleInfo info;
  };

  void on_data_available(fdds::DataReader* reader) override {
    std::unique_lock order(at_once_, std::defer_lock);
    if (is_given_at_once_) {
      order.lock();
      if (is_served_) {
        give_all(*reader);
        return;
      }
    }
    fdds::SampleInfo info;
    RawSample sample;
    while (is_ok(reader->take_next_sample(&sample, &info))) {
      if (is_for_us(*reader, info)) {
        waiting_.add(
            {.message = std::exchange(sample.received, ros2::Buffer()), .info = info_of(info)});
      }
    }
    waiting_.ring();
  }

  /// Each message is read in the memory of Fast DDS, without a copy. Its info is only available
  /// before or after it is taken.
  void give_all(fdds::DataReader& reader) {
    fdds::SampleInfo info;
    while (is_ok(reader.get_first_untaken_info(&info))) {
      const bool is_wanted = is_for_us(reader, info);
      const std::function<void(std::span<const std::byte>)> give =
          [&](std::span<const std::byte> bytes) {
            if (is_wanted) {
              on_message_(bytes, info_of(info));
            }
          };
      RawSample sample;
      sample.at_once = &give;
      fdds::SampleInfo taken;
      if (!is_ok(reader.take_next_sample(&sample, &taken))) {
        return;
      }
    }
  }

  static bool is_for_us(const fdds::DataReader& reader, const fdds::SampleInfo& info) {
    return info.valid_data &&
           info.sample_identity.writer_guid().guidPrefix != reader.guid().guidPrefix;
  }
  [[nodiscard]] SampleInfo info_of(const fdds::SampleInfo& info) const {
    return {.sent = std::chrono::nanoseconds(info.source_timestamp.to_ns()),
            .came = std::chrono::nanoseconds(base::monotonic_ns()),
            .writer = guid_of(info.sample_identity.writer_guid()),
            .request = role_ == Role::kTopic ? Identity() : identity_of(info, role_)};
  }
  void on_sample_lost(fdds::DataReader* /*reader*/, const fdds::SampleLostStatus& status) override {
    lost_.store(static_cast<std::uint64_t>(std::max(0, status.total_count)));
  }

  Topics& topics_;
  fdds::Subscriber& subscriber_;
  std::string name_;
  OnMessage on_message_;
  WaitingMessages<Waiting> waiting_;
  const Role role_;
  const bool is_given_at_once_;
  std::mutex at_once_;      // One message after the other.
  bool is_served_ = false;  // Guarded by it.
  fdds::DataReader* reader_ = nullptr;
  std::atomic<std::uint64_t> lost_{0};
};

/// Keeps discovery events until they are polled.
class Discoveries final : public fast_dds::DiscoveryListener {
 public:
  explicit Discoveries(std::shared_ptr<Bell> bell) : bell_(std::move(bell)) {}

  std::vector<Discovery> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(all_, {});
  }

 private:
  static constexpr std::size_t kMax = 100'000;  // Of unpolled events.

  void on_participant(const rtps::GUID_t& guid, const fdds::UserDataQosPolicy& user_data,
                      bool is_gone) override {
    Discovery discovery;
    discovery.is_gone = is_gone;
    discovery.guid = guid_of(guid);
    discovery.endpoint.user_data = text_of(user_data);
    add(std::move(discovery));
  }
  void on_endpoint(const fdds::DomainParticipant& participant, fast_dds::SeenEndpoint seen,
                   bool is_gone) override {
    if (seen.guid.guidPrefix == participant.guid().guidPrefix) {
      return;
    }
    Discovery discovery;
    discovery.kind = Discovery::Kind::kEndpoint;
    discovery.is_gone = is_gone;
    discovery.guid = guid_of(seen.guid);
    rtps::GUID_t owner = seen.guid;
    owner.entityId = rtps::c_EntityId_RTPSParticipant;
    discovery.participant = guid_of(owner);
    discovery.endpoint = {.topic = std::move(seen.topic),
                          .type = std::move(seen.type),
                          .user_data = text_of(seen.user_data),
                          .qos = {.is_reliable = seen.is_reliable,
                                  .is_transient_local = seen.is_transient_local,
                                  .depth = 0},
                          .is_reader = seen.is_reader};
    add(std::move(discovery));
  }
  void add(Discovery discovery) {
    {
      const std::lock_guard lock(mutex_);
      if (all_.size() < kMax) {
        all_.push_back(std::move(discovery));
      }
    }
    bell_->ring();
  }

  std::shared_ptr<Bell> bell_;
  std::mutex mutex_;
  std::vector<Discovery> all_;  // Guarded by it.
};

void put_interface(const std::string& name, fdds::DomainParticipantQos& qos) {
  const Interface interface = find_interface(name);
  if (interface.address.empty()) {
    throw EngineError(fmt::format("the network interface \"{}\" has no IPv4 address", name));
  }
  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back(interface.address);
  udp->receiveBufferSize = kReceiveBytes;
  udp->sendBufferSize = kReceiveBytes;
  // Number of participants of a machine that are contacted; each one of a process has the next
  // number.
  udp->maxInitialPeersRange = kPeersMax;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  if (!interface.is_multicast) {
    // Others on this machine are contacted by unicast.
    rtps::Locator_t peer;
    rtps::IPLocator::setIPv4(peer, interface.address);
    qos.wire_protocol().builtin.initialPeersList.push_back(peer);
    qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(peer);
    qos.wire_protocol().default_unicast_locator_list.push_back(peer);
  }
}

void put_security(const std::string& folder, fdds::DomainParticipantQos& qos) {
  const dds_security::Enclave enclave = dds_security::enclave_in(folder);
  const auto put = [&](const std::string& name, const std::string& value) {
    qos.properties().properties().emplace_back("dds.sec." + name, value);
  };
  const auto put_file = [&](const std::string& name, const std::filesystem::path& file) {
    put(name, "file://" + file.string());
  };
  put("auth.plugin", "builtin.PKI-DH");
  put("access.plugin", "builtin.Access-Permissions");
  put("crypto.plugin", "builtin.AES-GCM-GMAC");
  put_file("auth.builtin.PKI-DH.identity_ca", enclave.identity_ca);
  put_file("auth.builtin.PKI-DH.identity_certificate", enclave.certificate);
  put_file("auth.builtin.PKI-DH.private_key", enclave.key);
  put_file("access.builtin.Access-Permissions.permissions_ca", enclave.permissions_ca);
  put_file("access.builtin.Access-Permissions.governance", enclave.governance);
  put_file("access.builtin.Access-Permissions.permissions", enclave.permissions);
}

class FastParticipant final : public Participant {
 public:
  explicit FastParticipant(const ParticipantOptions& options)
      : bell_(std::make_shared<Bell>()), discoveries_(bell_) {
    fdds::DomainParticipantQos qos;
    if (!options.security.empty()) {
      put_security(options.security, qos);
    }
    qos.name("fastcycle");
    qos.user_data().data_vec({options.user_data.begin(), options.user_data.end()});
    if (!options.interface.empty()) {
      put_interface(options.interface, qos);
    }
    participant_ = check(fdds::DomainParticipantFactory::get_instance()->create_participant(
                             options.domain, qos, &discoveries_, fdds::StatusMask::none()),
                         fmt::format("participant of domain {}", options.domain));
    topics_.emplace(*participant_, !options.security.empty());
    publisher_ = check(participant_->create_publisher(fdds::PUBLISHER_QOS_DEFAULT), "publisher");
    subscriber_ =
        check(participant_->create_subscriber(fdds::SUBSCRIBER_QOS_DEFAULT), "subscriber");
  }
  ~FastParticipant() override {
    (void)participant_->set_listener(nullptr);
    (void)participant_->delete_contained_entities();
    (void)fdds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }

  [[nodiscard]] std::unique_ptr<Writer> create_writer(const Endpoint& endpoint) override {
    return std::make_unique<FastWriter>(*topics_, *publisher_, endpoint);
  }
  [[nodiscard]] std::unique_ptr<Reader> create_reader(const Endpoint& endpoint,
                                                      OnMessage on_message) override {
    auto reader = std::make_unique<FastReader>(*topics_, *subscriber_, endpoint,
                                               std::move(on_message), bell_);
    served_.push_back(reader.get());
    return reader;
  }
  [[nodiscard]] Guid guid() const override { return guid_of(participant_->guid()); }
  [[nodiscard]] std::string service_user_data(bool /*is_client*/) override { return {}; }

  void serve(std::chrono::milliseconds timeout) override {
    bell_->wait(timeout);
    for (FastReader* const reader : served_) {
      reader->serve();
    }
  }
  void wake() override { bell_->ring(); }
  [[nodiscard]] std::vector<Discovery> discoveries() override { return discoveries_.take(); }

 private:
  std::shared_ptr<Bell> bell_;
  Discoveries discoveries_;
  fdds::DomainParticipant* participant_ = nullptr;
  std::optional<Topics> topics_;
  fdds::Publisher* publisher_ = nullptr;
  fdds::Subscriber* subscriber_ = nullptr;
  std::vector<FastReader*> served_;
};

}  // namespace

std::unique_ptr<Participant> create_fast(const ParticipantOptions& options) {
  return std::make_unique<FastParticipant>(options);
}

}  // namespace fastcycle::dds_gateway
