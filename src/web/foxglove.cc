#include "web/foxglove.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

namespace fastcycle::web::foxglove {
namespace {

// The first byte of binary frames of the server.
constexpr char kMessageData = 1;
constexpr char kTime = 2;
constexpr char kServiceReply = 3;
constexpr char kPlaybackState = 5;

void append_u32(std::string& out, std::uint32_t number) {
  for (unsigned shift = 0; shift < 32; shift += 8) {
    out.push_back(static_cast<char>((number >> shift) & 0xffU));
  }
}

void append_u64(std::string& out, std::uint64_t number) {
  for (unsigned shift = 0; shift < 64; shift += 8) {
    out.push_back(static_cast<char>((number >> shift) & 0xffU));
  }
}

/// Removes a number from the beginning of `bytes`.
template <typename Number>
std::optional<Number> take(std::string_view& bytes) {
  if (bytes.size() < sizeof(Number)) {
    return std::nullopt;
  }
  Number number = 0;
  for (unsigned i = 0; i < sizeof(Number); ++i) {
    number = static_cast<Number>(number | static_cast<Number>(static_cast<unsigned char>(bytes[i]))
                                              << (8 * i));
  }
  bytes.remove_prefix(sizeof(Number));
  return number;
}

std::optional<std::uint32_t> take_u32(std::string_view& bytes) {
  return take<std::uint32_t>(bytes);
}

std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json json_of(const std::map<std::string, std::set<std::string>>& all, const char* ids) {
  Json list = Json::array();
  for (const auto& [name, components] : all) {
    list.push_back({{"name", name}, {ids, components}});
  }
  return list;
}

/// Names in `before` that are missing in `now`.
Json names_gone(const std::map<std::string, std::set<std::string>>& before,
                const std::map<std::string, std::set<std::string>>& now) {
  Json list = Json::array();
  for (const auto& [name, components] : before) {
    if (!now.contains(name)) {
      list.push_back(name);
    }
  }
  return list;
}

}  // namespace

std::string_view choose_subprotocol(std::string_view offered) {
  std::string_view chosen;
  while (!offered.empty()) {
    const std::size_t comma = std::min(offered.find(','), offered.size());
    std::string_view one = offered.substr(0, comma);
    offered.remove_prefix(std::min(comma + 1, offered.size()));
    while (!one.empty() && (one.front() == ' ' || one.front() == '\t')) {
      one.remove_prefix(1);
    }
    while (!one.empty() && (one.back() == ' ' || one.back() == '\t')) {
      one.remove_suffix(1);
    }
    if (one == kNewSubprotocol) {
      return kNewSubprotocol;
    }
    if (one == kOldSubprotocol) {
      chosen = kOldSubprotocol;
    }
  }
  return chosen;
}

std::string server_info(const std::string& name, const std::string& session,
                        std::span<const std::string_view> capabilities,
                        const std::map<std::string, std::string>& metadata,
                        const std::optional<TimeRange>& data) {
  Json info{{"op", "serverInfo"},           {"name", name},
            {"capabilities", capabilities}, {"supportedEncodings", {kProtobuf, kJson}},
            {"metadata", metadata},         {"sessionId", session}};
  if (data) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    const auto time = [](std::int64_t ns) {
      return Json{{"sec", ns / kSecond}, {"nsec", ns % kSecond}};
    };
    info["dataStartTime"] = time(data->begin_ns);
    info["dataEndTime"] = time(data->end_ns);
  }
  return dump(info);
}

std::string advertise(std::span<const Channel> channels) {
  Json list = Json::array();
  for (const Channel& channel : channels) {
    list.push_back({{"id", channel.id},
                    {"topic", channel.topic},
                    {"encoding", kProtobuf},
                    {"schemaName", channel.type},
                    {"schema", to_base64(channel.schema)},
                    {"schemaEncoding", kProtobuf}});
  }
  return dump({{"op", "advertise"}, {"channels", std::move(list)}});
}

std::string advertise_services(std::span<const Service> services) {
  const auto side = [](const std::string& type, const std::string& schema) {
    return Json{{"encoding", kProtobuf},
                {"schemaName", type},
                {"schemaEncoding", kProtobuf},
                {"schema", to_base64(schema)}};
  };
  Json list = Json::array();
  for (const Service& service : services) {
    list.push_back({{"id", service.id},
                    {"name", service.name},
                    {"type", service.request_type},
                    {"request", side(service.request_type, service.request_schema)},
                    {"response", side(service.reply_type, service.reply_schema)}});
  }
  return dump({{"op", "advertiseServices"}, {"services", std::move(list)}});
}

