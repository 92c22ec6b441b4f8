#include "dds_gateway/gateway.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <exception>
#include <iterator>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "base/printable.h"
#include "basic/basic.pb.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "dds_gateway/envelope.h"
#include "dds_security/documents.h"
#include "dds_security/enclave.h"
#include "ros2/names.h"
#include "ros2/type_hash.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;

constexpr std::chrono::milliseconds kServe = 1s;  // Maximum time between two polls of discovery.
constexpr std::size_t kSeenMax = 65'536;          // Endpoints of others that are known.
constexpr std::size_t kTroublesMax = 1024;
constexpr double kDomainMax = 232;  // More have no ports.

constexpr std::size_t kReportedClocksMax = 1024;

constexpr std::size_t kArrivalsMax = 1024;  // Maximum of waiting requests and replies.

/// Header before the bytes of a request or a reply within the gateway.
struct ArrivalHead {
  std::uint64_t service = 0;  ///< Those of parameters follow the others.
  Identity request;
};

const Engine& find_engine(std::string_view name) {
  const auto all = engines();
  const auto found = std::ranges::find_if(
      all, [&](const Engine& engine) { return name.empty() || engine.name == name; });
  if (found == all.end()) {
    std::string known;
    for (const Engine& engine : all) {
      known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ", engine.name);
    }
    throw std::invalid_argument(fmt::format("/params/engine: expected one of {}, found \"{}\"",
                                            known.empty() ? "none" : known, name));
  }
  return *found;
}

void refuse_wrong_enclave(const ParticipantOptions& options) {
  const std::string& folder = options.security;
  std::string text;
  if (options.domain > dds_security::kDomainMax) {
    text = fmt::format("/params/domain: expected a number from 0 to {} with security, found {}",
                       dds_security::kDomainMax, options.domain);
  }
  for (const std::string& error : dds_security::enclave_errors(folder)) {
    text += fmt::format("{}/params/security: {}", text.empty() ? "" : "\n", error);
  }
  if (!text.empty()) {
    throw std::invalid_argument(text);
  }
}

/// The measured time of a ROS message, if it begins with a header with a stamp.
std::optional<std::chrono::nanoseconds> stamp_of(const ros2::Definition& type,
                                                 std::span<const std::byte> message) {
  if (type.fields.empty() || type.fields.front().shape != ros2::Shape::kOne ||
      type.fields.front().message == nullptr ||
      type.fields.front().message->name != "std_msgs/msg/Header") {
    return {};
  }
  ros2::CdrReader in(message, type.name);
  const std::chrono::seconds seconds(in.number<std::int32_t>("header.stamp.sec"));
  const std::chrono::nanoseconds rest(in.number<std::uint32_t>("header.stamp.nanosec"));
  if (seconds <= 0s) {
    return {};
  }
  return seconds + rest;
}

std::string text_of(const Guid& guid) {
  std::string text;
  for (const std::uint8_t byte : guid) {
    text += fmt::format("{:02x}", byte);
  }
  return text;
}

/// `/car/gateway`
std::string full_name_of(const std::string& node) {
  return node.starts_with('/') ? node : "/" + node;
}

}  // namespace

/// One bridged topic, with both of its ends.
struct Gateway::Crossing {
  TopicSettings settings;
  const ros2::Converter* converter = nullptr;  // Null for messages as they are.
  const google::protobuf::Message* prototype = nullptr;
  // Between two applications: the number of the last message sent, of the newest message of each
  // writer, and the number of lost ones since the last publish.
  std::uint64_t sent = 0;
  std::map<Guid, std::uint64_t> numbers;
  std::uint64_t lost = 0;
  std::optional<TrailExchange> trails;
  Endpoint endpoint;
  Counters counters;
  Time last_passed{};  // Confined to the passing side: the thread, or the activations.

  // From DDS.
  detail::PublisherCore* publisher = nullptr;
  std::unique_ptr<Reader> reader;

  // To DDS.
  std::unique_ptr<Writer> writer;
};

