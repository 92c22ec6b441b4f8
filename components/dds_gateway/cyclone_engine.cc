// DDS by Eclipse Cyclone DDS.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <dds/ddsrt/log.h>
#include <fmt/format.h>

#include "base/clock.h"
#include "base/printable.h"
#include "dds_gateway/bell.h"
#include "dds_gateway/cyclone_types.h"
#include "dds_gateway/engine.h"
#include "dds_gateway/interface.h"
#include "dds_gateway/request_header.h"
#include "dds_gateway/waiting_messages.h"
#include "dds_security/enclave.h"
#include "ros2/error.h"

namespace fastcycle::dds_gateway {
namespace {

constexpr dds_duration_t kBlockingMax = DDS_MSECS(100);
constexpr std::size_t kTakenAtOnce = 16;

/// A negative code is an error.
dds_return_t check(dds_return_t code, std::string_view what) {
  if (code < 0) {
    throw EngineError(fmt::format("Cyclone DDS: {}: {}", what, dds_strretcode(-code)));
  }
  return code;
}

/// The same for one end of a topic.
void check(dds_return_t code, const Endpoint& endpoint) {
  if (code == DDS_RETCODE_NOT_ALLOWED_BY_SECURITY) {
    throw EngineError(refusal_of_security(endpoint));
  }
  check(code, endpoint.topic);
}

struct QosDeleter {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using QosPointer = std::unique_ptr<dds_qos_t, QosDeleter>;

Guid guid_of(dds_entity_t entity) {
  dds_guid_t guid{};
  (void)dds_get_guid(entity, &guid);
  Guid result;
  std::copy_n(guid.v, result.size(), result.begin());
  return result;
}

/// Whether the user's own configuration selects network interfaces; Cyclone DDS would add ours to
/// them. Throws if it does not select `interface`.
bool selects_interfaces(std::string_view configuration, const std::string& interface) {
  if (configuration.find("<NetworkInterface") == std::string_view::npos) {
    return false;
  }
  for (const char quote : {'"', '\''}) {
    const std::string quoted = fmt::format("{}{}{}", quote, interface, quote);
    if (configuration.find(quoted) != std::string_view::npos) {
      return true;
    }
  }
  throw EngineError(fmt::format(
      "CYCLONEDDS_URI selects network interfaces, and \"{}\", the param \"interface\", is none of "
      "them: leave out one of the two",
      interface));
}

std::string configuration(const ParticipantOptions& options) {
  std::string text;
  if (const char* const users = std::getenv("CYCLONEDDS_URI")) {
    text = users;
  }
  if (options.interface.empty() || selects_interfaces(text, options.interface)) {
    return text;
  }
  const bool can_reach_many = find_interface(options.interface).is_multicast;
  if (!text.empty()) {
    text += ',';
  }
  text += fmt::format(
      "<Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"{}\"/></Interfaces>"
      "<AllowMulticast>{}</AllowMulticast></General>",
      options.interface, can_reach_many ? "true" : "false");
  if (!can_reach_many) {
    // Others on this machine are contacted by unicast.
    text +=
        "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
        "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        "<Peers><Peer address=\"localhost\"/></Peers></Discovery>";
  }
  return text + "</Domain>";
}

/// Writes the log of Cyclone DDS to standard error, as it does itself, but with a rate limit: each
/// invalid packet produces a line, and anyone can send them.
class LogLimit {
 public:
  void write(std::string_view line) {
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (now - begin_ >= kWhile) {
      if (left_out_ > 0) {
        (void)fmt::print(stderr, "Cyclone DDS: {} more lines like these\n", left_out_);
      }
      begin_ = now;
      lines_ = 0;
      left_out_ = 0;
    }
    if (lines_ < kLinesMax) {
      ++lines_;
      (void)fmt::print(stderr, "{}\n", base::printable(line));
    } else {
      ++left_out_;
    }
  }

