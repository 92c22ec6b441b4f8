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

/// An application of this user that runs and may be looked at.
struct RunningApplication {
  std::string name;
  pid_t pid = 0;
  std::filesystem::path socket;
};

/// What a client could not do.
///
/// @threads  Compatible.
class ClientError : public std::runtime_error {
 public:
  explicit ClientError(protocol::Error error)
      : std::runtime_error(error.text()), error_(std::move(error)) {}

  /// `KIND_UNKNOWN`: there is nobody to talk to, or not any more.
  [[nodiscard]] protocol::Error::Kind kind() const { return error_.kind(); }
  /// What to do; may be empty.
  [[nodiscard]] const std::string& hint() const { return error_.hint(); }
  [[nodiscard]] const protocol::Error& error() const { return error_; }

 private:
  protocol::Error error_;
};

/// Those that there are now, by name. What a crashed run left behind is not among them.
[[nodiscard]] std::vector<RunningApplication> list_applications();

/// The one called `name`; with an empty one, the only one there is.
///
/// @errors  `ClientError` that names those that there are.
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
/// @errors   `ClientError`: what the application refuses, and a connection that has ended.
class Client {
 public:
  static constexpr std::chrono::milliseconds kPatience{5000};

  /// `who` is said to the application, for its log. `patience` is for its first answer.
  Client(const std::filesystem::path& socket, std::string_view who,
         std::chrono::milliseconds patience = kPatience);
  /// The same over a connection that `Server::connect` gave, whose descriptor it takes over.
  Client(int descriptor, std::string_view who, std::chrono::milliseconds patience = kPatience);
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client();

  /// Who answers, and what may be changed.
  [[nodiscard]] const protocol::Welcome& welcome() const { return welcome_; }

  /// The answer to a request that has one. Answers of streams that come meanwhile are kept.
  protocol::Answer ask(protocol::Request request, std::chrono::milliseconds patience = kPatience);

  /// Begins a stream; returns its first answer, `started`, whose id is the stream's.
  protocol::Answer begin(protocol::Request request, std::chrono::milliseconds patience = kPatience);

  /// The next answer of any stream, after up to `patience`; none if there is none yet. The last of
  /// a stream says `ended`; an error of a stream is thrown.
  std::optional<protocol::Answer> next(std::chrono::milliseconds patience);

  /// Asks for the end of a stream; what is under way still comes, and then `ended`.
  void end(std::uint32_t stream);

  /// For who asks for much at once: sends `request`, and returns its id, which the answers have.
  /// `take` gives them, and those of streams, in the order in which they come; errors too. None
  /// within `patience`: there is none yet.
  std::uint32_t post(protocol::Request request) { return send(request); }
  std::optional<protocol::Answer> take(std::chrono::milliseconds patience);

  /// For poll(2): readable when `next` has something, or had something before it was asked.
  [[nodiscard]] int descriptor() const { return socket_; }
  /// Whether `next` has an answer without waiting.
  [[nodiscard]] bool has_next() const { return !streamed_.empty(); }

 private:
  void greet(std::string_view who, std::chrono::milliseconds patience);
  std::uint32_t send(protocol::Request& request);
  /// Reads what is there into the buffer; false if there is nothing.
  bool receive();
  /// Reads one answer; none after `patience`.
  std::optional<protocol::Answer> read(std::chrono::milliseconds patience);
  protocol::Answer await(std::uint32_t id, std::chrono::milliseconds patience);

  int socket_ = -1;
  std::uint32_t ids_ = 0;
  std::string buffer_;     ///< What was read and is no whole frame.
  std::size_t begin_ = 0;  ///< Of it: what is behind was taken.
  std::deque<protocol::Answer> streamed_;
  protocol::Welcome welcome_;
};

}  // namespace fastcycle::inspect