Gateway::Settings Gateway::settings_of(Context& context) {
  Settings settings;
  settings.participant.domain = static_cast<std::uint32_t>(
      context
          .param<std::int64_t>(
              "domain", {.fallback = 0, .min = 0, .max = static_cast<std::int64_t>(kDomainMax)})
          .get());
  settings.participant.interface =
      context.param<std::string>("interface", {.fallback = std::string()}).get();
  settings.participant.security = context.param<Path>("security", {.fallback = Path()}).get();
  const std::string enclave = settings.participant.security.empty()
                                  ? "/"
                                  : dds_security::name_of_enclave(settings.participant.security);
  settings.participant.user_data = fmt::format("enclave={};", enclave);
  settings.engine = context.param<std::string>("engine", {.fallback = std::string()}).get();
  settings.node =
      context.param<std::string>("node", {.fallback = std::string("fastcycle_gateway")}).get();
  settings.clock_period = std::chrono::milliseconds(
      context
          .param<std::int64_t>("clock_period_ms",
                               {.fallback = 0, .min = 0, .max = 10'000, .unit = "ms"})
          .get());
  const std::string clocks =
      context.param<std::string>("clocks", {.fallback = std::string("round_trips")}).get();
  if (clocks != "round_trips" && clocks != "system") {
    throw std::invalid_argument(fmt::format(
        "/params/clocks: expected \"round_trips\" or \"system\", found \"{}\"", clocks));
  }
  settings.clocks = clocks == "system" ? ClockSource::kSystem : ClockSource::kRoundTrips;
  settings.clock_difference_max = std::chrono::nanoseconds(std::llround(
      1e6 * context
                .param<double>("clock_difference_max_ms",
                               {.fallback = 10.0, .min = 0.0, .max = 1e9, .unit = "ms"})
                .get()));
  return settings;
}

Gateway::Gateway(Context& context)
    : Component(context), settings_(settings_of(context)), clock_(context.core().clock) {
  using Paths = std::vector<Path>;
  const Paths folders = context.param<Paths>("definitions", {.fallback = Paths{}}).get();
  const Paths mappings = context.param<Paths>("mappings", {.fallback = Paths{}}).get();
  const auto topics =
      context
          .param<google::protobuf::ListValue>("topics", {.fallback = google::protobuf::ListValue()})
          .get();

  const auto services = context
                            .param<google::protobuf::ListValue>(
                                "services", {.fallback = google::protobuf::ListValue()})
                            .get();

  const auto params = context
                          .param<google::protobuf::ListValue>(
                              "parameters", {.fallback = google::protobuf::ListValue()})
                          .get();

  (void)find_engine(settings_.engine);
  if (!settings_.participant.security.empty()) {
    refuse_wrong_enclave(settings_.participant);
  }
  if (const auto error = ros2::ros_name_error(settings_.node)) {
    throw std::invalid_argument(fmt::format("/params/node: {}", *error));
  }
  for (const Path& folder : folders) {
    types_.definitions().add_folder(folder);
  }
  types_.definitions().add_installed();
  for (const Path& file : mappings) {
    types_.add_mappings(file);
  }
  std::string errors;
  int index = 0;
  for (TopicSettings& topic : topics_of(topics)) {
    try {
      add(std::move(topic));
    } catch (const std::runtime_error& error) {
      errors +=
          fmt::format("{}/params/topics/{}: {}", errors.empty() ? "" : "\n", index, error.what());
    }
    ++index;
  }
  if (!errors.empty()) {
    throw std::invalid_argument(errors);
  }
  add_services(services_of(services));
  add_params(parameters_of(params));
  if (!services_.empty() || params_ != nullptr) {
    add_arrivals();
  }
  if (settings_.clock_period > 0ns) {
    add_clock(settings_.clock_period);
  }
  context.create_thread("dds_gateway", [this](const std::stop_token& stop) { run(stop); });
  context.create_timer({.period = 1s, .phase = {}}, [this] {
    report_clocks();
    report_health();
  });
}

Gateway::~Gateway() noexcept(false) {
  close();
}

void Gateway::add(TopicSettings settings) {
  auto crossing = std::make_unique<Crossing>();
  if (settings.is_as_it_is) {
    settings.type = kEnvelopeType;
    const google::protobuf::Descriptor* const descriptor = ros2::find_message(settings.message);
    if (descriptor == nullptr) {
      throw ros2::MappingError(
          fmt::format("there is no message {} in this process; a component that uses it brings it "
                      "along",
                      settings.message));
    }
    crossing->prototype =
        google::protobuf::MessageFactory::generated_factory()->GetPrototype(descriptor);
  } else {
    crossing->converter = &types_.find(settings.type, settings.message);
    crossing->prototype = &crossing->converter->prototype();
  }
  const google::protobuf::Message& message = *crossing->prototype;
  crossing->endpoint = {
      .topic = settings.is_as_it_is ? settings.ros : ros2::dds_topic(settings.ros),
      .type = ros2::dds_type(settings.type),
      .user_data = ros2::type_user_data(ros2::type_hash(types_.definitions().find(settings.type))),
      .qos = settings.qos,
      .is_reader = settings.is_in};
  if (settings.is_as_it_is) {
    crossing->endpoint.user_data += envelope_user_data(*message.GetDescriptor());
    crossing->endpoint.is_given_at_once = settings.is_in;
    crossing->trails.emplace(context().core().application.wiring().topics());
  }
  if (settings.is_in) {
    crossing->publisher =
        &detail::create_publisher(context().core(), settings.topic, message, nullptr, true);
    if (settings.is_as_it_is) {
      crossing->publisher->bring_trails();
    }
  } else {
    SubscriberOptions options;
    options.depth = settings.qos.depth;
    Crossing& its = *crossing;
    detail::create_subscription(
        context().core(), settings.topic, message, options,
        [this, &its](detail::Envelope& envelope, const google::protobuf::Message& payload) {
          send(its, envelope.info, payload, envelope.trails);
        });
  }
  crossing->settings = std::move(settings);
  crossings_.push_back(std::move(crossing));
}

/// Publishes the application's time on /clock, for nodes with `use_sim_time`.
void Gateway::add_clock(Duration period) {
  auto crossing = std::make_unique<Crossing>();
  crossing->settings.ros = "/clock";
  crossing->settings.is_in = false;
  crossing->settings.qos = {.is_reliable = true, .is_transient_local = false, .depth = 1};
  crossing->converter = &types_.find("rosgraph_msgs/msg/Clock");
  crossing->endpoint = {
      .topic = "rt/clock",
      .type = ros2::dds_type("rosgraph_msgs/msg/Clock"),
      .user_data = ros2::type_user_data(ros2::type_hash(crossing->converter->definition())),
      .qos = crossing->settings.qos,
      .is_reader = false};
  Crossing& clock = *crossing;
  crossings_.push_back(std::move(crossing));
  context().create_timer({.period = period, .phase = {}}, [this, &clock] {
    basic::Clock time;
    time.set_time_ns(now().time_since_epoch().count());
    send(clock, {.sequence = 0, .publish_time = now(), .publisher = 0, .origin = {}}, time);
  });
}

void Gateway::add_services(const std::vector<ServiceSettings>& services) {
  for (const ServiceSettings& service : services) {
    services_.push_back(std::make_unique<ServiceCrossing>(
        context(), service, types_,
        [this](const std::string& what) { log().throttle(10s).warning("{}", what); }));
  }
}

void Gateway::add_params(const std::vector<ParamSettings>& params) {
  if (!params.empty()) {
    params_ = std::make_unique<ParamServices>(
        context(), full_node_name(), params, types_.definitions(),
        [this](const std::string& what) { log().throttle(10s).warning("{}", what); });
  }
}

/// Declares the topic of requests and replies from the participant's thread to the activations.
void Gateway::add_arrivals() {
  const std::string topic = context().component_name() + "/service_arrivals";
  arrivals_ = context().create_external_publisher<google::protobuf::BytesValue>(topic);
  SubscriberOptions options;
  options.depth = kArrivalsMax;
  context().create_subscriber<google::protobuf::BytesValue>(
      topic, options, [this](const google::protobuf::BytesValue& arrival) {
        const auto bytes = std::as_bytes(std::span(arrival.value()));
        ArrivalHead head;
        std::memcpy(&head, bytes.data(), sizeof head);
        const auto message = bytes.subspan(sizeof head);
        if (head.service < services_.size()) {
          services_[head.service]->take(head.request, message);
        } else {
          params_->take(head.service - services_.size(), head.request, message);
        }
      });
}

void Gateway::start() {
  report("trouble", std::string());
  if (params_ != nullptr) {
    for (const std::string& param : params_->unknown()) {
      log().warning("parameters: there is no param \"{}\" in this application", param);
    }
  }
  if (const std::string& folder = settings_.participant.security;
      !folder.empty() && dds_security::has_open_key(folder)) {
    log().warning("{}: others than its owner can read this private key; expected mode 0600",
                  dds_security::enclave_in(folder).key.string());
  }
  // A recorded run that is executed again has no network: nothing is sent again.
  (void)observe("network", [this] {
    open_network();
    return true;
  });
}

void Gateway::open_network() {
  participant_ = find_engine(settings_.engine).create(settings_.participant);
  wall_to_ours_ = now().time_since_epoch() - std::chrono::system_clock::now().time_since_epoch();
  const bool is_joined = std::ranges::any_of(
      crossings_, [](const auto& crossing) { return crossing->settings.is_as_it_is; });
  if (is_joined && !clock_.is_simulated()) {
    clocks_ = std::make_unique<ClockExchange>(
        *participant_, clock_, full_name_of(settings_.node),
        ros2::type_user_data(ros2::type_hash(types_.definitions().find(kRoundTripType))),
        settings_.clocks);
  }
  for (const auto& crossing : crossings_) {
    open(*crossing);
  }
  const auto arrive = [this](std::size_t service, const Identity& request,
                             std::span<const std::byte> message) {
    const ArrivalHead head{.service = service, .request = request};
    auto arrival = arrivals_->loan();
    std::string& bytes = *arrival->mutable_value();
    bytes.assign(reinterpret_cast<const char*>(&head), sizeof head);
    bytes.append(reinterpret_cast<const char*>(message.data()), message.size());
    arrivals_->publish(std::move(arrival));
  };
  for (std::size_t i = 0; i < services_.size(); ++i) {
    services_[i]->open(*participant_,
                       [arrive, i](const Identity& request, std::span<const std::byte> message) {
                         arrive(i, request, message);
                       });
  }
  if (params_ != nullptr) {
    params_->open(*participant_,
                  [arrive, behind = services_.size()](std::size_t service, const Identity& request,
                                                      std::span<const std::byte> message) {
                    arrive(behind + service, request, message);
                  });
  }
  graph_reader_ = participant_->create_reader(
      graph_endpoint(true), [this](std::span<const std::byte> message, const SampleInfo&) {
        try {
          graph_.take(message);
        } catch (const ros2::CdrError& error) {
          log().throttle(10s).warning("ros_discovery_info: {}", error.what());
        }
      });
  announce();
}

void Gateway::open(Crossing& crossing) {
  if (crossing.endpoint.is_reader) {
    crossing.reader = participant_->create_reader(
        crossing.endpoint,
        [this, &crossing](std::span<const std::byte> message, const SampleInfo& info) {
          if (crossing.endpoint.is_given_at_once) {
            receive_at_once(crossing, message, info);
          } else {
            receive(crossing, message, info);
          }
        });
  } else {
    crossing.writer = participant_->create_writer(crossing.endpoint);
  }
}

/// `/car/gateway`
std::string Gateway::full_node_name() const {
  return full_name_of(settings_.node);
}

void Gateway::announce() {
  NodeEntities node;
  const std::string full_name = full_name_of(settings_.node);
  const std::size_t slash = full_name.rfind('/');
  node.name = full_name.substr(slash + 1);
  if (slash > 0) {
    node.name_space = full_name.substr(0, slash);
  }
  for (const auto& crossing : crossings_) {
    if (crossing->reader != nullptr) {
      node.readers.push_back(crossing->reader->guid());
    } else {
      node.writers.push_back(crossing->writer->guid());
    }
  }
  if (clocks_ != nullptr) {
    node.readers.push_back(clocks_->reader().guid());
    node.writers.push_back(clocks_->writer().guid());
  }
  for (const auto& service : services_) {
    node.readers.push_back(service->reader());
    node.writers.push_back(service->writer());
  }
  if (params_ != nullptr) {
    std::ranges::copy(params_->readers(), std::back_inserter(node.readers));
    std::ranges::copy(params_->writers(), std::back_inserter(node.writers));
  }
  graph_writer_ = participant_->create_writer(graph_endpoint(false));
  ros2::Buffer message;
  write_graph(participant_->guid(), {node}, message);
  graph_writer_->write(message);
}

void Gateway::stop() {
  for (const auto& crossing : crossings_) {
    const Counters& counters = crossing->counters;
    const std::string& name = crossing->settings.ros;
    const auto report_count = [&](const char* what, std::uint64_t count, bool is_always) {
      if (is_always || count > 0) {
        report(fmt::format("{} {}", name, what), static_cast<std::int64_t>(count));
      }
    };
    report_count(crossing->settings.is_in ? "received" : "taken", counters.came, true);
    report_count(crossing->settings.is_in ? "published" : "sent", counters.went, true);
    report_count("limited", counters.limited, false);
    report_count("expired", counters.expired, false);
    report_count("own", counters.own, false);
    report_count("refused", counters.refused, false);
    report_count("unsent", counters.unsent, false);
    report_count("missing", counters.missing,
                 crossing->settings.is_as_it_is && crossing->settings.is_in);
    report_count("undated", counters.undated, false);
    if (crossing->reader != nullptr) {
      report_count("lost", crossing->reader->lost(), true);
    }
  }
  for (const auto& service : services_) {
    const std::string& name = service->settings().ros;
    report(name + " asked", static_cast<std::int64_t>(service->asked));
    report(name + " answered", static_cast<std::int64_t>(service->answered));
    report(name + " failed", static_cast<std::int64_t>(service->failed));
    report(name + " lost", static_cast<std::int64_t>(service->lost()));
  }
  report_clocks();
  if (params_ != nullptr) {
    report("parameters asked", static_cast<std::int64_t>(params_->asked));
    report("parameters answered", static_cast<std::int64_t>(params_->answered));
    report("parameters failed", static_cast<std::int64_t>(params_->failed));
    report("parameters lost", static_cast<std::int64_t>(params_->lost()));
  }
  close();
  report_health();
}

/// Destroys readers and writers before their participant; also after a fault, when `stop` is not
/// called.
void Gateway::close() {
  for (const auto& crossing : crossings_) {
    crossing->reader.reset();
    crossing->writer.reset();
  }
  for (const auto& service : services_) {
    service->close();
  }
  clocks_.reset();
  if (params_ != nullptr) {
    params_->close();
  }
  graph_writer_.reset();
  graph_reader_.reset();
  participant_.reset();
}

void Gateway::run(const std::stop_token& stop) {
  const std::stop_callback wake(stop, [this] { participant_->wake(); });
  while (!stop.stop_requested()) {
    participant_->serve(clocks_ == nullptr ? kServe : clocks_->ask());
    take_discoveries();
    rethrow_fault();
  }
}

void Gateway::rethrow_fault() {
  std::exception_ptr fault;
  {
    const std::lock_guard lock(mutex_);
    fault = std::exchange(fault_, nullptr);
  }
  if (fault != nullptr) {
    std::rethrow_exception(fault);
  }
}

void Gateway::take_discoveries() {
  for (const Discovery& discovery : participant_->discoveries()) {
    look_at(discovery);
  }
}

void Gateway::look_at(const Discovery& discovery) {
  if (discovery.kind == Discovery::Kind::kParticipant) {
    if (discovery.is_gone) {
      graph_.forget(discovery.guid);
    }
    peers_.fetch_add(discovery.is_gone ? std::uint64_t(-1) : 1);
    return;
  }
  if (discovery.is_gone) {
    seen_.erase(discovery.guid);
    set_trouble(text_of(discovery.guid), "");
    return;
  }
  const Endpoint& other = discovery.endpoint;
  const bool is_new = !seen_.contains(discovery.guid) && seen_.size() < kSeenMax;
  if (!is_new) {
    return;
  }
  for (const auto& crossing : crossings_) {
    const Endpoint& ours = crossing->endpoint;
    if (ours.topic != other.topic || ours.is_reader == other.is_reader) {
      continue;
    }
    seen_[discovery.guid] = {.endpoint = other, .participant = discovery.participant};
    std::string who = graph_.node_of(discovery.guid);
    if (who.empty()) {
      who = fmt::format("a participant {}", text_of(discovery.participant).substr(0, 24));
    }
    std::string trouble;
    const std::string_view hash = ros2::value_of(other.user_data, "typehash");
    if (other.type != ours.type) {
      trouble =
          fmt::format("{}: {} has it with type {}, here it is {}", crossing->settings.ros, who,
                      ros2::ros_type(other.type).value_or(other.type), crossing->settings.type);
    } else if (const auto why =
                   ours.is_reader ? mismatch(ours.qos, other.qos) : mismatch(other.qos, ours.qos)) {
      trouble =
          fmt::format("{}: no message passes between the gateway and {}: {} (here {}, there {})",
                      crossing->settings.ros, who, *why, to_text(ours.qos), to_text(other.qos));
    } else if (!hash.empty() && hash != ros2::value_of(ours.user_data, "typehash")) {
      trouble = fmt::format(
          "{}: {} has another version of {}: there {}, here {}; messages may be misread",
          crossing->settings.ros, who, crossing->settings.type, hash,
          ros2::value_of(ours.user_data, "typehash"));
    }
    const std::string_view theirs = ros2::value_of(other.user_data, "schema");
    const std::string_view here = ros2::value_of(ours.user_data, "schema");
    if (trouble.empty() && !theirs.empty() && theirs != here) {
      trouble = fmt::format("{}: {} has another version of {} ({}): schema {} there, {} here",
                            crossing->settings.ros, who, crossing->settings.message,
                            ros2::value_of(other.user_data, "message"), theirs.substr(0, 16),
                            here.substr(0, 16));
    }
    // Others choose their names, which may be invalid text.
    who = base::printable(who);
    trouble = base::printable(trouble);
    if (trouble.empty()) {
      log().info("{}: found {} of {}", crossing->settings.ros,
                 other.is_reader ? "a reader" : "a writer", who);
      continue;
    }
    log().warning("{}", trouble);
    set_trouble(text_of(discovery.guid), std::move(trouble));
  }
}

bool Gateway::may_pass(Crossing& crossing, Time now) {
  if (crossing.settings.rate_limit_hz > 0.0) {
    const auto period =
        std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / crossing.settings.rate_limit_hz));
    if (crossing.last_passed != Time{} && now - crossing.last_passed < period) {
      crossing.counters.limited.fetch_add(1);
      return false;
    }
    crossing.last_passed = now;
  }
  return true;
}