std::string status(StatusLevel level, std::string_view text, std::string_view id) {
  Json json{{"op", "status"}, {"level", static_cast<int>(level)}, {"message", text}};
  if (!id.empty()) {
    json["id"] = id;
  }
  return dump(json);
}

std::string parameter_values(Json parameters, const std::string& id) {
  Json json{{"op", "parameterValues"}, {"parameters", std::move(parameters)}};
  if (!id.empty()) {
    json["id"] = id;
  }
  return dump(json);
}

std::string service_failure(std::uint32_t service, std::uint32_t call, std::string_view text) {
  return dump(
      {{"op", "serviceCallFailure"}, {"serviceId", service}, {"callId", call}, {"message", text}});
}

std::string graph_update(const Graph& graph, const Graph& before) {
  return dump({{"op", "connectionGraphUpdate"},
               {"publishedTopics", json_of(graph.published, "publisherIds")},
               {"subscribedTopics", json_of(graph.subscribed, "subscriberIds")},
               {"advertisedServices", json_of(graph.services, "providerIds")},
               {"removedTopics", names_gone(before.published, graph.published)},
               {"removedServices", names_gone(before.services, graph.services)}});
}

std::string message_head(std::uint32_t subscription, std::int64_t time_ns) {
  std::string head(1, kMessageData);
  append_u32(head, subscription);
  append_u64(head, static_cast<std::uint64_t>(time_ns));
  return head;
}

std::string time(std::int64_t time_ns) {
  std::string frame(1, kTime);
  append_u64(frame, static_cast<std::uint64_t>(time_ns));
  return frame;
}

std::string service_reply(std::uint32_t service, std::uint32_t call, std::string_view encoding,
                          std::string_view payload) {
  std::string frame(1, kServiceReply);
  append_u32(frame, service);
  append_u32(frame, call);
  append_u32(frame, static_cast<std::uint32_t>(encoding.size()));
  frame += encoding;
  frame += payload;
  return frame;
}

std::string playback_state(const PlaybackState& state) {
  std::string frame(1, kPlaybackState);
  frame.push_back(static_cast<char>(state.status));
  append_u64(frame, static_cast<std::uint64_t>(state.now_ns));
  append_u32(frame, std::bit_cast<std::uint32_t>(state.speed));
  frame.push_back(state.did_seek ? 1 : 0);
  append_u32(frame, static_cast<std::uint32_t>(state.request.size()));
  frame += state.request;
  return frame;
}

std::optional<ClientPlayback> read_playback(std::string_view frame) {
  frame.remove_prefix(std::min<std::size_t>(frame.size(), 1));
  const auto command = take<std::uint8_t>(frame);
  const auto speed = take<std::uint32_t>(frame);
  const auto has_seek = take<std::uint8_t>(frame);
  const auto seek_ns = take<std::uint64_t>(frame);
  const auto length = take_u32(frame);
  if (!command || *command > 1 || !speed || !has_seek || !seek_ns || !length ||
      frame.size() != *length) {
    return std::nullopt;
  }
  return ClientPlayback{.is_pause = *command == 1,
                        .speed = std::bit_cast<float>(*speed),
                        .seek_ns = *has_seek != 0 ? seek_ns : std::nullopt,
                        .request = frame};
}

std::optional<ClientMessage> read_message(std::string_view frame) {
  frame.remove_prefix(std::min<std::size_t>(frame.size(), 1));
  const auto channel = take_u32(frame);
  if (!channel) {
    return std::nullopt;
  }
  return ClientMessage{.channel = *channel, .payload = frame};
}

std::optional<ClientCall> read_call(std::string_view frame) {
  frame.remove_prefix(std::min<std::size_t>(frame.size(), 1));
  const auto service = take_u32(frame);
  const auto call = take_u32(frame);
  const auto length = take_u32(frame);
  if (!service || !call || !length || frame.size() < *length) {
    return std::nullopt;
  }
  return ClientCall{.service = *service,
                    .call = *call,
                    .encoding = frame.substr(0, *length),
                    .payload = frame.substr(*length)};
}

std::optional<std::uint32_t> to_id(const Json& json) {
  if (!json.is_number_unsigned() ||
      json.get<std::uint64_t>() > std::numeric_limits<std::uint32_t>::max()) {
    return std::nullopt;
  }
  return json.get<std::uint32_t>();
}

std::string text_of(const Json& json, const char* name) {
  const auto found = json.find(name);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

std::string to_base64(std::string_view bytes) {
  constexpr std::string_view kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t bits = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      bits = bits << 8U | (j < count ? static_cast<unsigned char>(bytes[i + j]) : 0U);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      text += j <= count ? kLetters[bits >> (18 - 6 * j) & 63U] : '=';
    }
  }
  return text;
}

}  // namespace fastcycle::web::foxglove
