#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

/// The messages of the Foxglove WebSocket protocol: `foxglove.sdk.v1` and `foxglove.websocket.v1`.
///
/// Source: github.com/foxglove/ws-protocol, docs/spec.md; github.com/foxglove/foxglove-sdk. Texts
/// are JSON objects with their type in "op"; binary frames have it in their first byte, and are
/// little-endian.
namespace fastcycle::web::foxglove {

using Json = nlohmann::ordered_json;

inline constexpr std::string_view kNewSubprotocol = "foxglove.sdk.v1";
inline constexpr std::string_view kOldSubprotocol = "foxglove.websocket.v1";

/// Message encodings: the server sends protobuf, clients may also send protobuf's JSON.
inline constexpr std::string_view kProtobuf = "protobuf";
inline constexpr std::string_view kJson = "json";

/// The subprotocol to use with a client that offers `offered`, a comma-separated list; empty: none.
[[nodiscard]] std::string_view choose_subprotocol(std::string_view offered);

/// A topic.
struct Channel {
  std::uint32_t id = 0;
  std::string topic;
  std::string type;
  std::string schema;  ///< A serialized `google.protobuf.FileDescriptorSet`.
};

/// A service.
struct Service {
  std::uint32_t id = 0;
  std::string name;
  std::string request_type;
  std::string request_schema;
  std::string reply_type;
  std::string reply_schema;
};

enum class StatusLevel : std::uint8_t { kInfo = 0, kWarning = 1, kError = 2 };

/// Publishers, subscribers and service providers: names by topic or service.
struct Graph {
  std::map<std::string, std::set<std::string>> published;
  std::map<std::string, std::set<std::string>> subscribed;
  std::map<std::string, std::set<std::string>> services;

  bool operator==(const Graph&) const = default;
};

// ---- Messages from the server ----

/// The first time of a recording that is played, and the last one.
struct TimeRange {
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
};

[[nodiscard]] std::string server_info(const std::string& name, const std::string& session,
                                      std::span<const std::string_view> capabilities,
                                      const std::map<std::string, std::string>& metadata,
                                      const std::optional<TimeRange>& data = {});
[[nodiscard]] std::string advertise(std::span<const Channel> channels);
[[nodiscard]] std::string advertise_services(std::span<const Service> services);
[[nodiscard]] std::string status(StatusLevel level, std::string_view text,
                                 std::string_view id = {});
/// `id`: of the answered request; empty: none.
[[nodiscard]] std::string parameter_values(Json parameters, const std::string& id);
[[nodiscard]] std::string service_failure(std::uint32_t service, std::uint32_t call,
                                          std::string_view text);
/// The entries of `graph`, and the removal of those in `before` that are gone.
[[nodiscard]] std::string graph_update(const Graph& graph, const Graph& before);

/// The header before the payload of a message.
[[nodiscard]] std::string message_head(std::uint32_t subscription, std::int64_t time_ns);
[[nodiscard]] std::string time(std::int64_t time_ns);
[[nodiscard]] std::string service_reply(std::uint32_t service, std::uint32_t call,
                                        std::string_view encoding, std::string_view payload);

/// State of a playback.
struct PlaybackState {
  enum class Status : std::uint8_t { kPlaying = 0, kPaused = 1, kBuffering = 2, kEnded = 3 };
  Status status{};
  std::int64_t now_ns = 0;
  float speed = 1;
  bool did_seek = false;
  std::string request;  ///< The answered request; empty: none.
};
[[nodiscard]] std::string playback_state(const PlaybackState& state);

// ---- Messages from a client ----

/// A published message, a service call, or a control request for a playback.
struct ClientMessage {
  std::uint32_t channel = 0;
  std::string_view payload;
};
struct ClientPlayback {
  bool is_pause = false;
  float speed = 1;
  std::optional<std::uint64_t> seek_ns = {};
  std::string_view request;
};
struct ClientCall {
  std::uint32_t service = 0;
  std::uint32_t call = 0;
  std::string_view encoding;
  std::string_view payload;
};

inline constexpr std::uint8_t kClientMessage = 1;
inline constexpr std::uint8_t kClientCall = 2;
inline constexpr std::uint8_t kClientPlayback = 3;

/// Parses a binary frame, borrowed; none if it is invalid.
[[nodiscard]] std::optional<ClientMessage> read_message(std::string_view frame);
[[nodiscard]] std::optional<ClientCall> read_call(std::string_view frame);
[[nodiscard]] std::optional<ClientPlayback> read_playback(std::string_view frame);

/// An unsigned 32-bit number; none if `json` is something else.
[[nodiscard]] std::optional<std::uint32_t> to_id(const Json& json);
/// The text member `name`; empty if there is none.
[[nodiscard]] std::string text_of(const Json& json, const char* name);

[[nodiscard]] std::string to_base64(std::string_view bytes);

}  // namespace fastcycle::web::foxglove