/// Messages older than the topic allows are dropped, and counted.
bool Gateway::is_expired(const Crossing& crossing, Time taken, Time now) const {
  return crossing.settings.age_max && now - taken > *crossing.settings.age_max;
}

void Gateway::receive(Crossing& crossing, std::span<const std::byte> message,
                      const SampleInfo& info) {
  Counters& counters = crossing.counters;
  counters.came.fetch_add(1);
  detail::PublisherCore& publisher = *crossing.publisher;
  const Time now = detail::now_of(publisher);
  detail::Envelope* loan = nullptr;
  try {
    const auto stamp = stamp_of(crossing.converter->definition(), message);
    // Stamps of other clocks must not be later than now.
    const Time taken = std::min(
        now,
        Time(std::chrono::duration_cast<Duration>(stamp ? *stamp : info.sent + wall_to_ours_)));
    if (is_expired(crossing, taken, now)) {
      counters.expired.fetch_add(1);
      return;
    }
    if (!may_pass(crossing, now)) {
      return;
    }
    loan = detail::take_external_loan(publisher, false);
    crossing.converter->to_message(message, *loan->own);
    detail::publish_external(publisher, std::exchange(loan, nullptr), taken);
    counters.went.fetch_add(1);
  } catch (const ros2::CdrError& error) {
    if (loan != nullptr) {
      detail::return_external_loan(publisher, loan);
    }
    refuse(crossing, counters.refused, error.what());
  }
}

