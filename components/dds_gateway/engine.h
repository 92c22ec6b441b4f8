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

/// Something that an engine could not do, in words.
class EngineError final : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Who a participant, a reader or a writer is, in the network.
using Guid = std::array<std::uint8_t, 16>;

/// The quality of service that both sides of a topic have to agree on.
struct Qos {
  bool is_reliable = true;
  bool is_transient_local = false;  ///< Late readers get what a writer keeps.
  std::size_t depth = 10;           ///< Kept by a writer, and waiting in a reader.

  friend bool operator==(const Qos&, const Qos&) = default;
};

/// As people read it: `reliable, volatile`.
[[nodiscard]] std::string to_text(const Qos& qos);
/// Why a reader that asks for `reader` gets nothing of a writer that offers `writer`, with both
/// values; none if it does.
[[nodiscard]] std::optional<std::string> mismatch(const Qos& reader, const Qos& writer);

/// Which request of a service it is: who asks, and the number that it gave it.
struct Identity {
  Guid asker{};
  std::int64_t number = 0;

  friend bool operator==(const Identity&, const Identity&) = default;
};

/// What an endpoint is for.
enum class Role : std::uint8_t { kTopic, kRequests, kReplies };

/// One end of a topic.
struct Endpoint {
  std::string topic;      ///< `rt/points`
  std::string type;       ///< `sensor_msgs::msg::dds_::PointCloud2_`
  std::string user_data;  ///< `typehash=RIHS01_...;`
  Qos qos;
  bool is_reader = false;
  Role role = Role::kTopic;
  /// Of a reader: its callback comes on the thread of the engine that received the message, one at
  /// a time, and not from `serve`, once that was called first. No thread has to be woken for it;
  /// what it does, the engine waits for.
  bool is_given_at_once = false;
};

/// What was seen of others.
struct Discovery {
  enum class Kind : std::uint8_t { kParticipant, kEndpoint };
  Kind kind = Kind::kParticipant;
  bool is_gone = false;
  Guid guid{};         ///< Of the participant or the endpoint.
  Guid participant{};  ///< Of an endpoint.
  /// Of an endpoint that is there; of a participant its user data.
  Endpoint endpoint;
};

/// What came with a message.
struct SampleInfo {
  std::chrono::nanoseconds sent{};  ///< By the clock of the wall of its writer, since 1970.
  std::chrono::nanoseconds came{};  ///< By CLOCK_MONOTONIC here.
  Guid writer{};                    ///< Or another number that this one alone has here.
  Identity request;                 ///< Of a request and of a reply.
};

/// How a participant comes to its network.
struct ParticipantOptions {
  std::uint32_t domain = 0;
  std::string interface;  ///< `lo`; empty: the engine chooses.
  std::string user_data;  ///< `enclave=/;`
  std::string security;   ///< The folder of an enclave (`dds_security/enclave.h`); empty: none.
};

/// That the permissions of this participant do not allow what `endpoint` is for.
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

  /// Sends `message`, encapsulation and all, and takes it over; what is left in it is of no value.
  ///
  /// @errors  `EngineError`
  virtual void write(ros2::Buffer& message) = 0;
  /// Sends a request whose reply comes to the reader `replies`, and says which one it is.
  ///
  /// @errors  `EngineError`
  virtual Identity write_request(ros2::Buffer& message, const Guid& replies) = 0;
  /// Sends the reply to a request.
  ///
  /// @errors  `EngineError`
  virtual void write_reply(ros2::Buffer& message, const Identity& request) = 0;
  [[nodiscard]] virtual Guid guid() const = 0;
  /// Readers that it has found.
  [[nodiscard]] virtual std::size_t matched() const = 0;
};

/// Called with a serialized message, which is borrowed for the call.
using OnMessage = std::function<void(std::span<const std::byte>, const SampleInfo&)>;

/// Receives serialized messages. Its callback comes on the thread that serves the participant; or
/// else, where `is_given_at_once`, on one of the engine, and may then throw nothing.
///
/// @threads  Safe.
class Reader {
 public:
  Reader() = default;
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  virtual ~Reader() = default;

  [[nodiscard]] virtual Guid guid() const = 0;
  /// Writers that it has found.
  [[nodiscard]] virtual std::size_t matched() const = 0;
  /// Messages that were lost on their way to it, or for which there was no room in it.
  [[nodiscard]] virtual std::uint64_t lost() const = 0;
};

/// One participant of a domain. It outlives its readers and writers.
///
/// @threads  Confined, but for `wake`.
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
  /// What the endpoints of a service say of themselves besides the hash of their type, as nodes
  /// with this engine do.
  [[nodiscard]] virtual std::string service_user_data(bool is_client) = 0;

  /// Waits until something came, or `wake` was called, or `timeout` is over, and calls back with
  /// all messages of all readers that are there. All readers are made before the first call.
  virtual void serve(std::chrono::milliseconds timeout) = 0;
  /// Has `serve` return. @threads Safe.
  virtual void wake() = 0;
  /// What was seen of others since the last call. Its own endpoints are left out.
  [[nodiscard]] virtual std::vector<Discovery> discoveries() = 0;
};

/// One of the implementations of DDS that were there when this was built.
struct Engine {
  const char* name = "";  ///< `cyclone`, `fast`
  /// @errors  `EngineError`
  std::unique_ptr<Participant> (*create)(const ParticipantOptions& options) = nullptr;
};

/// The best first.
[[nodiscard]] std::span<const Engine> engines();

}  // namespace fastcycle::dds_gateway