 private:
  static constexpr std::chrono::seconds kWhile{10};
  static constexpr int kLinesMax = 20;
  std::mutex mutex_;
  std::chrono::steady_clock::time_point begin_{};
  int lines_ = 0;
  std::uint64_t left_out_ = 0;
};

void write_log(void* limit, const dds_log_data_t* said) {
  std::string_view line(said->message - said->hdrsize, said->size + said->hdrsize);
  line.remove_suffix(line.ends_with('\n') ? 1 : 0);
  static_cast<LogLimit*>(limit)->write(line);
}

/// The domains of this process: Cyclone DDS has one per number, with one configuration, which is
/// deleted with our last participant. That ends its threads, which must not outlive this library.
class Domains {
 public:
  void open(const ParticipantOptions& options) {
    const std::lock_guard lock(mutex_);
    Domain& domain = domains_[options.domain];
    if (domain.participants == 0) {
      const std::string text = configuration(options);
      dds_set_log_sink(write_log, &log_);
      domain.entity = dds_create_domain(options.domain, text.c_str());
      if (domain.entity == DDS_RETCODE_PRECONDITION_NOT_MET) {
        domain.entity = 0;  // Created by someone else.
      } else if (domain.entity < 0) {
        const dds_return_t code = std::exchange(domain.entity, 0);
        check(code, fmt::format("domain {}", options.domain));
      }
      domain.security = options.security;
    } else if (domain.security != options.security) {
      // Cyclone DDS would give the second participant the permissions of the first.
      const auto name = [](const std::string& security) {
        return security.empty() ? std::string("none") : fmt::format("\"{}\"", security);
      };
      throw EngineError(
          fmt::format("domain {}: expected the security that this process has there already, {}, "
                      "found {}; Cyclone DDS has one for each domain",
                      options.domain, name(domain.security), name(options.security)));
    }
    ++domain.participants;
  }
  void close(std::uint32_t number) {
    const std::lock_guard lock(mutex_);
    Domain& domain = domains_[number];
    if (--domain.participants == 0 && domain.entity > 0) {
      dds_delete(std::exchange(domain.entity, 0));
    }
    if (std::ranges::all_of(domains_,
                            [](const auto& one) { return one.second.participants == 0; })) {
      dds_set_log_sink(nullptr, nullptr);  // This library may be unloaded before the next line.
    }
  }

 private:
  struct Domain {
    dds_entity_t entity = 0;
    int participants = 0;
    std::string security = {};  // Of all of them.
  };
  LogLimit log_;
  std::mutex mutex_;
  std::map<std::uint32_t, Domain> domains_;
};

Domains& domains() {
  static Domains all;
  return all;
}

QosPointer qos_of(const Endpoint& endpoint) {
  QosPointer qos(dds_create_qos());
  dds_qset_reliability(
      qos.get(), endpoint.qos.is_reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
      kBlockingMax);
  dds_qset_durability(qos.get(), endpoint.qos.is_transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL
                                                                 : DDS_DURABILITY_VOLATILE);
  const auto depth = static_cast<std::int32_t>(endpoint.qos.depth);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  if (endpoint.qos.is_transient_local && !endpoint.is_reader) {
    dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, depth, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  }
  dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  if (!endpoint.user_data.empty()) {
    dds_qset_userdata(qos.get(), endpoint.user_data.data(), endpoint.user_data.size());
  }
  return qos;
}

void put_security(const std::string& folder, dds_qos_t& qos) {
  const dds_security::Enclave enclave = dds_security::enclave_in(folder);
  const auto put = [&](const char* name, const std::string& value) {
    dds_qset_prop(&qos, name, value.c_str());
  };
  const auto put_file = [&](const char* name, const std::filesystem::path& file) {
    put(name, "file:" + file.string());
  };
  put("dds.sec.auth.library.path", "dds_security_auth");
  put("dds.sec.auth.library.init", "init_authentication");
  put("dds.sec.auth.library.finalize", "finalize_authentication");
  put("dds.sec.access.library.path", "dds_security_ac");
  put("dds.sec.access.library.init", "init_access_control");
  put("dds.sec.access.library.finalize", "finalize_access_control");
  put("dds.sec.crypto.library.path", "dds_security_crypto");
  put("dds.sec.crypto.library.init", "init_crypto");
  put("dds.sec.crypto.library.finalize", "finalize_crypto");
  put_file("dds.sec.auth.identity_ca", enclave.identity_ca);
  put_file("dds.sec.auth.identity_certificate", enclave.certificate);
  put_file("dds.sec.auth.private_key", enclave.key);
  put_file("dds.sec.access.permissions_ca", enclave.permissions_ca);
  put_file("dds.sec.access.governance", enclave.governance);
  put_file("dds.sec.access.permissions", enclave.permissions);
}

class CycloneWriter final : public Writer {
 public:
  CycloneWriter(dds_entity_t participant, const Endpoint& endpoint) {
    ddsi_sertype* type = make_raw_type(endpoint.type.c_str());
    topic_ = dds_create_topic_sertype(participant, endpoint.topic.c_str(), &type, nullptr, nullptr,
                                      nullptr);
    if (topic_ < 0) {
      ddsi_sertype_unref(type);
      check(topic_, endpoint);
    }
    type_ = type;
    const QosPointer qos = qos_of(endpoint);
    writer_ = dds_create_writer(participant, topic_, qos.get(), nullptr);
    if (writer_ < 0) {
      dds_delete(topic_);
      check(writer_, endpoint);
    }
    name_ = endpoint.topic;
  }
  ~CycloneWriter() override {
    dds_delete(writer_);
    dds_delete(topic_);
  }

