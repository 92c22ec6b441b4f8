#pragma once

#include <functional>
#include <thread>

namespace fastcycle::tool {

/// Keys of the terminal, one by one as they are pressed, without being shown.
///
/// Ctrl-C and Ctrl-Z do what they always do. The terminal is as it was before when this is gone,
/// when a signal ends the process, and while it is stopped. There is one at a time.
///
/// @threads  Confined to its owner; `on_key` is called on a thread of its own.
class TerminalKeys {
 public:
  /// Whether standard input is a terminal, and this process in its foreground.
  [[nodiscard]] static bool are_there();
  /// Makes the terminal as it was before; for who ends the process at once. Safe in signal
  /// handlers.
  static void give_back() noexcept;

  explicit TerminalKeys(std::function<void(char key)> on_key);
  TerminalKeys(const TerminalKeys&) = delete;
  TerminalKeys& operator=(const TerminalKeys&) = delete;
  ~TerminalKeys();

 private:
  void read();

  const std::function<void(char key)> on_key_;
  int end_[2] = {-1, -1};  ///< A pipe: what is written to it ends the thread.
  std::thread thread_;
};

}  // namespace fastcycle::tool
