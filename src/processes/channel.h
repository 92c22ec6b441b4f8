#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace fastcycle::processes {

/// Words of the protocol between the supervisor and a worker process.
enum class Word : char {
  kBuilt = 'b',        ///< From the worker: its components are constructed; `kHasSources` if any.
  kConnect = 'c',      ///< To it: all processes are built; connect to what they publish.
  kConnected = 'd',    ///< From it: it is connected.
  kRun = 'r',          ///< To it: all are connected; start.
  kStarted = 't',      ///< From it: its components are started.
  kSourcesOver = 's',  ///< From it: all its sources have finished.
  kSwitch = 'w',       ///< From the main one: the named process hands over to its standby.
  kEnd = 'e',          ///< In both directions, with the reason: the run ends.
};

inline constexpr const char* kHasSources = "sources";

/// One end of the channel: ordered messages of a word and a text.
///
/// @threads  `send` is Safe; `receive` is confined to one thread.
class Channel {
 public:
  struct Message {
    Word word{};
    std::string text;
  };

  /// Takes over `socket`.
  explicit Channel(int socket = -1) : socket_(socket) {}
  Channel(Channel&& other) noexcept;
  Channel& operator=(Channel&& other) noexcept;
  ~Channel();

  /// A connected pair; none, with `errno`, on failure.
  static std::optional<std::pair<Channel, Channel>> make();

  /// Does nothing if the other end is closed. @pre SIGPIPE is ignored.
  void send(Word word, std::string_view text = {}) const noexcept;
  /// Waits for the next message. None if the other end is closed.
  [[nodiscard]] std::optional<Message> receive() const;

  [[nodiscard]] int socket() const noexcept { return socket_; }
  void close() noexcept;

 private:
  int socket_;
};

}  // namespace fastcycle::processes