  void write(ros2::Buffer& message) override {
    ddsi_serdata* const raw = make_raw_message(type_, std::move(message));
    check(dds_writecdr(writer_, raw), name_);
  }
  Identity write_request(ros2::Buffer& message, const Guid& /*replies*/) override {
    const Identity request{.asker = asker_of(client_), .number = ++requests_};
    ros2::Buffer whole = with_request_header(message.bytes(), request);
    write(whole);
    return request;
  }
  void write_reply(ros2::Buffer& message, const Identity& request) override {
    ros2::Buffer whole = with_request_header(message.bytes(), request);
    write(whole);
  }
  [[nodiscard]] Guid guid() const override { return guid_of(writer_); }
  [[nodiscard]] std::size_t matched() const override {
    dds_publication_matched_status_t status{};
    (void)dds_get_publication_matched_status(writer_, &status);
    return status.current_count;
  }

 private:
  dds_entity_t topic_ = 0;
  dds_entity_t writer_ = 0;
  const ddsi_sertype* type_ = nullptr;
  std::string name_;
  const std::uint64_t client_ = std::random_device()() * 0x1'0000'0001ULL ^ std::random_device()();
  std::int64_t requests_ = 0;
};

/// Takes messages on the thread that received them, so that each one is either delivered or
/// counted, and keeps at most the newest `depth`.
class CycloneReader final : public Reader {
 public:
  CycloneReader(dds_entity_t participant, const Endpoint& endpoint, OnMessage on_message,
                std::shared_ptr<Bell> bell)
      : on_message_(std::move(on_message)),
        waiting_(endpoint.qos.depth, std::move(bell)),
        is_of_service_(endpoint.role != Role::kTopic),
        is_given_at_once_(endpoint.is_given_at_once) {
    ddsi_sertype* type = make_raw_type(endpoint.type.c_str());
    topic_ = dds_create_topic_sertype(participant, endpoint.topic.c_str(), &type, nullptr, nullptr,
                                      nullptr);
    if (topic_ < 0) {
      ddsi_sertype_unref(type);
      check(topic_, endpoint);
    }
    const QosPointer qos = qos_of(endpoint);
    dds_listener_t* const listener = dds_create_listener(this);
    dds_lset_data_available(listener, [](dds_entity_t /*entity*/, void* self) {
      static_cast<CycloneReader*>(self)->take();
    });
    reader_ = dds_create_reader(participant, topic_, qos.get(), listener);
    dds_delete_listener(listener);
    if (reader_ < 0) {
      dds_delete(topic_);
      check(reader_, endpoint);
    }
    entity_.store(reader_);
    take();  // Messages that arrived before the number was known.
  }
  ~CycloneReader() override {
    (void)dds_set_listener(reader_, nullptr);
    dds_delete(reader_);
    dds_delete(topic_);
  }

  void serve() {
    std::unique_lock order(at_once_, std::defer_lock);
    if (is_given_at_once_) {
      order.lock();
      is_served_ = true;
    }
    for (const Waiting& waiting : waiting_.take()) {
      give(waiting);
    }
  }

  [[nodiscard]] Guid guid() const override { return guid_of(reader_); }
  [[nodiscard]] std::size_t matched() const override {
    dds_subscription_matched_status_t status{};
    (void)dds_get_subscription_matched_status(reader_, &status);
    return status.current_count;
  }
  [[nodiscard]] std::uint64_t lost() const override {
    dds_sample_lost_status_t status{};
    (void)dds_get_sample_lost_status(reader_, &status);
    return waiting_.overflowed() + status.total_count;
  }

 private:
  struct Unref {
    void operator()(ddsi_serdata* message) const { ddsi_serdata_unref(message); }
  };
  struct Waiting {
    std::unique_ptr<ddsi_serdata, Unref> message;
    SampleInfo info;
  };

  void give(const Waiting& waiting) {
    const auto bytes = bytes_of(waiting.message.get());
    if (!is_of_service_) {
      on_message_(bytes, waiting.info);
      return;
    }
    SampleInfo info = waiting.info;
    try {
      const ros2::Buffer message = without_request_header(bytes, info.request);
      on_message_(message.bytes(), info);
    } catch (const ros2::CdrError&) {
      on_message_({}, info);  // Empty: an invalid message of any type.
    }
  }

