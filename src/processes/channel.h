#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace fastcycle::processes {

/// What the process that makes the others and one of these say to each other.
enum class Word : char {
  kBuilt = 'b',        ///< From the worker: its components are made; `kHasSources` if some are.
  kConnect = 'c',      ///< To it: all are made; read what they publish.
  kConnected = 'd',    ///< From it: it does.
  kRun = 'r',          ///< To it: all do; start.
  kSourcesOver = 's',  ///< From it: all its sources have finished.
  kSwitch = 'w',  ///< From the main one: the process of this name gives its place to its standby.
  kEnd = 'e',     ///< Both ways, with the reason: the run ends.
};

inline constexpr const char* kHasSources = "sources";

/// One end of the two: messages of a word and a text, in order.
///
/// @threads  `say` is Safe; `hear` by one thread.
class Channel {
 public:
  struct Message {
    Word word{};
    std::string text;
  };

  /// `socket` is owned from now on.
  explicit Channel(int socket = -1) : socket_(socket) {}
  Channel(Channel&& other) noexcept;
  Channel& operator=(Channel&& other) noexcept;
  ~Channel();

  /// Two ends; none if the kernel refused, with `errno`.
  static std::optional<std::pair<Channel, Channel>> make();

  /// Nothing happens if the other end is gone. @pre SIGPIPE is ignored.
  void say(Word word, std::string_view text = {}) const noexcept;
  /// The next message; waits for it. None if the other end is gone.
  [[nodiscard]] std::optional<Message> hear() const;

  [[nodiscard]] int socket() const noexcept { return socket_; }
  void close() noexcept;

 private:
  int socket_;
};

}  // namespace fastcycle::processes