/// On an engine's thread, which no exception may leave: it is passed to our thread.
void Gateway::receive_at_once(Crossing& crossing, std::span<const std::byte> message,
                              const SampleInfo& info) noexcept {
  try {
    receive_as_it_is(crossing, message, info);
  } catch (...) {
    {
      const std::lock_guard lock(mutex_);
      fault_ = std::current_exception();
    }
    participant_->wake();
  }
}

void Gateway::receive_as_it_is(Crossing& crossing, std::span<const std::byte> message,
                               const SampleInfo& info) {
  Counters& counters = crossing.counters;
  counters.came.fetch_add(1);
  detail::PublisherCore& publisher = *crossing.publisher;
  detail::Envelope* loan = detail::take_external_loan(publisher, false);
  try {
    const EnvelopeHead head = read_envelope(message, *loan->own);
    const Time now = detail::now_of(publisher);
    crossing.lost += count_missing(crossing, info.writer, head.number);
    detail::Arrival arrival = arrival_of(crossing, head, info);
    const bool is_old = is_expired(crossing, arrival.origin.taken, now);
    if (is_old || !may_pass(crossing, now)) {
      counters.expired.fetch_add(is_old ? 1 : 0);
      detail::return_external_loan(publisher, loan);
      return;
    }
    arrival.lost = std::exchange(crossing.lost, 0);
    publisher.publish_arrived(std::exchange(loan, nullptr), arrival);
    counters.went.fetch_add(1);
  } catch (const ros2::CdrError& error) {
    if (loan != nullptr) {
      detail::return_external_loan(publisher, loan);
    }
    refuse(crossing, counters.refused, error.what());
  }
}