  void take() {
    const dds_entity_t reader = entity_.load();
    if (reader <= 0) {
      return;
    }
    ddsi_serdata* messages[kTakenAtOnce];
    dds_sample_info_t infos[kTakenAtOnce];
    dds_return_t count = 0;
    std::unique_lock order(at_once_, std::defer_lock);
    bool is_at_once = false;
    if (is_given_at_once_) {
      order.lock();
      is_at_once = is_served_;
    }
    while ((count = dds_takecdr(reader, messages, kTakenAtOnce, infos, DDS_ANY_STATE)) > 0) {
      const std::chrono::nanoseconds came(base::monotonic_ns());
      for (dds_return_t i = 0; i < count; ++i) {
        if (!infos[i].valid_data) {
          ddsi_serdata_unref(messages[i]);
          continue;
        }
        Waiting message{.message = std::unique_ptr<ddsi_serdata, Unref>(messages[i]),
                        .info = {.sent = std::chrono::nanoseconds(infos[i].source_timestamp),
                                 .came = came,
                                 .writer = asker_of(infos[i].publication_handle),
                                 .request = {}}};
        if (is_at_once) {
          give(message);
        } else {
          waiting_.add(std::move(message));
        }
      }
    }
    if (!is_at_once) {
      waiting_.ring();
    }
  }

  OnMessage on_message_;
  WaitingMessages<Waiting> waiting_;
  const bool is_of_service_;
  const bool is_given_at_once_;
  std::mutex at_once_;      // One message after the other.
  bool is_served_ = false;  // Guarded by it.
  dds_entity_t topic_ = 0;
  dds_entity_t reader_ = 0;
  std::atomic<dds_entity_t> entity_{0};
};

Qos qos_from(const dds_qos_t* from) {
  Qos qos{.is_reliable = false, .is_transient_local = false, .depth = 1};
  dds_reliability_kind_t reliability = DDS_RELIABILITY_BEST_EFFORT;
  dds_duration_t blocking = 0;
  if (dds_qget_reliability(from, &reliability, &blocking)) {
    qos.is_reliable = reliability == DDS_RELIABILITY_RELIABLE;
  }
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
  if (dds_qget_durability(from, &durability)) {
    qos.is_transient_local = durability != DDS_DURABILITY_VOLATILE;
  }
  dds_history_kind_t history = DDS_HISTORY_KEEP_LAST;
  std::int32_t depth = 1;
  if (dds_qget_history(from, &history, &depth)) {
    qos.depth = static_cast<std::size_t>(std::max(0, depth));
  }
  return qos;
}

std::string user_data_of(const dds_qos_t* qos) {
  void* data = nullptr;
  std::size_t size = 0;
  if (qos == nullptr || !dds_qget_userdata(qos, &data, &size) || data == nullptr) {
    return {};
  }
  std::string text(static_cast<const char*>(data), size);
  dds_free(data);
  while (!text.empty() && text.back() == '\0') {
    text.pop_back();
  }
  return text;
}

class CycloneParticipant final : public Participant {
 public:
  explicit CycloneParticipant(const ParticipantOptions& options)
      : domain_(options.domain), bell_(std::make_shared<Bell>()) {
    domains().open(options);
    try {
      const QosPointer qos(dds_create_qos());
      if (!options.security.empty()) {
        put_security(options.security, *qos);
      }
      if (!options.user_data.empty()) {
        dds_qset_userdata(qos.get(), options.user_data.data(), options.user_data.size());
      }
      participant_ = check(dds_create_participant(options.domain, qos.get(), nullptr),
                           fmt::format("participant of domain {}", options.domain));
      guid_ = guid_of(participant_);
      participants_ = watch(DDS_BUILTIN_TOPIC_DCPSPARTICIPANT);
      writers_ = watch(DDS_BUILTIN_TOPIC_DCPSPUBLICATION);
      readers_ = watch(DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION);
    } catch (...) {
      close();
      throw;
    }
  }
  ~CycloneParticipant() override { close(); }

