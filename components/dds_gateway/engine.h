#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "ros2/buffer.h"

namespace fastcycle::dds_gateway {

/// An error of an engine.
class EngineError final : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Id of a participant, a reader or a writer in the network.
using Guid = std::array<std::uint8_t, 16>;

/// The quality of service on which both sides of a topic have to agree.
struct Qos {
  bool is_reliable = true;
  bool is_transient_local = false;  ///< Late-joining readers get the messages kept by a writer.
  std::size_t depth = 10;           ///< Kept by a writer, or queued in a reader.

  friend bool operator==(const Qos&, const Qos&) = default;
};

/// For display: `reliable, volatile`.
[[nodiscard]] std::string to_text(const Qos& qos);
/// Why a reader that requests `reader` does not match a writer that offers `writer`, with both
/// values; none if they match.
[[nodiscard]] std::optional<std::string> mismatch(const Qos& reader, const Qos& writer);

/// Identifies a request of a service: the client, and the number it assigned.
struct Identity {
  Guid asker{};
  std::int64_t number = 0;

  friend bool operator==(const Identity&, const Identity&) = default;
};

/// Purpose of an endpoint.
enum class Role : std::uint8_t { kTopic, kRequests, kReplies };

/// One end of a topic.
struct Endpoint {
  std::string topic;      ///< `rt/points`
  std::string type;       ///< `sensor_msgs::msg::dds_::PointCloud2_`
  std::string user_data;  ///< `typehash=RIHS01_...;`
  Qos qos;
  bool is_reader = false;
  Role role = Role::kTopic;
  /// For a reader: once `serve` has been called, its callback runs on the engine's thread that
  /// received the message, one at a time, and not in `serve`. This saves waking a thread; the
  /// engine waits for the callback.
  bool is_given_at_once = false;
};

/// A discovery event of another participant.
struct Discovery {
  enum class Kind : std::uint8_t { kParticipant, kEndpoint };
  Kind kind = Kind::kParticipant;
  bool is_gone = false;
  Guid guid{};         ///< Of the participant or the endpoint.
  Guid participant{};  ///< Of an endpoint.
  /// Of a present endpoint; of a participant its user data.
  Endpoint endpoint;
};

/// Facts about a received message.
struct SampleInfo {
  std::chrono::nanoseconds sent{};  ///< By the wall clock of its writer, since 1970.
  std::chrono::nanoseconds came{};  ///< By CLOCK_MONOTONIC here.
  Guid writer{};                    ///< Or another id that is unique here.
  Identity request;                 ///< Of a request and of a reply.
};

/// Options of a participant.
struct ParticipantOptions {
  std::uint32_t domain = 0;
  std::string interface;  ///< `lo`; empty: the engine chooses.
  std::string user_data;  ///< `enclave=/;`
  std::string security;   ///< The folder of an enclave (`dds_security/enclave.h`); empty: none.
};

/// Error text: the permissions of this participant do not allow `endpoint`.
[[nodiscard]] std::string refusal_of_security(const Endpoint& endpoint);

/// Sends serialized messages.
///
/// @threads  Confined to one thread at a time.
class Writer {
 public:
  Writer() = default;
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  virtual ~Writer() = default;

  /// Sends `message`, encapsulation included, and takes it over; its contents are unspecified
  /// afterwards.
  ///
  /// @errors  `EngineError`
  virtual void write(ros2::Buffer& message) = 0;
  /// Sends a request whose reply goes to the reader `replies`; returns its identity.
  ///
  /// @errors  `EngineError`
  virtual Identity write_request(ros2::Buffer& message, const Guid& replies) = 0;
  /// Sends the reply to a request.
  ///
  /// @errors  `EngineError`
  virtual void write_reply(ros2::Buffer& message, const Identity& request) = 0;
  [[nodiscard]] virtual Guid guid() const = 0;
  /// Number of matched readers.
  [[nodiscard]] virtual std::size_t matched() const = 0;
};

/// Called with a serialized message, which is borrowed for the call.
using OnMessage = std::function<void(std::span<const std::byte>, const SampleInfo&)>;

/// Receives serialized messages. Its callback runs on the thread that serves the participant; with
/// `is_given_at_once` on one of the engine, and must not throw then.
///
/// @threads  Safe.
class Reader {
 public:
  Reader() = default;
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  virtual ~Reader() = default;

  [[nodiscard]] virtual Guid guid() const = 0;
  /// Number of matched writers.
  [[nodiscard]] virtual std::size_t matched() const = 0;
  /// Messages lost on the way, or for lack of room.
  [[nodiscard]] virtual std::uint64_t lost() const = 0;
};

/// One participant of a domain. It must outlive its readers and writers.
///
/// @threads  Confined, except `wake`.
class Participant {
 public:
  Participant() = default;
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;
  virtual ~Participant() = default;

  /// @errors  `EngineError`
  [[nodiscard]] virtual std::unique_ptr<Writer> create_writer(const Endpoint& endpoint) = 0;
  /// @errors  `EngineError`
  [[nodiscard]] virtual std::unique_ptr<Reader> create_reader(const Endpoint& endpoint,
                                                              OnMessage on_message) = 0;
  [[nodiscard]] virtual Guid guid() const = 0;
  /// The user data of a service's endpoints besides the type hash, as nodes with this engine send
  /// it.
  [[nodiscard]] virtual std::string service_user_data(bool is_client) = 0;

  /// Waits for input, a call of `wake`, or `timeout`, and calls back with all pending messages of
  /// all readers. All readers are created before the first call.
  virtual void serve(std::chrono::milliseconds timeout) = 0;
  /// Makes `serve` return. @threads Safe.
  virtual void wake() = 0;
  /// Discovery events since the last call. Excludes its own endpoints.
  [[nodiscard]] virtual std::vector<Discovery> discoveries() = 0;
};

/// A DDS implementation available at build time.
struct Engine {
  const char* name = "";  ///< `cyclone`, `fast`
  /// @errors  `EngineError`
  std::unique_ptr<Participant> (*create)(const ParticipantOptions& options) = nullptr;
};

/// In order of preference.
[[nodiscard]] std::span<const Engine> engines();

}  // namespace fastcycle::dds_gateway