/// The times of `head`, by our clock. Until the offset of the sender's clock is known, the transfer
/// is assumed to take no time; in simulated time both clocks are assumed to be equal.
detail::Arrival Gateway::arrival_of(Crossing& crossing, const EnvelopeHead& head,
                                    const SampleInfo& info) {
  const Time came = clock_.at_monotonic(info.came.count());
  Duration later{0};
  if (clocks_ != nullptr) {
    const auto ahead = clocks_->ahead(head.clock);
    crossing.counters.undated.fetch_add(ahead ? 0 : 1);
    later = ahead ? -*ahead : came - head.published;
  }
  later = std::min(later, came - head.published);  // It cannot arrive before it was published.
  return {.published = head.published + later,
          .origin = {.taken = std::min(came, head.taken + later), .root = head.root},
          .came = came,
          .trails = crossing.trails->from_envelope(head.trails, later)};
}

/// Number of messages sent before this one that did not arrive.
std::uint64_t Gateway::count_missing(Crossing& crossing, const Guid& writer, std::uint64_t number) {
  constexpr std::size_t kWritersMax = 1024;
  const auto known = crossing.numbers.find(writer);
  if (known == crossing.numbers.end()) {
    if (crossing.numbers.size() < kWritersMax) {
      crossing.numbers[writer] = number;
    }
    return 0;
  }
  const std::uint64_t missing = number > known->second ? number - known->second - 1 : 0;
  crossing.counters.missing.fetch_add(missing);
  known->second = number;
  return missing;
}