  [[nodiscard]] std::unique_ptr<Writer> create_writer(const Endpoint& endpoint) override {
    return std::make_unique<CycloneWriter>(participant_, endpoint);
  }
  [[nodiscard]] std::unique_ptr<Reader> create_reader(const Endpoint& endpoint,
                                                      OnMessage on_message) override {
    auto reader =
        std::make_unique<CycloneReader>(participant_, endpoint, std::move(on_message), bell_);
    served_.push_back(reader.get());
    return reader;
  }
  [[nodiscard]] Guid guid() const override { return guid_; }
  // A server sends a reply only after it has found a reader with the same id as the writer of the
  // request.
  [[nodiscard]] std::string service_user_data(bool is_client) override {
    std::string text = is_client ? "clientid= " : "serviceid= ";
    Guid id = guid_;
    id[12] = static_cast<std::uint8_t>(++services_ >> 8U);
    id[13] = static_cast<std::uint8_t>(services_);
    for (std::size_t i = 0; i < id.size(); ++i) {
      text += fmt::format("{}{:x}", i == 0 ? "" : ".", id[i]);
    }
    return text + ";";
  }

  void serve(std::chrono::milliseconds timeout) override {
    bell_->wait(timeout);
    for (CycloneReader* const reader : served_) {
      reader->serve();
    }
  }
  void wake() override { bell_->ring(); }

  [[nodiscard]] std::vector<Discovery> discoveries() override {
    std::vector<Discovery> all;
    take<dds_builtintopic_participant_t>(
        participants_, [&](const dds_builtintopic_participant_t& seen, bool is_gone) {
          Discovery discovery;
          discovery.is_gone = is_gone;
          std::copy_n(seen.key.v, discovery.guid.size(), discovery.guid.begin());
          if (discovery.guid != guid_) {
            discovery.endpoint.user_data = is_gone ? "" : user_data_of(seen.qos);
            all.push_back(std::move(discovery));
          }
        });
    for (const bool is_reader : {false, true}) {
      take<dds_builtintopic_endpoint_t>(
          is_reader ? readers_ : writers_,
          [&](const dds_builtintopic_endpoint_t& seen, bool is_gone) {
            Discovery discovery;
            discovery.kind = Discovery::Kind::kEndpoint;
            discovery.is_gone = is_gone;
            discovery.endpoint.is_reader = is_reader;
            std::copy_n(seen.key.v, discovery.guid.size(), discovery.guid.begin());
            if (!is_gone) {
              std::copy_n(seen.participant_key.v, discovery.participant.size(),
                          discovery.participant.begin());
              discovery.endpoint.topic = seen.topic_name == nullptr ? "" : seen.topic_name;
              discovery.endpoint.type = seen.type_name == nullptr ? "" : seen.type_name;
              discovery.endpoint.user_data = user_data_of(seen.qos);
              if (seen.qos != nullptr) {
                discovery.endpoint.qos = qos_from(seen.qos);
              }
            }
            // Endpoints of its own participant begin with the same twelve bytes.
            if (!std::equal(guid_.begin(), guid_.begin() + 12, discovery.guid.begin())) {
              all.push_back(std::move(discovery));
            }
          });
    }
    return all;
  }

 private:
  dds_entity_t watch(dds_entity_t topic) {
    dds_listener_t* const listener = dds_create_listener(bell_.get());
    dds_lset_data_available(
        listener, [](dds_entity_t /*entity*/, void* bell) { static_cast<Bell*>(bell)->ring(); });
    const dds_entity_t reader = dds_create_reader(participant_, topic, nullptr, listener);
    dds_delete_listener(listener);
    return check(reader, "discovery");
  }

  template <typename T, typename F>
  static void take(dds_entity_t reader, F f) {
    void* samples[kTakenAtOnce] = {};
    dds_sample_info_t infos[kTakenAtOnce];
    dds_return_t count = 0;
    while ((count = dds_take(reader, samples, infos, kTakenAtOnce, kTakenAtOnce)) > 0) {
      for (dds_return_t i = 0; i < count; ++i) {
        f(*static_cast<const T*>(samples[i]),
          infos[i].instance_state != DDS_IST_ALIVE || !infos[i].valid_data);
      }
      (void)dds_return_loan(reader, samples, count);
    }
  }

  void close() {
    if (participant_ > 0) {
      dds_delete(participant_);
    }
    domains().close(domain_);
  }

  const std::uint32_t domain_;
  std::shared_ptr<Bell> bell_;
  dds_entity_t participant_ = 0;
  unsigned services_ = 0;
  Guid guid_{};
  dds_entity_t participants_ = 0;
  dds_entity_t writers_ = 0;
  dds_entity_t readers_ = 0;
  std::vector<CycloneReader*> served_;
};

}  // namespace

std::unique_ptr<Participant> create_cyclone(const ParticipantOptions& options) {
  return std::make_unique<CycloneParticipant>(options);
}

}  // namespace fastcycle::dds_gateway
