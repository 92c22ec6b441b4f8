#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

#include "inspect/inspect.pb.h"

namespace fastcycle::inspect {

/// A running application of this user that can be inspected.
struct RunningApplication {
  std::string name;
  pid_t pid = 0;
  std::filesystem::path socket;
};

/// An error that a request or the connection returned.
///
/// @threads  Compatible.
class ClientError : public std::runtime_error {
 public:
  explicit ClientError(protocol::Error error)
      : std::runtime_error(error.text()), error_(std::move(error)) {}

  /// `KIND_UNKNOWN`: no connection, or it was lost.
  [[nodiscard]] protocol::Error::Kind kind() const { return error_.kind(); }
  /// What the user can do about it; may be empty.
  [[nodiscard]] const std::string& hint() const { return error_.hint(); }
  [[nodiscard]] const protocol::Error& error() const { return error_; }

 private:
  protocol::Error error_;
};

/// The running applications, by name. Excludes what a crashed run left behind.
[[nodiscard]] std::vector<RunningApplication> list_applications();

/// The application `name`; if `name` is empty, the only one that runs.
///
/// @errors  `ClientError` that lists the running applications.
[[nodiscard]] RunningApplication find_application(std::string_view name);

/// A connection to a running application.
///
///     Client client(find_application("").socket, "fastcycle topic hz");
///     Request request;
///     request.mutable_overview();
///     const Answer overview = client.ask(std::move(request));
///
///     Request stream;
///     stream.mutable_stream()->set_topic("lidar/points");
///     const Answer started = client.begin(std::move(stream));
///     while (const auto answer = client.next(100ms)) { … }
///
/// @threads  Confined.
/// @errors   `ClientError`: the application refused the request, or the connection was lost.
class Client {
 public:
  static constexpr std::chrono::milliseconds kPatience{5000};

  /// `who` identifies the client in the application's log. `patience` limits the wait for the
  /// welcome.
  Client(const std::filesystem::path& socket, std::string_view who,
         std::chrono::milliseconds patience = kPatience);
  /// The same over a connection from `Server::connect`; takes over its descriptor.
  Client(int descriptor, std::string_view who, std::chrono::milliseconds patience = kPatience);
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client();

  /// Identity of the application, and what clients may change.
  [[nodiscard]] const protocol::Welcome& welcome() const { return welcome_; }

  /// Returns the single answer to a request. Stream answers that arrive meanwhile are queued.
  protocol::Answer ask(protocol::Request request, std::chrono::milliseconds patience = kPatience);

  /// Begins a stream; returns its first answer, `started`, whose id is the stream's.
  protocol::Answer begin(protocol::Request request, std::chrono::milliseconds patience = kPatience);

  /// The next answer of any stream; none after `patience`. The last answer of a stream is `ended`;
  /// an error of a stream is thrown.
  std::optional<protocol::Answer> next(std::chrono::milliseconds patience);

  /// Requests the end of a stream; answers in flight still arrive, then `ended`.
  void end(std::uint32_t stream);

  /// For many requests at once: sends `request` and returns its id, which its answers carry. `take`
  /// returns these answers, those of streams, and errors, in order of arrival; none after
  /// `patience`.
  std::uint32_t post(protocol::Request request) { return send(request); }
  std::optional<protocol::Answer> take(std::chrono::milliseconds patience);

  /// For poll(2): readable when `next` has data, or had some before the call.
  [[nodiscard]] int descriptor() const { return socket_; }
  /// Whether `next` returns an answer without waiting.
  [[nodiscard]] bool has_next() const { return !streamed_.empty(); }

 private:
  void greet(std::string_view who, std::chrono::milliseconds patience);
  std::uint32_t send(protocol::Request& request);
  /// Reads available data into the buffer; false if there is none.
  bool receive();
  /// Reads one answer; none after `patience`.
  std::optional<protocol::Answer> read(std::chrono::milliseconds patience);
  protocol::Answer await(std::uint32_t id, std::chrono::milliseconds patience);

  int socket_ = -1;
  std::uint32_t ids_ = 0;
  std::string buffer_;     ///< Received bytes that do not form a complete frame yet.
  std::size_t begin_ = 0;  ///< Offset of the first unread byte.
  std::deque<protocol::Answer> streamed_;
  protocol::Welcome welcome_;
};

}  // namespace fastcycle::inspect
