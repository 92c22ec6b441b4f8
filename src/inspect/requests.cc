// The server's answer to each request.
#include <algorithm>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "base/clock.h"
#include "base/log_level.h"
#include "component/component_core.h"
#include "component/own_names.h"
#include "component/words.h"
#include "config/nearest.h"
#include "fastcycle/version.h"
#include "inspect/frame.h"
#include "inspect/refusal.h"
#include "inspect/server.h"
#include "mcap/topic_filter.h"
#include "record/descriptor_set.h"
#include "report/param_list.h"

namespace fastcycle::inspect {
namespace {

Refusal not_found(const std::string& kind, const std::string& name,
                  const std::vector<std::string>& known) {
  return {protocol::Error::KIND_NOT_FOUND, fmt::format("there is no {} \"{}\"", kind, name),
          config::did_you_mean(config::nearest(name, known))};
}

const google::protobuf::Message* instance_of(const SeenTopic& seen) {
  if (!seen.publishers.empty()) {
    return &seen.publishers.front()->default_instance;
  }
  const auto* type =
      google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(seen.type);
  return type == nullptr
             ? nullptr
             : google::protobuf::MessageFactory::generated_factory()->GetPrototype(type);
}

protocol::Param to_message(const host::ListedParam& param) {
  const auto text = [](const nlohmann::ordered_json& json) {
    return json.is_null() ? std::string()
                          : json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  };
  protocol::Param said;
  said.set_component(param.component);
  said.set_name(param.name);
  said.set_type(param.type);
  said.set_unit(to_utf8(param.unit));
  said.set_value_json(param.value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  said.set_min_json(text(param.min));
  said.set_max_json(text(param.max));
  if (param.has_fallback) {
    said.set_default_json(
        param.fallback.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }
  for (const std::string& name : param.names) {
    said.add_names(to_utf8(name));
  }
  said.set_origin(param.origin);
  if (!param.place.file.empty()) {
    said.set_place(to_utf8(config::to_string(param.place)));
  }
  said.set_is_tunable(param.is_tunable);
  said.set_description(to_utf8(param.description));
  return said;
}

}  // namespace

void Server::answer(Client& client, const protocol::Request& request) {
  Connection& connection = *client.connection;
  if (!connection.is_greeted) {
    greet(client, request);
    return;
  }
  protocol::Answer answer;
  answer.set_id(request.id());
  using What = protocol::Request::WhatCase;
  switch (request.what_case()) {
    case What::kOverview:
      give_overview(request.overview(), answer);
      break;
    case What::kTopic:
      give_topic(request.topic(), answer);
      break;
    case What::kParams:
      give_params(request.params(), answer);
      break;
    case What::kChangeParams:
      change_params(client, request);
      return;
    case What::kSwitchMode:
      switch_mode(client, request.switch_mode(), answer);
      break;
    case What::kLifecycle:
      change_lifecycle(client, request);
      return;
    case What::kPublish:
      publish(client, request.publish(), answer);
      break;
    case What::kCallService:
      call_service(client, request);
      return;
    case What::kPlayback:
      if (playback_ == nullptr) {
        throw Refusal(protocol::Error::KIND_REFUSED, "no recording is played into this run",
                      "use fastcycle view LOG to show a recording and seek in it");
      }
      playback_->obey(request.playback());
      *answer.mutable_playback() = playback_->state();
      break;
    case What::kGraph:
      answer.mutable_graph()->set_dot(graph_);
      break;
    case What::kDocument:
      give_document(request.document(), answer);
      break;
    case What::kStream:
      begin_stream(client, request);
      return;
    case What::kRecord:
      begin_record(client, request);
      return;
    case What::kStreamLog:
      begin_log(client, request);
      return;
    case What::kEndStream:
      end_stream(client, request.end_stream().id());
      return;
    case What::kHello:
      throw Refusal(protocol::Error::KIND_MALFORMED, "a connection has one hello");
    default:
      throw Refusal(protocol::Error::KIND_REFUSED,
                    "this version of FastCycle cannot do what was asked for");
  }
  connection.put(answer);
}

void Server::greet(Client& client, const protocol::Request& request) {
  if (!request.has_hello()) {
    throw Refusal(protocol::Error::KIND_MALFORMED, "the first request has to be a hello");
  }
  if (request.hello().version() != kProtocolVersion) {
    throw Refusal(protocol::Error::KIND_VERSION,
                  fmt::format("the application speaks version {} of this protocol, the tool {}",
                              kProtocolVersion, request.hello().version()),
                  "use the tools that came with the application's FastCycle");
  }
  constexpr std::size_t kMaxName = 64;
  client.connection->is_greeted = true;
  client.connection->client = request.hello().client().substr(0, kMaxName);
  protocol::Answer answer;
  answer.set_id(request.id());
  protocol::Welcome& welcome = *answer.mutable_welcome();
  welcome.set_version(kProtocolVersion);
  welcome.set_application(name());
  welcome.set_pid(::getpid());
  welcome.set_file(application_.description().file.string());
  welcome.set_framework(FASTCYCLE_VERSION);
  for (const std::string& word : allowed_words(description_)) {
    welcome.add_allow(word);
  }
  for (const std::string& name : documents()) {
    welcome.add_documents(name);
  }
  client.connection->put(answer);
}

std::vector<host::ComponentNews> Server::present_news() const {
  const std::lock_guard lock(mutex_);
  return news_;
}

void Server::give_overview(const protocol::GetOverview& request, protocol::Answer& answer) {
  protocol::Overview& overview = *answer.mutable_overview();
  overview.set_application(name());
  overview.set_pid(::getpid());
  fill_application(application_, overview);
  fill_executors(application_, overview);
  const std::vector<host::ComponentNews> news = present_news();
  if (!request.without_components()) {
    fill_components(application_, news, request.with_buckets(), overview);
  }
  if (!request.without_topics()) {
    for (const SeenTopic& seen : see_topics(application_)) {
      protocol::Topic& topic = *overview.add_topics();
      fill_topic(application_, seen, news, request.with_buckets(), topic);
      topic.set_message_bytes(taps_.message_bytes(*seen.topic));
    }
    for (const KnownService& service : services_) {
      fill_service(service, false, *overview.add_services());
    }
  }
  if (playback_ != nullptr) {
    *overview.mutable_playback() = playback_->state();
  }
  overview.set_clients(clients_.size());
  overview.set_clients_dropped(dropped_clients_);
  for (const std::string& name : documents()) {
    overview.add_documents(name);
  }
  for (const std::string& word : allowed_words(description_)) {
    overview.add_allow(word);
  }
}

void Server::give_topic(const protocol::GetTopic& request, protocol::Answer& answer) {
  std::vector<std::string> known;
  for (const SeenTopic& seen : see_topics(application_)) {
    known.push_back(seen.topic->name);
    if (seen.topic->name != request.topic()) {
      continue;
    }
    protocol::Topic& topic = *answer.mutable_topic();
    fill_topic(application_, seen, present_news(), false, topic);
    topic.set_message_bytes(taps_.message_bytes(*seen.topic));
    if (const auto* instance = instance_of(seen)) {
      topic.set_schema(record::descriptor_set_of(*instance->GetDescriptor()));
    }
    return;
  }
  for (const KnownService& service : services_) {
    known.push_back(service.name);
    if (service.name == request.topic()) {
      answer.mutable_topic()->set_name(service.name);
      answer.mutable_topic()->set_is_service(true);
      fill_service(service, true, *answer.mutable_topic()->mutable_service());
      return;
    }
  }
  throw not_found("topic", request.topic(), known);
}

void Server::give_params(const protocol::GetParams& request, protocol::Answer& answer) {
  answer.mutable_params();
  std::vector<std::string> known;
  for (const auto& component : application_.components()) {
    known.push_back(component->name);
  }
  if (!request.component().empty() &&
      std::ranges::find(known, request.component()) == known.end()) {
    throw not_found("component", request.component(), known);
  }
  for (const host::ListedParam& param : host::list_params(application_)) {
    if (request.component().empty() || param.component == request.component()) {
      *answer.mutable_params()->add_params() = to_message(param);
    }
  }
}

void Server::need(bool is_allowed, const char* word, const char* what) const {
  if (!is_allowed) {
    throw Refusal(protocol::Error::KIND_NOT_ALLOWED,
                  fmt::format("this application does not let tools {}", what),
                  fmt::format("run it with --inspect-allow {0}, or with \"inspect\": {{\"allow\": "
                              "[\"{0}\"]}}",
                              word),
                  word);
  }
}

std::string Server::name_of(const Client& client) {
  return fmt::format("process {} of user {} ({})", client.connection->pid, client.connection->uid,
                     client.connection->client);
}

void Server::note(const std::string& who, std::string_view what) {
  application_.log(LogLevel::kInfo, "inspect", to_utf8(fmt::format("{} {}", who, what)));
}

void Server::change_params(Client& client, const protocol::Request& request) {
  need(description_.allows_params, "params", "change parameters");
  std::vector<ParamChange> changes;
  std::string what;
  for (const protocol::ChangeParams::Change& change : request.change_params().changes()) {
    changes.push_back({change.param(), change.value_json()});
    what += (what.empty() ? "" : ", ") + change.param() + " to " + change.value_json();
  }
  const auto change = [this, changes = std::move(changes), what = std::move(what),
                       who = name_of(client), id = request.id()] {
    try {
      const ParamsResult result = application_.change_params(changes);
      protocol::Answer answer;
      answer.set_id(id);
      protocol::ParamsChanged& said = *answer.mutable_params_changed();
      for (const std::string& error : result.errors) {
        said.add_errors(to_utf8(error));
      }
      note(who, result.has_changed() ? "set " + what : "could not set " + what);
      return answer;
    } catch (const std::exception& error) {
      return error_answer(id, {protocol::Error::KIND_REFUSED, error.what()});
    }
  };
  if (application_.peers() == nullptr) {
    client.connection->put(change());
  } else if (!waiting_.post([this, change, connection = client.connection->number] {
               give_later(connection, change());
             })) {
    throw Refusal(protocol::Error::KIND_TOO_MANY,
                  "too many changes of parameters wait for the answers of processes");
  }
}

void Server::switch_mode(Client& client, const protocol::SwitchMode& request,
                         protocol::Answer& answer) {
  need(description_.allows_lifecycle, "lifecycle", "switch modes");
  std::vector<std::string> known;
  for (const config::ModeDescription& mode : application_.description().modes) {
    known.push_back(mode.name);
  }
  if (std::ranges::find(known, request.mode()) == known.end()) {
    throw known.empty() ? Refusal(protocol::Error::KIND_NOT_FOUND, "this application has no modes")
                        : not_found("mode", request.mode(), known);
  }
  note(client, fmt::format("asks for the mode \"{}\"", request.mode()));
  application_.switch_mode(request.mode(), request.why());
  answer.mutable_done()->set_text(fmt::format("the mode \"{}\" was asked for", request.mode()));
}

detail::ComponentCore& Server::component_of(const std::string& name) const {
  std::vector<std::string> known;
  for (const auto& component : application_.components()) {
    known.push_back(component->name);
    if (component->name != name) {
      continue;
    }
    if (name == host::kOwnName || name == host::kLogName) {
      throw Refusal(protocol::Error::KIND_REFUSED, "FastCycle's own component stays as it is");
    }
    return *component;
  }
  throw not_found("component", name, known);
}

void Server::switch_to_standby(Client& client, const protocol::Request& request) {
  need(description_.allows_lifecycle, "lifecycle", "switch components to their standby");
  const detail::ComponentCore& core = component_of(request.lifecycle().component());
  note(client, fmt::format("asks to switch component \"{}\" to its standby", core.name));
  const std::string why_not = application_.switch_to_standby(core);
  if (!why_not.empty()) {
    throw Refusal(protocol::Error::KIND_REFUSED, why_not);
  }
  protocol::Answer answer;
  answer.set_id(request.id());
  answer.mutable_done()->set_text("the standby of component \"" + core.name + "\" takes over");
  client.connection->put(answer);
}

void Server::change_lifecycle(Client& client, const protocol::Request& request) {
  using Lifecycle = protocol::Lifecycle;
  using detail::LifeStep;
  struct Action {
    Lifecycle::Action action;
    const char* verb;
    LifeStep step;
    bool is_reload;
  };
  static constexpr Action kActions[] = {
      {Lifecycle::ACTION_RESTART, "restart", LifeStep::kRenew, false},
      {Lifecycle::ACTION_STOP, "stop", LifeStep::kToolStop, false},
      {Lifecycle::ACTION_START, "start", LifeStep::kToolStart, false},
      {Lifecycle::ACTION_RELOAD, "reload", LifeStep::kReload, true},
      {Lifecycle::ACTION_ROLL_BACK, "roll back", LifeStep::kRollBack, true},
      {Lifecycle::ACTION_CONFIRM, "confirm", LifeStep::kConfirm, true}};
  const Lifecycle& wanted = request.lifecycle();
  if (wanted.action() == Lifecycle::ACTION_SWITCH) {
    switch_to_standby(client, request);
    return;
  }
  const auto* const found = std::ranges::find(kActions, wanted.action(), &Action::action);
  if (found == std::end(kActions)) {
    need(description_.allows_lifecycle, "lifecycle", "stop and start components");
    throw Refusal(protocol::Error::KIND_REFUSED, "a component is restarted, stopped or started");
  }
  if (found->is_reload) {
    need(description_.allows_reload, "reload", "reload components");
  } else {
    need(description_.allows_lifecycle, "lifecycle", "stop and start components");
  }
  detail::ComponentCore& core = component_of(wanted.component());
  note(client,
       fmt::format(
           "asks to {} component \"{}\"{}", found->verb, core.name,
           found->step == LifeStep::kReload ? " with library \"" + wanted.library() + "\"" : ""));
  auto done = [this, name = core.name, verb = found->verb, connection = client.connection->number,
               id = request.id()](const std::string& why_not, const std::string& state) {
    protocol::Answer answer;
    answer.set_id(id);
    const std::string who = "component \"" + name + "\"";
    if (!why_not.empty()) {
      answer = error_answer(id, {protocol::Error::KIND_REFUSED,
                                 to_utf8(fmt::format("{} cannot {}: {}", who, verb, why_not))});
    } else {
      answer.mutable_done()->set_text(fmt::format("{} is {}", who, state));
    }
    give_later(connection, std::move(answer));
  };
  if (found->step == LifeStep::kReload) {
    reload(client, core, wanted, std::move(done));
  } else {
    application_.change_life(core, found->step, std::move(done));
  }
}

void Server::reload(const Client& client, detail::ComponentCore& core,
                    const protocol::Lifecycle& wanted, host::LifeChanges::Done done) {
  constexpr std::int64_t kMostProbationNs = std::int64_t{86'400} * 1'000'000'000;
  if (client.connection->is_within) {
    // It acts for clients on the network.
    throw Refusal(protocol::Error::KIND_NOT_ALLOWED, "a library is loaded for local tools only");
  }
  if (wanted.library().empty()) {
    throw Refusal(protocol::Error::KIND_REFUSED, "which library is it made of?");
  }
  if (application_.is_replayed(core.name) && !application_.runs_elsewhere(core.name)) {
    throw Refusal(protocol::Error::KIND_REFUSED,
                  "a recording is published in the place of this component");
  }
  host::ReloadRequest request{
      .library = wanted.library(),
      .class_name = wanted.class_name(),
      .params = wanted.params_json(),
      .probation = Duration(std::clamp<std::int64_t>(wanted.probation_ns(), 0, kMostProbationNs))};
  if (wanted.has_misses_forgiven()) {
    request.misses_forgiven = wanted.misses_forgiven();
  }
  application_.reload(core, request, std::move(done));
}

void Server::publish(Client& client, const protocol::Publish& request, protocol::Answer& answer) {
  need(description_.allows_publish, "publish", "publish messages");
  voice_->publish(request.topic(), request.message());
  // One line for each topic of a client: it may publish at a rate.
  if (client.published.insert(request.topic()).second) {
    note(client, fmt::format("publishes on \"{}\"", request.topic()));
  }
  answer.mutable_done();
}

void Server::call_service(Client& client, const protocol::Request& request) {
  constexpr std::int64_t kUsualMs = 5000;
  constexpr std::int64_t kMostMs = 60'000;
  need(description_.allows_publish, "publish", "call services");
  const protocol::CallService& wanted = request.call_service();
  const std::int64_t timeout_ms =
      wanted.timeout_ms() <= 0 ? kUsualMs : std::min<std::int64_t>(wanted.timeout_ms(), kMostMs);
  voice_->call(
      wanted.service(), wanted.request(), timeout_ms * 1'000'000,
      [this, connection = client.connection->number, id = request.id()](protocol::Reply reply) {
        protocol::Answer answer;
        answer.set_id(id);
        *answer.mutable_reply() = std::move(reply);
        give(connection, answer);
      });
  note(client, fmt::format("calls \"{}\"", wanted.service()));
}

std::vector<std::string> Server::documents() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const auto& [name, make] : documents_) {
    names.push_back(name);
  }
  return names;
}

void Server::give_document(const protocol::GetDocument& request, protocol::Answer& answer) {
  std::function<std::string()> make;
  {
    const std::lock_guard lock(mutex_);
    const auto found = documents_.find(request.name());
    if (found != documents_.end()) {
      make = found->second;
    }
  }
  if (!make) {
    throw not_found("document", request.name(), documents());
  }
  answer.mutable_document()->set_name(request.name());
  answer.mutable_document()->set_json(to_utf8(make()));
}

detail::Topic& Server::topic_of(const std::string& name) const {
  std::vector<std::string> known;
  for (const SeenTopic& seen : see_topics(application_)) {
    known.push_back(seen.topic->name);
    if (seen.topic->name == name) {
      return const_cast<detail::Topic&>(*seen.topic);
    }
  }
  throw not_found("topic", name, known);
}

void Server::open_stream(Client& client, std::unique_ptr<Stream> stream, protocol::Answer started) {
  client.connection->put(started);
  stream->open();
  client.streams.push_back(std::move(stream));
  next_look_ns_ = 0;
}

void Server::begin_stream(Client& client, const protocol::Request& request) {
  constexpr double kMaxRateHz = 1e6;
  const protocol::Stream& wanted = request.stream();
  if (client.streams.size() + client.log_streams.size() >= kMaxStreams) {
    throw Refusal(protocol::Error::KIND_TOO_MANY,
                  fmt::format("a connection may have {} streams", kMaxStreams));
  }
  Stream::Options options;
  options.content = wanted.content();
  options.every = std::max(1U, wanted.every());
  options.limit = wanted.limit();
  options.with_size = wanted.with_size();
  if (wanted.max_rate_hz() > 0) {
    options.min_interval_ns =
        static_cast<std::int64_t>(1e9 / std::clamp(wanted.max_rate_hz(), 1e-3, kMaxRateHz));
  }
  auto stream = std::make_unique<Stream>(request.id(), options, excerpts_);
  protocol::Answer started;
  started.set_id(request.id());
  started.mutable_started();
  detail::Topic& topic = topic_of(wanted.topic());
  stream->add(taps_.get(topic), *started.mutable_started());
  open_stream(client, std::move(stream), std::move(started));
}

void Server::begin_record(Client& client, const protocol::Request& request) {
  const mcap::TopicFilter filter{
      .topics = {request.record().topics().begin(), request.record().topics().end()},
      .except = {request.record().except().begin(), request.record().except().end()}};
  if (client.streams.size() + client.log_streams.size() >= kMaxStreams) {
    throw Refusal(protocol::Error::KIND_TOO_MANY,
                  fmt::format("a connection may have {} streams", kMaxStreams));
  }
  auto stream = std::make_unique<Stream>(
      request.id(), Stream::Options{.content = protocol::Stream::CONTENT_FULL}, excerpts_);
  protocol::Answer started;
  started.set_id(request.id());
  protocol::Started& said = *started.mutable_started();
  for (const SeenTopic& seen : see_topics(application_)) {
    if (!seen.publishers.empty() && filter.wants(seen.topic->name)) {
      stream->add(taps_.get(const_cast<detail::Topic&>(*seen.topic)), said);
    }
  }
  if (said.channels().empty()) {
    throw Refusal(protocol::Error::KIND_NOT_FOUND, "there is no such topic that is published");
  }
  said.mutable_facts()->insert(explanation_.facts.begin(), explanation_.facts.end());
  said.set_application_json(explanation_.application);
  open_stream(client, std::move(stream), std::move(started));
}

void Server::begin_log(Client& client, const protocol::Request& request) {
  if (client.streams.size() + client.log_streams.size() >= kMaxStreams) {
    throw Refusal(protocol::Error::KIND_TOO_MANY,
                  fmt::format("a connection may have {} streams", kMaxStreams));
  }
  Client::LogStream stream{.id = request.id(), .component = request.stream_log().component()};
  const std::string& level = request.stream_log().level();
  if (!level.empty()) {
    const auto& words = detail::kLogLevelWords;
    const auto found = std::ranges::find(words, std::string_view(level));
    if (found == words.end()) {
      throw not_found("level", level, {words.begin(), words.end()});
    }
    stream.level = static_cast<LogLevel>(found - words.begin());
  }
  protocol::Answer started;
  started.set_id(request.id());
  started.mutable_started();
  client.connection->put(started);
  client.log_streams.push_back(std::move(stream));
  is_log_wanted_.store(true);
}

void Server::end_stream(Client& client, std::uint32_t id) {
  const std::size_t before = client.streams.size() + client.log_streams.size();
  std::erase_if(client.streams, [&](const auto& stream) { return stream->id == id; });
  std::erase_if(client.log_streams, [&](const auto& stream) { return stream.id == id; });
  if (client.streams.size() + client.log_streams.size() == before) {
    return;  // It has ended already.
  }
  protocol::Answer answer;
  answer.set_id(id);
  answer.mutable_ended()->set_why("requested");
  client.connection->put(answer);
}

}  // namespace fastcycle::inspect