void Gateway::send(Crossing& crossing, const MessageInfo& info,
                   const google::protobuf::Message& message, const detail::Trail* trails) {
  Counters& counters = crossing.counters;
  counters.came.fetch_add(1);
  const bool is_own = std::ranges::any_of(crossings_, [&](const auto& other) {
    return other->publisher != nullptr && info.publisher != 0 &&
           other->publisher->id == info.publisher;
  });
  if (is_own) {
    counters.own.fetch_add(1);
    return;
  }
  const Time taken = info.origin.root != 0 ? info.origin.taken : info.publish_time;
  if (is_expired(crossing, taken, now())) {
    counters.expired.fetch_add(1);
    return;
  }
  if (!may_pass(crossing, now())) {
    return;
  }
  try {
    ros2::Buffer serialized;
    if (crossing.settings.is_as_it_is) {
      write_envelope(message,
                     {.clock = clocks_ == nullptr ? 0 : clocks_->id(),
                      .number = ++crossing.sent,
                      .sequence = info.sequence,
                      .published = info.publish_time,
                      .root = info.origin.root,
                      .taken = taken,
                      .trails = crossing.trails->to_envelope(trails)},
                     serialized);
    } else {
      crossing.converter->to_ros(message, serialized);
    }
    if (crossing.writer != nullptr) {
      crossing.writer->write(serialized);
    }
    counters.went.fetch_add(1);
  } catch (const ros2::CdrError& error) {
    refuse(crossing, counters.refused, error.what());
  } catch (const EngineError& error) {
    refuse(crossing, counters.unsent, error.what());
  }
}

