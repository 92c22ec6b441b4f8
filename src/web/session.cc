#include "web/session.h"

#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include "inspect/inspect.pb.h"

namespace fastcycle::web {
namespace {

namespace protocol = inspect::protocol;
using foxglove::Json;
using foxglove::StatusLevel;

/// The list `name` of `json`; empty if there is none.
const Json& list_of(const Json& json, const char* name) {
  static const Json kNone = Json::array();
  const auto found = json.find(name);
  return found != json.end() && found->is_array() ? *found : kNone;
}

std::string name_of(const protocol::Param& param) {
  return param.component() + "." + param.name();
}

Json to_json(const protocol::Param& param) {
  Json value = Json::parse(param.value_json(), nullptr, false);
  Json json{{"name", name_of(param)}, {"value", value.is_discarded() ? Json() : std::move(value)}};
  // Else 1 would be parsed as an integer.
  if (param.type() == "number") {
    json["type"] = "float64";
  } else if (param.type() == "number[]") {
    json["type"] = "float64_array";
  }
  return json;
}

std::map<std::string, std::string> metadata_of(const Hub& hub) {
  std::map<std::string, std::string> metadata{{"application", hub.welcome().application()},
                                              {"framework", hub.welcome().framework()}};
  if (hub.playback()) {
    metadata["playback"] = hub.playback()->can_seek() ? "any time" : "forward";
  }
  return metadata;
}

foxglove::PlaybackState to_state(const protocol::Playback& playback) {
  using Status = foxglove::PlaybackState::Status;
  foxglove::PlaybackState state{
      .now_ns = playback.now_ns(), .speed = static_cast<float>(playback.speed()), .request = {}};
  switch (playback.status()) {
    case protocol::Playback::STATUS_PAUSED:
      state.status = Status::kPaused;
      break;
    case protocol::Playback::STATUS_ENDED:
      state.status = Status::kEnded;
      break;
    default:
      state.status = Status::kPlaying;
  }
  return state;
}

bool is_known(std::string_view encoding) {
  return encoding == foxglove::kProtobuf || encoding == foxglove::kJson;
}

/// Converts protobuf's JSON to a serialized message.
///
/// @errors  `std::runtime_error` that describes the error.
std::string to_bytes(std::string_view json, const archive::MessageType& type) {
  return type.parse_json(json)->SerializeAsString();
}

std::string to_json(std::string_view bytes, const archive::MessageType& type) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto message = type.parse(mcap::bytes_of(bytes));
  if (!google::protobuf::util::MessageToJsonString(*message, &json, options).ok()) {
    throw std::runtime_error("the answer cannot be written as JSON: it is one of protobuf only");
  }
  return json;
}

/// `value` in the application's form: clients send 3.0 for the integer 3.
std::string to_value(const Json& value) {
  if (value.is_number_float()) {
    const auto number = value.get<double>();
    if (std::floor(number) == number && std::abs(number) < 9e15) {
      return std::to_string(static_cast<std::int64_t>(number));
    }
  }
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

Session::Session(Hub& hub, std::function<void()> wake)
    : hub_(hub), wake_(std::move(wake)), outbox_(hub.options().outbox) {
  hub_.add(*this);
  greet();
}

Session::~Session() {
  for (const auto& [subscription, channel] : subscriptions_) {
    try {
      hub_.unsubscribe(*this, subscription, channel);
    } catch (const inspect::ClientError&) {
      // The application has ended, and its streams with it.
    }
  }
  hub_.remove(*this);
}

void Session::greet() {
  const protocol::Welcome& welcome = hub_.welcome();
  send_text(foxglove::server_info("FastCycle " + welcome.application(), hub_.session_id(),
                                  hub_.capabilities(), metadata_of(hub_),
                                  hub_.playback()
                                      ? std::optional(foxglove::TimeRange{
                                            hub_.playback()->begin_ns(), hub_.playback()->end_ns()})
                                      : std::nullopt));
  send_text(foxglove::advertise(hub_.channels()));
  if (!hub_.services().empty()) {
    send_text(foxglove::advertise_services(hub_.services()));
  }
  if (hub_.playback()) {
    take_playback(*hub_.playback(), false);
  }
}

void Session::send_text(std::string text) {
  outbox_.put_text(std::move(text));
  wake_();
}

void Session::send_binary(std::string bytes) {
  outbox_.put_binary(std::move(bytes));
  wake_();
}

void Session::send_status(StatusLevel level, std::string_view text, std::string_view id) {
  send_text(foxglove::status(level, text, id));
}

void Session::take_message(std::uint32_t subscription,
                           std::shared_ptr<const SharedMessage> message) {
  outbox_.put(subscription, std::move(message));
  wake_();
}

void Session::take_loss(std::uint32_t subscription, std::uint64_t count) {
  lost_[subscription] += count;
}

void Session::take_time(std::int64_t now_ns) {
  send_binary(foxglove::time(now_ns));
}

void Session::take_playback(const protocol::Playback& playback, bool did_seek) {
  foxglove::PlaybackState state = to_state(playback);
  state.did_seek = did_seek;
  if (did_seek) {
    outbox_.forget_messages();  // Control frames go first: these would follow the new state.
  }
  send_binary(foxglove::playback_state(state));
  if (playback.problem() != problem_) {
    problem_ = playback.problem();
    if (!problem_.empty()) {
      send_status(StatusLevel::kError, problem_ + "; paused there", "playback");
    }
  }
}

void Session::take_graph(const foxglove::Graph& graph, const foxglove::Graph& before) {
  send_text(foxglove::graph_update(graph, before));
}

void Session::report_losses() {
  for (const Outbox::Loss& loss : outbox_.take_losses()) {
    lost_[loss.subscription] += loss.count;
  }
  for (const auto& [subscription, count] : std::exchange(lost_, {})) {
    hub_.count_left_out(count);
    const auto found = subscriptions_.find(subscription);
    const foxglove::Channel* channel =
        found == subscriptions_.end() ? nullptr : hub_.find_channel(found->second);
    if (channel != nullptr) {
      send_status(
          StatusLevel::kWarning,
          fmt::format("{}: {} left out, since they came faster than this connection takes them",
                      channel->topic,
                      count == 1 ? "1 message was" : fmt::format("{} messages were", count)),
          "lost " + channel->topic);
    }
  }
}

void Session::take_text(std::string_view text) {
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) {
    refuse("what came is no JSON object");
    return;
  }
  const std::string op = foxglove::text_of(json, "op");
  if (op == "subscribe") {
    subscribe(json);
  } else if (op == "unsubscribe") {
    unsubscribe(json);
  } else if (op == "advertise") {
    advertise(json);
  } else if (op == "unadvertise") {
    unadvertise(json);
  } else if (op == "getParameters") {
    get_params(json);
  } else if (op == "setParameters") {
    set_params(json);
  } else if (op == "subscribeParameterUpdates") {
    subscribe_params(json, true);
  } else if (op == "unsubscribeParameterUpdates") {
    subscribe_params(json, false);
  } else if (op == "subscribeConnectionGraph") {
    wants_graph_ = true;
    send_text(foxglove::graph_update(hub_.graph(), {}));
  } else if (op == "unsubscribeConnectionGraph") {
    wants_graph_ = false;
  } else {
    refuse(fmt::format("\"{}\" is no operation that this server offers", op.substr(0, 64)));
  }
}

void Session::take_binary(std::string_view frame) {
  const std::uint8_t op = frame.empty() ? 0 : static_cast<std::uint8_t>(frame.front());
  if (op == foxglove::kClientMessage) {
    if (const auto message = foxglove::read_message(frame)) {
      publish(*message);
      return;
    }
  } else if (op == foxglove::kClientCall) {
    if (const auto one = foxglove::read_call(frame)) {
      call(*one);
      return;
    }
  } else if (op == foxglove::kClientPlayback) {
    if (const auto playback = foxglove::read_playback(frame)) {
      control(*playback);
      return;
    }
  }
  refuse(fmt::format("a binary frame of {} bytes that begins with {} is none of this protocol",
                     frame.size(), op));
}

void Session::subscribe(const Json& json) {
  for (const Json& one : list_of(json, "subscriptions")) {
    const auto id = one.is_object() && one.contains("id") ? foxglove::to_id(one["id"])
                                                          : std::optional<std::uint32_t>();
    const auto channel_id = one.is_object() && one.contains("channelId")
                                ? foxglove::to_id(one["channelId"])
                                : std::optional<std::uint32_t>();
    if (!id || !channel_id) {
      refuse("a subscription expects \"id\" and \"channelId\", both numbers of 32 bits");
    } else if (hub_.find_channel(*channel_id) == nullptr) {
      refuse(fmt::format("there is no channel {}", *channel_id));
    } else if (subscriptions_.contains(*id)) {
      refuse(fmt::format("there is a subscription {} already", *id));
    } else if (subscriptions_.size() >= kMaxSubscriptions) {
      refuse(fmt::format("a client has at most {} subscriptions", kMaxSubscriptions));
    } else {
      subscriptions_[*id] = *channel_id;
      outbox_.add(*id);
      hub_.subscribe(*this, *id, *channel_id);
    }
  }
}

void Session::unsubscribe(const Json& json) {
  for (const Json& one : list_of(json, "subscriptionIds")) {
    const auto id = foxglove::to_id(one);
    const auto found = id ? subscriptions_.find(*id) : subscriptions_.end();
    if (found == subscriptions_.end()) {
      send_status(StatusLevel::kWarning,
                  "there is no such subscription: " + one.dump().substr(0, 64));
      continue;
    }
    hub_.unsubscribe(*this, found->first, found->second);
    outbox_.remove(found->first);
    lost_.erase(found->first);
    subscriptions_.erase(found);
  }
}

void Session::advertise(const Json& json) {
  for (const Json& one : list_of(json, "channels")) {
    const auto id = one.is_object() && one.contains("id") ? foxglove::to_id(one["id"])
                                                          : std::optional<std::uint32_t>();
    const std::string topic = one.is_object() ? foxglove::text_of(one, "topic") : std::string();
    if (!id || topic.empty()) {
      refuse("a channel expects \"id\", a number of 32 bits, and \"topic\"");
    } else if (!hub_.may_publish(topic)) {
      refuse(
          fmt::format("topic \"{}\" may not be published on: the application's \"live\" names "
                      "topics for that in \"publish\", and its \"inspect\" allows it",
                      topic));
    } else if (const auto* channel = hub_.find_channel(topic); channel == nullptr) {
      refuse(fmt::format("there is no topic \"{}\"", topic));
    } else if (const std::string encoding = foxglove::text_of(one, "encoding");
               !is_known(encoding)) {
      refuse(fmt::format("topic \"{}\" expects the encoding protobuf or json, type {}, not \"{}\"",
                         topic, channel->type, encoding.substr(0, 64)));
    } else if (own_channels_.size() >= kMaxChannels && !own_channels_.contains(*id)) {
      refuse(fmt::format("a client has at most {} channels", kMaxChannels));
    } else {
      own_channels_[*id] = {.topic = topic, .is_json = encoding == foxglove::kJson};
    }
  }
}

void Session::unadvertise(const Json& json) {
  for (const Json& one : list_of(json, "channelIds")) {
    if (const auto id = foxglove::to_id(one)) {
      own_channels_.erase(*id);
    }
  }
}

void Session::publish(const foxglove::ClientMessage& message) {
  const auto found = own_channels_.find(message.channel);
  if (found == own_channels_.end()) {
    refuse(fmt::format("channel {} was not advertised", message.channel));
    return;
  }
  const auto& [topic, is_json] = found->second;
  protocol::Request request;
  request.mutable_publish()->set_topic(topic);
  try {
    const foxglove::Channel& channel = *hub_.find_channel(topic);
    request.mutable_publish()->set_message(
        is_json ? to_bytes(message.payload, hub_.type_of(channel.type, channel.schema))
                : std::string(message.payload));
  } catch (const std::runtime_error& error) {
    refuse(fmt::format("topic \"{}\": {}", topic, error.what()));
    return;
  }
  hub_.ask(*this, std::move(request), [this, asked = topic](const auto& answer) {
    if (answer.has_error()) {
      refuse(fmt::format("topic \"{}\": {}", asked, answer.error().text()));
    }
  });
}

void Session::call(const foxglove::ClientCall& call) {
  const foxglove::Service* service = hub_.find_service(call.service);
  const auto fail = [this, id = call.service, number = call.call](std::string_view text) {
    send_text(foxglove::service_failure(id, number, text));
  };
  if (service == nullptr) {
    fail(fmt::format("there is no service {}", call.service));
    return;
  }
  if (!is_known(call.encoding)) {
    fail(fmt::format("service \"{}\" expects the encoding protobuf or json, not \"{}\"",
                     service->name, call.encoding.substr(0, 64)));
    return;
  }
  const bool is_json = call.encoding == foxglove::kJson;
  protocol::Request request;
  request.mutable_call_service()->set_service(service->name);
  try {
    request.mutable_call_service()->set_request(
        is_json
            ? to_bytes(call.payload, hub_.type_of(service->request_type, service->request_schema))
            : std::string(call.payload));
  } catch (const std::runtime_error& error) {
    fail(error.what());
    return;
  }
  hub_.ask(
      *this, std::move(request),
      [this, fail, is_json, id = call.service, number = call.call](const protocol::Answer& answer) {
        if (answer.has_error()) {
          fail(answer.error().text());
        } else if (answer.reply().status() != "ok") {
          fail(answer.reply().status() + ": " + answer.reply().error());
        } else if (is_json) {
          const foxglove::Service& its = *hub_.find_service(id);
          try {
            send_binary(foxglove::service_reply(
                id, number, foxglove::kJson,
                to_json(answer.reply().reply(), hub_.type_of(its.reply_type, its.reply_schema))));
          } catch (const std::runtime_error& error) {
            fail(error.what());
          }
        } else {
          send_binary(
              foxglove::service_reply(id, number, foxglove::kProtobuf, answer.reply().reply()));
        }
      });
}

void Session::control(const foxglove::ClientPlayback& playback) {
  protocol::Request request;
  protocol::ControlPlayback& control = *request.mutable_playback();
  control.set_command(playback.is_pause ? protocol::ControlPlayback::COMMAND_PAUSE
                                        : protocol::ControlPlayback::COMMAND_PLAY);
  control.set_speed(double{playback.speed});
  if (playback.seek_ns) {
    control.set_has_seek(true);
    control.set_seek_ns(static_cast<std::int64_t>(*playback.seek_ns));
  }
  hub_.ask(*this, std::move(request),
           [this, id = std::string(playback.request)](const protocol::Answer& answer) {
             if (answer.has_error()) {
               refuse(answer.error().text());
               if (!hub_.playback()) {
                 return;
               }
             }
             foxglove::PlaybackState state =
                 to_state(answer.has_playback() ? answer.playback() : *hub_.playback());
             state.request = id;
             send_binary(foxglove::playback_state(state));
           });
}

void Session::get_params(const Json& json) {
  std::set<std::string> names;
  for (const Json& one : list_of(json, "parameterNames")) {
    if (one.is_string()) {
      names.insert(one.get<std::string>());
    }
  }
  protocol::Request request;
  request.mutable_params();
  hub_.ask(*this, std::move(request),
           [this, names, id = foxglove::text_of(json, "id")](const protocol::Answer& answer) {
             if (answer.has_error()) {
               refuse(answer.error().text());
             }
             Json values = Json::array();
             for (const protocol::Param& param : answer.params().params()) {
               if (names.empty() || names.contains(name_of(param))) {
                 values.push_back(to_json(param));
               }
             }
             send_text(foxglove::parameter_values(std::move(values), id));
           });
}

void Session::set_params(const Json& json) {
  if (!hub_.may("params")) {
    refuse(
        "params may not be changed: the application's \"inspect\" allows it with the word "
        "\"params\"");
    return;
  }
  protocol::Request request;
  Json names = Json::array();
  for (const Json& one : list_of(json, "parameters")) {
    const std::string name = one.is_object() ? foxglove::text_of(one, "name") : std::string();
    if (name.empty() || !one.contains("value")) {
      refuse("a parameter expects \"name\" and \"value\"; none can be removed");
      return;
    }
    auto& change = *request.mutable_change_params()->add_changes();
    change.set_param(name);
    change.set_value_json(to_value(one["value"]));
    names.push_back(name);
  }
  if (names.empty()) {
    return;
  }
  hub_.ask(*this, std::move(request),
           [this, names, id = foxglove::text_of(json, "id")](const protocol::Answer& answer) {
             if (answer.has_error()) {
               refuse(answer.error().text());
             }
             for (const std::string& error : answer.params_changed().errors()) {
               refuse(error);
             }
             hub_.params_have_changed();
             if (!id.empty()) {
               get_params({{"parameterNames", names}, {"id", id}});
             }
           });
}

void Session::subscribe_params(const Json& json, bool is_wanted) {
  const Json& names = list_of(json, "parameterNames");
  for (const Json& one : names) {
    if (!one.is_string()) {
      continue;
    }
    if (!is_wanted) {
      params_.erase(one.get<std::string>());
    } else if (params_.size() < kMaxParams) {
      params_.insert(one.get<std::string>());
    }
  }
  if (!is_wanted && names.empty()) {
    params_.clear();
  }
  wants_params_ = is_wanted || !params_.empty();
  sent_params_.clear();
  hub_.params_have_changed();
}

void Session::take_params(const protocol::Params& params) {
  if (!wants_params_) {
    return;
  }
  Json changed = Json::array();
  for (const protocol::Param& param : params.params()) {
    const std::string name = name_of(param);
    if (!params_.empty() && !params_.contains(name)) {
      continue;
    }
    std::string& sent = sent_params_[name];
    if (sent != param.value_json()) {
      sent = param.value_json();
      changed.push_back(to_json(param));
    }
  }
  if (!changed.empty()) {
    send_text(foxglove::parameter_values(std::move(changed), {}));
  }
}

}  // namespace fastcycle::web