void Gateway::refuse(Crossing& crossing, std::atomic<std::uint64_t>& counter,
                     const std::string& why) {
  counter.fetch_add(1);
  const std::string what = fmt::format("{}: {}", crossing.settings.ros, why);
  log().throttle(10s).warning("{}", what);
  if (crossing.settings.on_error == OnError::kStop) {
    throw std::runtime_error(what);
  }
  if (crossing.settings.on_error == OnError::kDegrade) {
    set_trouble(crossing.settings.ros, what);
  }
}

/// An empty `what` ends the trouble.
void Gateway::set_trouble(const std::string& whose, std::string what) {
  const std::lock_guard lock(mutex_);
  if (what.empty()) {
    troubles_.erase(whose);
  } else if (troubles_.size() < kTroublesMax || troubles_.contains(whose)) {
    troubles_[whose] = std::move(what);
  }
}

/// Reports the offsets of other clocks in the results and, if they are too large, in the health.
void Gateway::report_clocks() {
  if (clocks_ == nullptr) {
    return;
  }
  const auto ms = [](Duration span) {
    return std::chrono::duration<double, std::milli>(span).count();
  };
  for (const ClockPeer& peer : clocks_->peers()) {
    const std::string node = base::printable(peer.node);
    const auto known = reported_clocks_.find(node);
    if (known == reported_clocks_.end() && reported_clocks_.size() == kReportedClocksMax) {
      continue;
    }
    const std::string whose = fmt::format("the clock of {}", node);
    const ClockDifference::Estimate& found = peer.estimate;
    report(whose + " ahead_ms", ms(found.ahead));
    report(whose + " bound_ms", ms(found.bound));
    report(whose + " round_trip_ms", ms(found.round_trip));
    std::string trouble;
    if (settings_.clock_difference_max > 0ns &&
        std::chrono::abs(found.ahead) - found.bound > settings_.clock_difference_max) {
      trouble = fmt::format(
          "{} is {:.3f} ms ahead of this one, ± {:.3f} ms: times that stand in messages are off "
          "by that; PTP or NTP on both machines brings them together",
          whose, ms(found.ahead), ms(found.bound));
    } else if (settings_.clocks == ClockSource::kSystem &&
               peer.system_apart > std::max<Duration>(settings_.clock_difference_max, 1ms)) {
      trouble = fmt::format(
          "the system clocks of {} and of this machine differ by at least {:.3f} ms: expected PTP "
          "to hold them together, as \"clocks\": \"system\" says",
          node, ms(peer.system_apart));
    }
    if (known == reported_clocks_.end() || known->second != trouble.empty()) {
      if (trouble.empty()) {
        log().info("{} is {:.3f} ms ahead of this one, ± {:.3f} ms", whose, ms(found.ahead),
                   ms(found.bound));
      } else {
        log().warning("{}", trouble);
      }
      reported_clocks_[node] = trouble.empty();
    }
    set_trouble(whose, std::move(trouble));
  }
}

void Gateway::report_health() {
  std::string trouble;
  {
    const std::lock_guard lock(mutex_);
    if (!troubles_.empty()) {
      trouble = troubles_.begin()->second;
    }
    if (troubles_.size() > 1) {
      trouble += fmt::format(" (and {} more)", troubles_.size() - 1);
    }
  }
  if (trouble != reported_) {
    health(trouble.empty() ? Health::kOk : Health::kDegraded, trouble);
    report("trouble", trouble);
    reported_ = std::move(trouble);
  }
}

}  // namespace fastcycle::dds_gateway
